"""`uavseg compare`, from the command line to changes that plan flies over and preview draws."""

import json
from collections.abc import Iterator
from contextlib import chdir
from pathlib import Path

import geopandas
import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner, Result

from benchmarks.changes import draw_pair, run_map
from uavseg.cli import main
from uavseg.occupancy.map_file import write_map

PLACE = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6)}
RANGE = ("--range", "0.5,1", "--stretch", "0,255", "-o", "changes.gpkg")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path) -> Iterator[None]:
    """Two dates of a field: a pond that grew, and one that dried up."""
    with chdir(tmp_path):
        before = np.full((160, 200), 40, np.uint8)
        before[20:60, 20:60] = before[100:130, 120:180] = 220
        after = np.full_like(before, 40)
        after[20:60, 20:100] = 220
        for name, image in (("before.tif", before), ("after.tif", after)):
            size = {"count": 1, "height": 160, "width": 200, "dtype": "uint8"}
            with rasterio.open(name, "w", "GTiff", **size, **PLACE) as file:
                file.write(image, 1)
        yield


@pytest.fixture(scope="module")
def maps(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    """Two maps of a room, the second shifted by (2, 1) cells and turned by 1 degree."""
    folder, pair = tmp_path_factory.mktemp("maps"), draw_pair(0)
    names = str(folder / "before.yaml"), str(folder / "after.yaml")
    for name, boxes, motion in zip(names, (pair.before, pair.after), ((0, 0, 0), (2, 1, 1)), strict=True):
        grid = run_map(pair.scene(boxes), len(name), motion)
        write_map(name, grid.probabilities, grid.geobox)
    return names


def run(*words: object) -> Result:
    return CliRunner().invoke(main, ["compare", *map(str, words)])


def done(*words: object) -> Result:
    result = run(*words)
    assert result.exit_code == 0, result.output
    return result


@pytest.mark.slow
def test_changes_are_a_file_of_regions_with_sums_and_a_picture() -> None:
    result = done("before.tif", "after.tif", *RANGE, "--png", "changes.png")
    assert "in range 3,400 to 3,200, of 32,000 on the grid of BOTH" in result.stderr
    assert "gained 1,600 pixels" in result.stderr and "lost 1,800 pixels" in result.stderr
    found = geopandas.read_file("changes.gpkg")
    assert found["class"].tolist() == ["lost", "gained"] and found["pixels"].tolist() == [1800, 1600]
    assert found.crs == PLACE["crs"] and found["source"].unique().tolist() == ["before.tif, after.tif"]
    assert Path("changes.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_a_mission_flies_over_what_was_gained() -> None:
    done("before.tif", "after.tif", *RANGE)
    fly = ["plan", "changes.gpkg", "-o", "fly.plan", "--altitude", "40", "--home", "auto", "--spacing", "15"]
    fly += ["--angle", "0"]
    planned = CliRunner().invoke(main, [*fly, "--where", "class == 'gained'"])
    assert planned.exit_code == 0 and "1 region" in planned.output
    items = json.loads(Path("fly.plan").read_text())["mission"]["items"]
    lons = [item["params"][5] for item in items if item.get("command") == 16]
    gained = geopandas.read_file("changes.gpkg").query("`class` == 'gained'").to_crs(4326).total_bounds
    assert lons and gained[0] - 1e-5 <= min(lons) and max(lons) <= gained[2] + 1e-5
    drawn = CliRunner().invoke(main, ["preview", "after.tif", "--regions", "changes.gpkg", "-o", "p.png"])
    assert drawn.exit_code == 0 and Path("p.png").exists()


@pytest.mark.slow
def test_two_maps_are_registered_and_the_shift_is_said(maps: tuple[str, str]) -> None:
    result = done(*maps, "-o", "changes.geojson", "--png", "changes.png")
    assert "of the occupied cells lie on each other" in result.stderr
    found = geopandas.read_file("changes.geojson")
    assert sorted(kind for kind in found["class"] if "seen" not in kind) == ["gone", "gone", "new", "new"]
    said = next(line for line in result.stderr.splitlines() if line.strip().startswith("shift"))
    numbers = [float(word.rstrip(",")) for word in said.split() if word[0] in "-0123456789"]
    assert np.abs(np.array(numbers[:3]) - (2, 1, 1)).max() < 0.3


@pytest.mark.slow
def test_a_map_has_not_changed_from_itself(maps: tuple[str, str]) -> None:
    result = done(maps[0], maps[0], "-o", "-")
    assert json.loads(result.stdout)["features"] == [] and "no change" in result.stderr


@pytest.mark.slow
def test_nothing_is_overwritten_or_left_half(maps: tuple[str, str]) -> None:
    Path("changes.gpkg").write_text("kept")
    for words, text in (
        (("before.tif", "after.tif", *RANGE), "exists"),
        (("before.tif", "after.tif", *RANGE[:-1], "before.tif"), "written to"),
        (("before.tif", "after.tif", *RANGE[:-1], "a.gpkg", "--png", "changes.jpg"), "PNG"),
        (("before.tif", "none.tif", *RANGE[:-1], "a.gpkg"), "none.tif"),
        (("before.tif", "after.tif", "-o", "a.gpkg"), "is compared by a range"),
        (("before.tif", maps[1], "-o", "a.gpkg"), "coordinate system"),
        ((maps[0], maps[1], "-o", "a.gpkg", "--resume", "x"), "nothing to resume"),
    ):
        result = run(*words)
        assert result.exit_code == 1, result.output
        assert text in result.stderr and "Traceback" not in result.output
        assert len([line for line in result.stderr.splitlines() if "error" in line]) == 1
    assert Path("changes.gpkg").read_text() == "kept"
    assert sorted(path.name for path in Path().iterdir()) == ["after.tif", "before.tif", "changes.gpkg"]
    assert run("before.tif", "after.tif").exit_code == 2
