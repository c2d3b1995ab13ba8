"""Layer of leaves: they tile the raster and lie in their position."""

from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from hypothesis import given, settings, strategies as st

from tests.plot.layers.maps import BOX, LOCAL, MOST, UTM, rgb, write
from uavseg.errors import ParameterError, RasterError
from uavseg.plot.layers import raster_layers as leaves_layer
from uavseg.plot.page.page import Frame
from uavseg.plot.preview import preview
from uavseg.raster.formats.geotiff import write_geotiff
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import TilePass
from uavseg.raster.intensity.stretch import fit_stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.segmentation import in_memory
from uavseg.segmentation.blocks.block_file import Origin, SavedBlocks, write_block_map
from uavseg.segmentation.blocks.block_map import find_leaves
from uavseg.segmentation.params.segment import DivisionParams


@settings(max_examples=30)
@given(st.integers(0, 2**32), st.integers(1, 150), st.integers(1, 150))
def test_leaves_tile_the_raster(seed: int, rows: int, cols: int) -> None:
    rng = np.random.default_rng(seed)
    blocks = in_memory.block_map_of_array(rng.choice([100, 60000], (rows, cols)).astype(np.uint16))
    blocks.ratios[:] = rng.choice([0.0, 2.0], blocks.ratios.shape)
    side, _ = find_leaves(blocks, DivisionParams(1.2, np.inf))
    cells = -(-rows // 8), -(-cols // 8)
    corners, sides = leaves_layer.leaf_squares(side[: cells[0], : cells[1]].astype(np.int64), (rows, cols))
    painted = np.zeros((rows, cols), int)
    for corner, own in zip(corners, sides, strict=True):
        (top, left), (bottom, right) = corner[0], corner[2]
        painted[top:bottom, left:right] += own
    assert np.array_equal(painted, side.repeat(8, 0).repeat(8, 1)[:rows, :cols])


def saved_blocks(path: Path, values: np.ndarray, box: GeoBox = BOX) -> Path:
    blocks = in_memory.block_map_of_array((values * 65535).astype(np.uint16))
    stretch = fit_stretch(Dataset.of_values(values, box, "map"), "none", TilePass([]))
    write_block_map(
        path,
        SavedBlocks(blocks, box, stretch, "band 1", Origin(("map.tif",), ".")),
        DivisionParams(1.2, np.inf),
        True,
    )
    return path


@pytest.mark.slow
def test_leaves_are_outlined_where_they_lie(tmp_path: Path) -> None:
    values = np.full((128, 192), 0.5, np.float32)
    values[:20, :20] = 0.9
    raster, blocks = write(tmp_path / "a.tif", values), saved_blocks(tmp_path / "b.tif", values)
    layer = leaves_layer.LeavesLayer.of(blocks, Frame(BOX), MOST)
    assert (layer.sides < 64).sum() > 3 and (layer.sides == 64).sum() == 5
    small = layer.corners[layer.sides < 64]
    assert small[..., 0].max() == pytest.approx(-48 + 32) and small[..., 1].min() == pytest.approx(32 - 32)
    plain, lined = (preview(raster, tmp_path / f"{n}.png", leaves=b) for n, b in enumerate((None, blocks)))
    changed = (rgb(plain) != rgb(lined)).any(axis=2)
    assert changed.any()


def test_block_maps_of_another_raster_and_other_files_are_refused(tmp_path: Path) -> None:
    values = np.full((128, 192), 0.5, np.float32)
    raster = write(tmp_path / "a.tif", values)
    shifted = GeoBox(BOX.shape, Affine(0.5, 0, 4e5 + 8, 0, -0.5, 5e6), UTM)
    half = GeoBox((64, 192), BOX.transform, UTM)
    two = tmp_path / "two.tif"
    write_geotiff(two, [values[:16, :24], values[:16, :24]], BOX.coarsen(8))
    for wrong, error, message in (
        (saved_blocks(tmp_path / "b.tif", values, shifted), RasterError, "of this raster"),
        (saved_blocks(tmp_path / "c.tif", values, LOCAL), RasterError, "coordinate system"),
        (saved_blocks(tmp_path / "d.tif", values[:64], half), RasterError, "of this raster"),
        (two, RasterError, "not a block map"),
        (raster, ParameterError, "band 2"),
    ):
        with pytest.raises(error, match=message):
            preview(raster, tmp_path / "out.png", leaves=wrong)
        assert not (tmp_path / "out.png").exists()
    with pytest.raises(ParameterError, match="too small to be seen"):
        leaves_layer.LeavesLayer.of(tmp_path / "b.tif", Frame(BOX), 20)
