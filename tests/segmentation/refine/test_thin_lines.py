"""Thin lines: as a plain version finds them, whole and without gaps; almost none in noise."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.typing import NDArray
from scipy import ndimage

from uavseg.segmentation.refine.detail import MARGIN, find_thin_lines

SEEDS = st.integers(0, 100_000)
PAD = 80
GROUND, BELOW = 0.6, (0, int(0.54 * 65535))

Grey = NDArray[np.uint16]
Mask = NDArray[np.bool_]
Image = NDArray[np.float64]


def walks(seed: int, width: int, noise: float, contrast: float, shape: tuple[int, int]) -> tuple[Grey, Mask]:
    """Dark lines of this width on ground with noise, and where they are."""
    rng = np.random.default_rng(seed)
    truth = np.zeros(shape, bool)
    for _ in range(3):
        place, heading = rng.uniform(0, shape), rng.uniform(0, 2 * np.pi)
        for _ in range(400):
            heading += rng.normal(0, 0.06)
            place += np.sin(heading), np.cos(heading)
            if (place >= 0).all() and (place < shape).all():
                truth[tuple(place.astype(int))] = True
    truth = ndimage.binary_dilation(truth, np.ones((width, width))) if width > 1 else truth
    v = GROUND - contrast * truth + rng.normal(0, noise, shape)
    return (65535 * np.clip(v, 0, 1)).astype(np.uint16), truth


def lines_of(grey: Grey, greys: tuple[int, int] = BELOW, valid: Mask | None = None) -> Mask:
    """Lines of an image that lies in nothing."""
    whole = [-(-length // 16) * 16 - length for length in grey.shape]
    around = [(PAD, PAD + more) for more in whole]
    known = np.pad(np.ones(grey.shape, np.uint8) if valid is None else valid.astype(np.uint8), around)
    found = find_thin_lines(np.pad(grey, around) * known, known, greys, PAD)
    assert not found[known[PAD - MARGIN : MARGIN - PAD, PAD - MARGIN : MARGIN - PAD] == 0].any()
    return found[MARGIN : MARGIN + grey.shape[0], MARGIN : MARGIN + grey.shape[1]] > 0


def moved(image: Image, row: int, col: int) -> Image:
    """The value that lies so many rows and columns farther at each place; NaN outside."""
    rows, cols = image.shape
    padded: Image = np.pad(image, 8, constant_values=np.nan)
    return padded[8 + row : 8 + row + rows, 8 + col : 8 + col + cols]


def line_and_sides(image: Image, k: int) -> tuple[Image, Image, Image]:
    """Means along a line in direction k of 16, and of its two sides."""
    down, across = math.sin(math.pi * k / 16), math.cos(math.pi * k / 16)
    if abs(across) >= abs(down):
        steps = [(math.floor(t * down / across + 0.5), t) for t in range(-7, 8)]
    else:
        steps = [(t, math.floor(t * across / down + 0.5)) for t in range(-7, 8)]
    line: Image = np.sum([moved(image, *step) for step in steps], axis=0) / 15
    one, other = (
        np.mean([moved(line, math.floor(f * across + 0.5), math.floor(-f * down + 0.5)) for f in far], axis=0)
        for far in ((3, 4), (-3, -4))
    )
    return line, one, other


def plain_spread(image: Image) -> Image:
    """Standard deviation of the difference of a line and a side around each pixel."""
    squares = [-(-length // 16) for length in image.shape]
    sizes: list[list[list[float]]] = [[[] for _ in range(squares[1])] for _ in range(squares[0])]
    for k in (0, 4, 8, 12):
        line, one, _ = line_and_sides(image, k)
        for row, col in np.argwhere(np.isfinite(line - one)):
            sizes[row // 16][col // 16].append(abs(30 * (line - one)[row, col]))
    found = np.zeros(squares)
    for row, col in np.ndindex(*squares):
        near = [
            np.mean(sizes[r][c])
            for r in range(max(row - 1, 0), min(row + 2, squares[0]))
            for c in range(max(col - 1, 0), min(col + 2, squares[1]))
            if sizes[r][c]
        ]
        found[row, col] = sorted(near)[len(near) // 2] if near else 0
    found = np.maximum(found * math.sqrt(math.pi / 2), 74 * math.sqrt(90))
    return found.repeat(16, 0).repeat(16, 1)[: image.shape[0], : image.shape[1]]


def plain(grey: Grey, valid: Mask, greys: tuple[int, int]) -> Mask:
    """The same definition with whole arrays of doubles; NaN where a pixel is not valid."""
    image = np.where(valid, grey, np.nan)
    spread = plain_spread(image)
    flags = [np.zeros(grey.shape, bool) for _ in range(2)]
    for k in range(16):
        line, one, other = line_and_sides(image, k)
        low, high = np.minimum(one, other), np.maximum(one, other)
        in_range = (np.round(15 * line) >= 15 * greys[0]) & (np.round(15 * line) <= 15 * greys[1])
        contrast = np.where(low > greys[1], low - line, np.where(high < greys[0], line - high, -1.0))
        for flag, z in zip(flags, (2.5, 4.5), strict=True):
            flag |= in_range & (np.round(30 * contrast) > np.floor(z * spread))
    lines = ndimage.binary_dilation(flags[1], np.ones((3, 3)), iterations=8, mask=flags[0])
    joined: Mask = lines.copy()
    away = np.maximum(np.maximum(greys[0] - image, image - greys[1]), 0)
    away[~valid] = np.inf
    for row, col in np.ndindex(grey.shape[0] - 1, grey.shape[1] - 1):
        p, q, r, s = (row, col), (row, col + 1), (row + 1, col), (row + 1, col + 1)
        for here, there, first, second in ((p, s, q, r), (q, r, p, s)):
            if lines[here] and lines[there] and not lines[first] and not lines[second]:
                nearer = first if away[first] <= away[second] else second
                joined[nearer] |= np.isfinite(away[nearer])
    return joined


@pytest.mark.slow
@given(SEEDS, st.integers(1, 3), st.sampled_from([0.0, 0.03, 0.08]), st.booleans(), st.booleans())
def test_they_are_those_of_a_plain_version(
    seed: int, width: int, noise: float, bright: bool, holes: bool
) -> None:
    grey, _ = walks(seed, width, noise, 0.15, (75, 90))
    greys = BELOW
    if bright:
        grey, greys = 65535 - grey, (65535 - BELOW[1], 65535)
    rng = np.random.default_rng(seed)
    valid = ndimage.gaussian_filter(rng.normal(size=grey.shape), 4) > (-0.07 if holes else -9)
    assert np.array_equal(lines_of(grey, greys, valid), plain(grey, valid, greys))


@pytest.mark.parametrize(
    "width, noise, recall", [(1, 0.05, 0.75), (2, 0.08, 0.75), (3, 0.08, 0.7), (2, 0.03, 0.8)]
)
def test_lines_in_noise_are_found_and_little_else(width: int, noise: float, recall: float) -> None:
    grey, truth = walks(3, width, noise, 0.15, (400, 400))
    found = lines_of(grey)
    near = ndimage.binary_dilation(truth, np.ones((3, 3)))
    assert (found & truth).sum() > recall * truth.sum()
    assert (found & near).sum() > 0.93 * found.sum()
    single = (grey <= BELOW[1]) & ~near
    assert single.sum() > 20 * (found & ~near).sum()  # pixels alone would be many


@pytest.mark.slow
@pytest.mark.parametrize("grain", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (0.6, 1.5))])
def test_noise_alone_has_almost_no_lines(grain: float) -> None:
    rng = np.random.default_rng(1)
    field = rng.normal(size=(1024, 1024))
    field = ndimage.gaussian_filter(field, grain) if grain else field
    v = GROUND + 0.08 * field / field.std()
    found = lines_of((65535 * np.clip(v, 0, 1)).astype(np.uint16), (0, int(0.58 * 65535)))
    assert found.mean() < 1e-4


def test_edges_and_wide_things_are_no_lines() -> None:
    rows, cols = np.indices((160, 160))
    for mask in (rows + 2 * cols > 200, abs(rows - cols) < 8, np.hypot(rows - 80, cols - 80) < 10):
        v = GROUND - 0.2 * mask + np.random.default_rng(0).normal(0, 0.02, mask.shape)
        assert not lines_of((65535 * v).astype(np.uint16)).any()


def test_a_step_between_two_sides_of_the_range_is_no_line() -> None:
    """Where bright ground meets dark ground, a mean between lies in a range between."""
    v = np.where(np.indices((100, 100))[1] < 50, 0.2, 0.8)
    v[:, 50] = 0.5
    grey = (65535 * v).astype(np.uint16)
    assert not lines_of(grey, (int(0.4 * 65535), int(0.6 * 65535))).any()


def test_a_diagonal_line_is_one_component_by_edges() -> None:
    v = np.full((120, 120), GROUND)
    v[np.arange(120), np.arange(120)] = 0.4
    found = lines_of((65535 * v).astype(np.uint16))
    assert ndimage.label(found)[1] == 1
    assert found.sum() > 2 * 95 and found[30, 30] and found[90, 90]
