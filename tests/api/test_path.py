"""`uavseg.path`: the same way over a map, however the map comes."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import uavseg
from tests.occupancy.paths.sight import is_visible
from uavseg.cli import main
from uavseg.errors import IntensityRangeError, MapError, ParameterError, PathError
from uavseg.jobs.maps.path import PathRequest, free_cells
from uavseg.jobs.source.open_source import open_probability_map
from uavseg.jobs.source.source import ProbabilityMap
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.ros.ros_map import write_ros_map
from uavseg.raster.formats.geotiff import write_geotiff
from uavseg.raster.grid.geobox import local_geobox
from uavseg.raster.grid.tiling import Window
from uavseg.segmentation.params.segment import IntensityRange, SegmentParams

CELL = 0.25
RANGE = (0, 0.45)
ENDS = {"start": (2.1, 2.1), "goal": (29.9, 2.1)}
BOX = local_geobox((128, 128), CELL, (0.0, 0.0))


def beliefs() -> np.ndarray:
    """Free space around a wall that reaches from below to the middle, and nothing known above."""
    v = np.full((128, 128), 0.1, np.float32)
    v[:30] = 0.5
    v[60:, 60:68] = 0.9
    return v


def grid() -> OccupancyGrid:
    return OccupancyGrid.from_probabilities(beliefs(), BOX)


def test_a_way_goes_round_the_wall_within_the_range() -> None:
    way = uavseg.path(grid(), RANGE, **ENDS)
    assert np.allclose(way.xy[[0, -1]], [[2.125, 2.125], [29.875, 2.125]])
    assert way.length_m == pytest.approx(np.hypot(*np.diff(way.xy, axis=0).T).sum())
    assert way.xy[:, 1].max() > CELL * (128 - 60) and way.xy[:, 1].max() < CELL * (128 - 30)
    tight = uavseg.path(grid(), RANGE, **ENDS, smooth=True)
    assert tight.length_m < way.length_m and len(tight.xy) < 9
    assert uavseg.path(grid(), RANGE, **ENDS, clearance=1.0).length_m > way.length_m


@pytest.mark.filterwarnings("ignore:.*coordinates are local")
def test_a_raster_and_an_array_are_the_same_map(tmp_path: Path) -> None:
    write_geotiff(tmp_path / "map.tif", [beliefs()], BOX)
    ways = [uavseg.path(source, RANGE, **ENDS) for source in (grid(), tmp_path / "map.tif")]
    ways += [uavseg.path(uavseg.Dataset.open(tmp_path / "map.tif"), RANGE, **ENDS, tile=64, threads=1)]
    assert len({way.xy.tobytes() for way in ways}) == 1
    bare = uavseg.path(beliefs(), RANGE, start=(8.4, 119.6), goal=(119.6, 119.6))  # columns and rows
    assert np.array_equal(bare.corners, ways[0].corners)


def test_a_ros_map_is_in_metres_and_leads_the_same_way(tmp_path: Path) -> None:
    states = np.where(beliefs() < 0.5, 1, np.where(beliefs() > 0.5, 3, 2))
    write_ros_map(tmp_path / "map.yaml", states, BOX)
    way = uavseg.path(tmp_path / "map.yaml", RANGE, **ENDS)
    assert np.array_equal(way.xy, uavseg.path(grid(), RANGE, **ENDS).xy)
    run = [
        "path",
        str(tmp_path / "map.yaml"),
        "--range",
        "0,0.45",
        "--start",
        "2.1,2.1",
        "--goal",
        "29.9,2.1",
    ]
    told = CliRunner().invoke(main, [*run, "-o", str(tmp_path / "path.geojson")])
    assert told.exit_code == 0 and f"{way.length_m:,.3f} m " in told.stderr
    line = json.loads((tmp_path / "path.geojson").read_text())["features"][0]["geometry"]["coordinates"]
    assert line == way.xy.tolist()


@pytest.mark.filterwarnings("ignore:.*coordinates are local")
def test_finished_tiles_are_taken_up(tmp_path: Path) -> None:
    write_geotiff(tmp_path / "map.tif", [beliefs()], BOX)
    found = [uavseg.path(tmp_path / "map.tif", RANGE, **ENDS, resume=tmp_path / "kept") for _ in range(2)]
    assert any((tmp_path / "kept").rglob("*.npz")) and np.array_equal(found[0].xy, found[1].xy)
    with pytest.raises(ParameterError):  # a map in memory may change
        uavseg.path(grid(), RANGE, **ENDS, resume=tmp_path / "kept")


@pytest.mark.filterwarnings("ignore:.*coordinates are local")
def test_what_cannot_be_is_refused(tmp_path: Path) -> None:
    for wrong, error in (
        ({"range": (0.45, 0)}, IntensityRangeError),
        ({"goal": (2.1, 31.9)}, PathError),
        ({"start": (-1, 0)}, PathError),
        ({"clearance": -1}, ParameterError),
        ({"method": "best"}, ParameterError),
    ):
        with pytest.raises(error):
            uavseg.path(grid(), **({"range": RANGE} | ENDS | wrong))
    write_geotiff(tmp_path / "percent.tif", [100 * beliefs()], BOX)
    with pytest.raises(MapError, match="--stretch"):
        uavseg.path(tmp_path / "percent.tif", RANGE, **ENDS)
    assert uavseg.path(tmp_path / "percent.tif", RANGE, **ENDS, stretch="0,100").cells > 100


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*of grey 205:UserWarning")  # free_thresh 0.25, as this map is published
@pytest.mark.parametrize("name", ["depot.yaml", "tb3_sandbox.yaml"])
def test_on_real_maps_no_way_enters_a_cell_out_of_the_range(name: str, shared_data: Path) -> None:
    opened = open_probability_map(shared_data / "maps" / name)
    assert isinstance(opened, ProbabilityMap)
    dataset = opened.dataset
    values, _ = dataset.read(Window(0, 0, *dataset.geobox.shape))
    safe = values[0] <= 0.45
    request = PathRequest(IntensityRange(*RANGE), (0, 0), (0, 0), segment=SegmentParams(refine="scan"))
    _, mask, walls = free_cells(opened, request).of_regions([1])
    assert walls > 100 and mask.sum() <= safe.sum()
    source, found = shared_data / "maps" / name, 0
    for first, last in np.random.default_rng(7).choice(np.argwhere(safe), (12, 2)):
        ends = [tuple(map(float, dataset.geobox.xy_from_pixel(*(cell + 0.5)))) for cell in (first, last)]
        try:
            ways = [
                uavseg.path(source, RANGE, *ends, smooth=smooth, refine="scan") for smooth in (False, True)
            ]
        except PathError as error:  # one of them lies inside of something
            assert "region" in str(error)
            continue
        found += 1
        assert all(is_visible(safe, *leg) for way in ways for leg in pairwise(way.corners))
        assert ways[1].length_m <= ways[0].length_m + 1e-9
    assert found >= 6
