"""Two-level masks give back the pixels that they were made from, by window, by sample and in tiles."""

import numpy as np
from hypothesis import given, strategies as st
from numpy.typing import NDArray

from uavseg.raster.grid.tiling import PixelMask, Window, tiles


@st.composite
def images(draw: st.DrawFn) -> NDArray[np.bool_]:
    """Masks with whole, empty and mixed blocks, of sides that are not multiples of 64."""
    rows, cols = draw(st.integers(1, 200)), draw(st.integers(1, 200))
    rng = np.random.default_rng(draw(st.integers(0, 1000)))
    kind = np.kron(rng.integers(0, 3, (4, 4)), np.ones((64, 64), int))[:rows, :cols]
    return np.where(kind == 2, rng.random((rows, cols)) < 0.5, kind == 1)


@given(images(), st.data())
def test_a_window_is_what_it_was(image: NDArray[np.bool_], data: st.DataObject) -> None:
    row, col = (data.draw(st.integers(0, length - 1)) for length in image.shape)
    rows = data.draw(st.integers(1, image.shape[0] - row))
    cols = data.draw(st.integers(1, image.shape[1] - col))
    window = Window(row, col, rows, cols)
    mask = PixelMask.of(image)
    assert np.array_equal(mask.read(window), image[window.slices])
    assert mask.touches(window) or not image[window.slices].any()
    assert not mask.covers(window) or image[window.slices].all()


@given(images(), st.sampled_from([64, 128]))
def test_tiles_joined_are_the_whole(image: NDArray[np.bool_], side: int) -> None:
    whole = PixelMask.of(image)
    parts = [(window, PixelMask.of(image[window.slices])) for window in tiles(image.shape, side)]
    joined = PixelMask.joined(image.shape, parts[::-1])
    for name in ("codes", "places", "bits"):
        assert np.array_equal(getattr(joined, name), getattr(whole, name)), name


@given(images(), st.integers(1, 50))
def test_a_sample_is_that_of_the_pixels(image: NDArray[np.bool_], count: int) -> None:
    rows, cols = (np.linspace(0, length - 1, count).astype(int) for length in image.shape)
    assert np.array_equal(PixelMask.of(image).sample(rows, cols), image[np.ix_(rows, cols)])


def test_a_large_mask_takes_little_memory() -> None:
    image = np.zeros((2048, 2048), bool)
    image[:, 1000:] = True
    mask = PixelMask.of(image)
    assert len(mask.places) == 32 and mask.bits.nbytes == 32 * 512
