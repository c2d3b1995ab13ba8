"""A tile of grey is the raster with zeros around it."""

import numpy as np
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from tests.segmentation.in_memory_dataset import field_of, source_of
from uavseg.raster.grid.tiling import Window, tiles
from uavseg.segmentation.refine.range_scans import REFINE_HALO

shapes = st.tuples(st.integers(1, 200), st.integers(1, 200))


@settings(max_examples=40)
@given(st.integers(0, 999), shapes, st.sampled_from([64, 128]), st.sampled_from([0, 1, REFINE_HALO]))
def test_a_tile_is_the_raster_padded_with_zeros(
    seed: int, shape: tuple[int, int], side: int, margin: int
) -> None:
    dataset = field_of(seed, shape)
    beyond = [(margin, margin + side)] * 2
    grey = np.pad(np.where(dataset.valid, dataset.values * np.uint16(257), 0), beyond)
    valid = np.pad(dataset.valid, beyond)
    for window in tiles(shape, side):
        tile = source_of(dataset).read(window, margin)
        rows, cols = (-(-length // 64) * 64 + 2 * margin for length in (window.rows, window.cols))
        part = np.s_[window.row : window.row + rows, window.col : window.col + cols]
        inner = np.s_[: window.rows + 2 * margin, : window.cols + 2 * margin]
        assert tile.grey.shape == tile.valid.shape == (rows, cols)
        assert np.array_equal(tile.grey[inner], grey[part][inner])
        assert np.array_equal(tile.valid[inner], valid[part][inner])
        assert not tile.valid[grey_beyond(shape, window, margin, tile.valid.shape)].any()
        assert tile.all_valid == bool(tile.valid.all())
        assert (tile.mask is None) == tile.all_valid and (tile.all_valid or tile.mask is tile.valid)
        assert tile.grey.flags.c_contiguous and tile.valid.flags.c_contiguous


def grey_beyond(
    shape: tuple[int, int], window: Window, margin: int, size: tuple[int, int]
) -> NDArray[np.bool_]:
    """Pixels of a tile that lie outside the raster."""
    row, col = np.indices(size)
    row, col = row + window.row - margin, col + window.col - margin
    return (row < 0) | (col < 0) | (row >= shape[0]) | (col >= shape[1])
