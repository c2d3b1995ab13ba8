"""Windows that fit into a sample, and cells that lie within regions."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.typing import NDArray

from uavseg.raster.grid.tiling import TilePass, Window, tiles
from uavseg.regions.outline.rings import Rings
from uavseg.regions.outline.trace import trace
from uavseg.regions.sample.place import SampleMask
from uavseg.regions.sample.scores import fitting_window, inner_cells
from uavseg.segmentation.components import label_components


def sample(mask: NDArray[np.bool_]) -> SampleMask:
    return SampleMask(Window(0, 0, *mask.shape), np.packbits(mask, axis=1))


@pytest.mark.parametrize(("side", "window"), [(8, None), (27, None), (28, 16), (56, 32), (200, 32)])
def test_squares_hold_windows_of_a_third_of_their_area(side: int, window: int | None) -> None:
    assert fitting_window(sample(np.ones((side, side), bool))) == window


def test_long_strips_hold_windows_as_wide_as_they_are() -> None:
    assert fitting_window(sample(np.ones((15, 900), bool))) == 16  # fifteen sixteenths of a window
    assert fitting_window(sample(np.ones((12, 900), bool))) is None
    assert fitting_window(sample(np.ones((24, 900), bool))) == 24


def rings_of(image: NDArray[np.bool_]) -> Rings:
    return trace(label_components(image.view(np.uint8))[0])


@given(st.data())
def test_inner_cells_are_those_without_a_pixel_outside(data: st.DataObject) -> None:
    shape = data.draw(st.integers(1, 200)), data.draw(st.integers(1, 200))
    rng = np.random.default_rng(data.draw(st.integers(0, 9)))
    coarse = rng.random((26, 26)) < 0.7
    image = coarse.repeat(8, 0).repeat(8, 1)[: shape[0], : shape[1]] & (rng.random(shape) < 0.997)
    found = inner_cells(rings_of(image), shape, TilePass(tiles(shape, data.draw(st.sampled_from([64, 256])))))
    for row, col in np.ndindex(*found.shape):
        cell = image[8 * row : 8 * row + 8, 8 * col : 8 * col + 8]
        assert found[row, col] == (cell.size == 64 and bool(cell.all()))
