"""`uavseg merge-maps`, from the command line to the files that Nav2 and classify read."""

from contextlib import chdir
from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from click.testing import CliRunner, Result

from uavseg.cli import main
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.ros.ros_map import read_ros_map, transform_of, write_ros_map
from uavseg.raster.formats.geotiff import write_geotiff
from uavseg.raster.grid.geobox import GeoBox, local_geobox

SHAPE = (30, 50)


def states() -> np.ndarray:
    found = np.full(SHAPE, 2, np.uint8)
    found[5:25, 8:40] = 1
    found[5, 8:40] = found[5:25, 8] = found[15, 20] = 3
    return found


@pytest.fixture(autouse=True)
def folder(tmp_path: Path) -> None:
    with chdir(tmp_path):
        write_ros_map("map.yaml", states(), local_geobox(SHAPE, 0.05, (-1.0, 2.0)))
        yield


def run(*words: object) -> Result:
    return CliRunner().invoke(main, ["merge-maps", *map(str, words)])


def done(*words: object) -> Result:
    result = run(*words)
    assert result.exit_code == 0, result.output
    return result


def test_a_cropped_map_keeps_its_place() -> None:
    result = done("map.yaml", "-o", "crop.yaml", "--crop")
    assert "20 x 32 cells of 0.05 m from -0.6, 2.25, yaw 0" in result.stderr
    whole, part = read_ros_map("map.yaml"), read_ros_map("crop.yaml")
    assert np.array_equal(part.cells, whole.cells[5:25, 8:40])
    assert part.geobox.xy_from_pixel(0, 0) == pytest.approx(whole.geobox.xy_from_pixel(5, 8))


def test_a_map_on_its_side_is_turned_exactly() -> None:
    box = GeoBox(SHAPE, transform_of((3.0, -1.0, np.pi / 2), 0.05, SHAPE[0]), None)
    write_ros_map("side.yaml", states(), box)
    done("side.yaml", "-o", "level.yaml", "--unrotate")
    assert "origin: [1.5, -1.0, 0.0]" in Path("level.yaml").read_text()
    assert np.array_equal(read_ros_map("level.yaml").cells, np.rot90(read_ros_map("side.yaml").cells))


def test_maps_of_two_rooms_become_one_and_what_they_dispute_is_said() -> None:
    other = states()
    other[15, 20], other[10, 10] = 1, 3
    write_ros_map("other.yaml", other, local_geobox(SHAPE, 0.05, (-1.0, 2.0)))
    write_ros_map("next.yaml", states(), local_geobox(SHAPE, 0.05, (-1.0 + 30 * 0.05, 2.0)))
    result = done("map.yaml", "other.yaml", "next.yaml", "-o", "all.yaml")
    assert "cells are free in one map and occupied in another; they count as occupied" in result.stderr
    found = read_ros_map("all.yaml").cells
    assert found.shape == (30, 80) and found[15, 20] == found[10, 10] == found[15, 50] == 100
    assert done("other.yaml", "next.yaml", "map.yaml", "-o", "again.yaml").exit_code == 0
    assert Path("all.pgm").read_bytes() == Path("again.pgm").read_bytes()


@pytest.mark.parametrize(("mode", "picture"), [("scale", "grey.png"), ("raw", "grey.pgm")])
def test_all_levels_are_read_back_to_the_per_cent(mode: str, picture: str) -> None:
    p = np.linspace(0, 1, 1001, dtype=np.float32).reshape(7, 143)
    write_geotiff("p.tif", [p], GeoBox(p.shape, Affine(0.05, 0, 0, 0, -0.05, 0), None), ["occupancy"])
    done("p.tif", "-o", "grey.yaml", "--mode", mode)
    assert Path(picture).exists()
    found = read_ros_map("grey.yaml")
    assert np.abs(found.probabilities - p).max() <= (0.0071 if mode == "scale" else 0.0051)
    assert len(np.unique(found.cells)) == 102 and found.cells[3, 71] == -1  # exactly one half
    assert not found.warnings


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["map.pgm", "-o", "o.yaml"], "is a picture without a position"),
        (["map.yaml", "-o", "o.tif", "--mode", "scale"], "mode is of a ROS map"),
        (["map.yaml", "-o", "o.png"], "a map is written to .yaml"),
        (["map.yaml", "-o", "o.yaml", "--resolution", "0"], "0.000001 or more, not 0"),
        (["map.yaml", "-o", "o.yaml", "--resolution", "nan"], "0.000001 or more, not nan"),
        (["map.yaml", "-o", "o.yaml", "--resolution", "5e-324"], "0.000001 or more, not 4.94066e-324"),
        (["map.yaml", "-o", "o.yaml", "--resolution", "1e-6"], "at most 100,000,000"),
        (["missing.yaml", "-o", "o.yaml"], "missing.yaml"),
        (["map.yaml", "-o", "map.yaml", "--overwrite"], "map.yaml"),
        (["unknown.yaml", "-o", "o.yaml", "--crop"], "every cell of the map is unknown"),
    ],
)
def test_bad_input_is_one_line_and_nothing_written(words: list[str], said: str) -> None:
    write_ros_map("unknown.yaml", np.full(SHAPE, 2), local_geobox(SHAPE, 0.05, (0, 0)))
    before = {path: path.read_bytes() for path in Path().iterdir()}
    result = run(*words)
    lines = result.stderr.splitlines()
    assert result.exit_code == 1 and len(lines) == 1 and said in lines[0], result.output
    assert before == {path: path.read_bytes() for path in Path().iterdir()}


def test_no_map_is_a_usage_error() -> None:
    assert run("-o", "o.yaml").exit_code == 2


def test_a_grid_that_was_saved_holds_no_probabilities() -> None:
    OccupancyGrid.empty((4, 4), 0.1).save("grid.tif")
    result = run("grid.tif", "-o", "o.yaml")
    assert (
        result.exit_code == 1 and "holds log-odds, of which OccupancyGrid.load makes a map" in result.stderr
    )
