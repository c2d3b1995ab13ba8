"""Saved grids: merging goes on where it stopped, and what is no grid is refused in one line."""

from pathlib import Path

import numpy as np
import pytest

from tests.occupancy.random_scans import random_scan
from uavseg.errors import MapError, OutputError, OutputExistsError, UavsegError
from uavseg.occupancy.mapping import grid_io
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.raster.formats.geotiff import write_geotiff
from uavseg.raster.grid.geobox import GeoBox, local_geobox

SHAPE = (70, 90)


def merged(seed: int, count: int = 6) -> OccupancyGrid:
    rng = np.random.default_rng(seed)
    grid = OccupancyGrid.empty(SHAPE, 0.1, (-3.0, 1.5))
    for _ in range(count):
        grid.merge(random_scan(rng, SHAPE, 0.1))
    return grid


def test_merging_goes_on_where_it_stopped(tmp_path: Path) -> None:
    grid = merged(1)
    assert grid.log_odds.any()
    grid.save(tmp_path / "map.tif")
    loaded = OccupancyGrid.load(tmp_path / "map.tif")
    assert np.array_equal(loaded.log_odds, grid.log_odds) and loaded.geobox == grid.geobox
    later = random_scan(np.random.default_rng(9), SHAPE, 0.1)
    for one in (grid, loaded):
        one.update(later)
    assert np.array_equal(loaded.log_odds, grid.log_odds)
    assert np.array_equal(loaded.probabilities, grid.probabilities)
    assert np.array_equal(loaded.segmentation.intervals, grid.segmentation.intervals)


def test_a_rotated_grid_is_saved_with_its_place(tmp_path: Path) -> None:
    from affine import Affine

    turned = GeoBox(SHAPE, Affine.translation(4, 5) @ Affine.rotation(30) @ Affine.scale(0.1, -0.1), None)
    OccupancyGrid(turned).save(tmp_path / "map.tif")
    found = OccupancyGrid.load(tmp_path / "map.tif").geobox.transform
    np.testing.assert_allclose(tuple(found)[:6], tuple(turned.transform)[:6], rtol=1e-12)


def test_a_file_is_replaced_only_if_that_is_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "map.tif"
    merged(1).save(path)
    before = path.read_bytes()
    with pytest.raises(OutputExistsError):
        merged(2).save(path)
    assert path.read_bytes() == before
    merged(2).save(path, overwrite=True)
    assert np.array_equal(OccupancyGrid.load(path).log_odds, merged(2).log_odds)
    assert [file.name for file in tmp_path.iterdir()] == ["map.tif"]


def test_a_grid_is_saved_as_a_geotiff(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"name a \.tif"):
        merged(1).save(tmp_path / "map.npz")


def test_every_cut_of_a_file_is_one_line(tmp_path: Path) -> None:
    merged(1).save(tmp_path / "map.tif")
    content = (tmp_path / "map.tif").read_bytes()
    cut = tmp_path / "cut.tif"
    for length in range(0, len(content) - 1, len(content) // 40):
        cut.write_bytes(content[:length])
        with pytest.raises(UavsegError) as raised:
            OccupancyGrid.load(cut)
        assert "cut.tif" in str(raised.value)


def test_other_rasters_are_refused(tmp_path: Path) -> None:
    path, place = tmp_path / "other.tif", local_geobox(SHAPE, 0.1, (0, 0))
    for bands in (
        [np.zeros(SHAPE, np.float32)],
        [np.zeros(SHAPE, np.uint8)],
        2 * [np.zeros(SHAPE, np.float32)],
    ):
        write_geotiff(path, bands, place, overwrite=True)
        with pytest.raises(MapError, match=r"other.tif is not a grid that OccupancyGrid.save saved"):
            OccupancyGrid.load(path)
    path.write_bytes(b"PK\3\4 not a raster")
    with pytest.raises(UavsegError, match=r"other\.tif"):
        OccupancyGrid.load(path)
    with pytest.raises(UavsegError, match="there is no file"):
        OccupancyGrid.load(tmp_path / "none.tif")


@pytest.mark.parametrize("wrong", [7.0, np.nan, -np.inf])
def test_log_odds_that_no_scan_makes_are_damage(tmp_path: Path, wrong: float) -> None:
    odds = np.zeros(SHAPE, np.float32)
    odds[3, 4] = wrong
    grid_io.write_grid_file(tmp_path / "map.tif", odds, local_geobox(SHAPE, 0.1, (0, 0)))
    with pytest.raises(MapError, match=r"map.tif is damaged: log-odds of a grid lie in -6..6"):
        OccupancyGrid.load(tmp_path / "map.tif")


def test_too_many_cells_are_neither_saved_nor_loaded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    merged(1).save(tmp_path / "map.tif")
    monkeypatch.setattr(grid_io, "MAX_CELLS", 1000)
    with pytest.raises(MapError, match=r"map.tif has 90 x 70 cells; at most 1,000"):
        OccupancyGrid.load(tmp_path / "map.tif")
    with pytest.raises(MapError, match="this grid has 90 x 70 cells"):
        merged(1).save(tmp_path / "new.tif")
    assert not (tmp_path / "new.tif").exists()
