"""Tiles cover a raster once, on the grid of blocks."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from uavseg.errors import ParameterError
from uavseg.raster.grid.tiling import Window, tile_side, tiles
from uavseg.units import BLOCK

shapes = st.tuples(st.integers(0, 400), st.integers(0, 400))
sides = st.integers(1, 5).map(lambda k: 64 * k)
places = st.integers(-50, 90)
windows = st.builds(Window, places, places, st.integers(0, 60), st.integers(0, 60))


@settings(max_examples=60)
@given(shapes, sides, sides)
def test_tiles_cover_a_raster_once(shape: tuple[int, int], rows: int, cols: int) -> None:
    covered = np.zeros(shape, int)
    found = tiles(shape, (rows, cols))
    for window in found:
        assert 0 < window.rows <= rows and 0 < window.cols <= cols
        assert window.row % BLOCK == 0 and window.col % BLOCK == 0
        covered[window.slices] += 1
    assert (covered == 1).all()
    assert [(w.row, w.col) for w in found] == sorted((w.row, w.col) for w in found)


def test_one_side_is_used_for_both() -> None:
    assert tiles((300, 200), 128) == tiles((300, 200), (128, 128))


@pytest.mark.parametrize("side", [0, -64, 32, 100, (64, 65), (0, 64)])
def test_a_side_that_is_not_a_multiple_of_64_is_refused(side: int | tuple[int, int]) -> None:
    with pytest.raises(ParameterError, match="a positive multiple of 64 pixels, not"):
        tiles((100, 100), side)


@given(windows, shapes)
def test_a_clipped_window_is_the_intersection(window: Window, shape: tuple[int, int]) -> None:
    clipped = window.clipped(shape)
    assert clipped.rows >= 0 and clipped.cols >= 0
    rows = set(range(window.row, window.row + window.rows)) & set(range(shape[0]))
    cols = set(range(window.col, window.col + window.cols)) & set(range(shape[1]))
    assert set(range(clipped.row, clipped.row + clipped.rows)) == rows
    assert set(range(clipped.col, clipped.col + clipped.cols)) == cols


@given(windows, st.integers(0, 70))
def test_a_grown_window_shrinks_back(window: Window, margin: int) -> None:
    grown = window.grown(margin)
    assert (grown.rows, grown.cols) == (window.rows + 2 * margin, window.cols + 2 * margin)
    assert grown.grown(-margin) == window


def test_slices_index_a_window() -> None:
    image = np.arange(20).reshape(4, 5)
    assert image[Window(1, 2, 2, 3).slices].tolist() == [[7, 8, 9], [12, 13, 14]]


lengths = st.integers(1, 200_000)


@settings(max_examples=200)
@given(st.tuples(lengths, lengths), st.tuples(lengths, lengths), st.integers(1, 1 << 24))
def test_a_tile_that_suits_a_file_is_of_whole_blocks(
    shape: tuple[int, int], file_block: tuple[int, int], pixels: int
) -> None:
    rows, cols = tile_side(shape, file_block, pixels)
    assert rows > 0 and cols > 0 and rows % BLOCK == 0 and cols % BLOCK == 0
    assert rows * cols <= max(pixels, BLOCK * max(cols, BLOCK))


def test_strips_are_read_by_whole_rows_and_tiles_by_squares() -> None:
    assert tile_side((9000, 5000), (1, 5000)) == (768, 5056)
    assert tile_side((9000, 5000), (512, 512)) == (2048, 2048)
    assert tile_side((9000, 100), (1, 100)) == (2048, 2048)  # narrow: the strips are short anyway
    assert tile_side((10, 200_000), (1, 200_000)) == (64, 200_000)
    assert tile_side((10, 10_000_000), (1, 10_000_000)) == (2048, 2048)  # 64 whole rows are too much at once


def test_tiles_that_are_far_too_many_are_refused_before_any_is_made() -> None:
    with pytest.raises(ParameterError, match=r"divide the raster into 244,140,625, .*--tile"):
        tiles((1_000_000, 1_000_000), 64)
    assert len(tiles((1_000_000, 1_000_000), 64_000)) == 256


@given(windows, windows)
def test_the_common_part_of_two_windows_has_the_pixels_of_both(first: Window, second: Window) -> None:
    def pixels(window: Window) -> set[tuple[int, int]]:
        rows = range(window.row, window.row + window.rows)
        return {(i, j) for i in rows for j in range(window.col, window.col + window.cols)}

    assert pixels(first.common(second)) == pixels(first) & pixels(second)
