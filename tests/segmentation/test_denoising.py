"""Total variation as it is told, pixel by pixel in plain arrays; and what it leaves alone."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy import ndimage

from uavseg.segmentation.blockmap import BlockMap
from uavseg.segmentation.denoising import STEPS, denoised
from uavseg.segmentation.refinement import REACH
from uavseg.segmentation.unsettled import unsettled

Image = NDArray[np.uint8]
Grey = NDArray[np.uint16]
Plane = NDArray[np.float32]
seeds = st.integers(0, 100_000)
LOW, HIGH = 0.35, 0.65


def random_case(seed: int, cells: tuple[int, int]) -> tuple[Image, Image, Image, Grey]:
    """Patches of grey with noise, holes in the valid pixels, cells inside and cells to be decided."""
    rng = np.random.default_rng(seed)
    side = int(rng.choice([3, 9, 20]))
    shape = (8 * cells[0], 8 * cells[1])
    patches = rng.choice([0.2, 0.4, 0.5, 0.6, 0.9], [n // side + 1 for n in shape])
    v = patches.repeat(side, 0).repeat(side, 1)[: shape[0], : shape[1]]
    v = v + rng.normal(0, rng.choice([0, 0.01, 0.2]), shape)
    valid = (rng.random(shape) > rng.choice([0, 0.02, 0.3])).astype(np.uint8)
    grey = (np.clip(v, 0, 1) * 65535).astype(np.uint16) * valid
    inside = np.kron(rng.integers(0, 2, cells), np.ones((8, 8), int)).astype(np.uint8) & valid
    return inside, (rng.random(cells) < rng.choice([0.05, 0.4, 1])).astype(np.uint8), valid, grey


def per_pixel(cells: NDArray[Any]) -> NDArray[Any]:
    return cells.repeat(8, 0).repeat(8, 1)


def plain_noise(side: int, every: int, valid: Image, grey: Grey) -> NDArray[np.float64]:
    """Median over the 5 x 5 cells around each cell of their mean |response| to Immerkaer's operator."""
    operator = np.outer([1, -2, 1], [1, -2, 1])
    response = np.abs(ndimage.convolve(grey.astype(np.int64), operator, mode="constant"))
    whole = ndimage.minimum_filter(valid, 3, mode="constant").astype(np.int64)
    row = np.arange(len(whole))
    whole[(row % side) % every != every // 2] = 0
    noise = np.full([n + 4 for n in per_cell(whole, side).shape], np.nan)
    with np.errstate(invalid="ignore"):
        noise[2:-2, 2:-2] = per_cell(response * whole, side) / per_cell(whole, side)
    around = np.sort(sliding_window_view(noise, (5, 5)).reshape(*per_cell(whole, side).shape, 25), axis=-1)
    known = np.isfinite(around).sum(axis=-1)  # NaN come last
    middle = np.take_along_axis(around, (known // 2)[..., None], axis=-1)[..., 0]
    return np.where(known > 0, middle, 0.0)


def per_cell(values: NDArray[np.int64], side: int) -> NDArray[np.int64]:
    return values.reshape(len(values) // side, side, -1, side).sum(axis=(1, 3))


def plain_weights(active: Image, valid: Image, grey: Grey) -> Plane:
    """w of each pixel: 0.9 times the larger noise of pixels and of means of 4 x 4."""
    fours = grey.reshape(len(grey) // 4, 4, -1, 4).sum(axis=(1, 3), dtype=np.int64)
    whole = valid.reshape(len(valid) // 4, 4, -1, 4).min(axis=(1, 3))
    noise = np.maximum(plain_noise(8, 2, valid, grey), 4 * plain_noise(2, 1, whole, (fours + 8) // 16))
    weights = np.maximum(0.9 * (math.sqrt(math.pi / 2) / 6 * noise), 1)
    return (per_pixel(weights * active) * valid).astype(np.float32)


def moved(plane: Plane, axis: int, by: int) -> Plane:
    """The neighbour of each pixel, `by` on along an axis; 0 beyond the edge."""
    padded = np.pad(plane, [(1, 1) if k == axis else (0, 0) for k in (0, 1)])
    return padded.take(range(1 + by, 1 + by + plane.shape[axis]), axis)


def plain_primal(image: Plane, p: list[Plane]) -> Plane:
    return image + (((p[1] - moved(p[1], 1, -1)) + p[0]) - moved(p[0], 0, -1))


def plain_denoised(image: Plane, limit: Plane) -> Plane:
    """Fast gradient projection on whole planes; links to pixels whose limit is 0 are cut."""
    p = q = [np.zeros_like(image)] * 2
    t = 1.0
    for _ in range(STEPS):
        u = plain_primal(image, q)
        ahead = [np.where(moved(limit, k, 1) > 0, moved(u, k, 1) - u, np.float32(0)) for k in (0, 1)]
        step = [q[k] + np.float32(0.125) * ahead[k] for k in (0, 1)]
        norm = np.sqrt(step[1] * step[1] + step[0] * step[0])
        scale = limit / np.maximum(np.maximum(norm, limit), np.float32(1))
        t, before = (1 + math.sqrt(1 + 4 * t * t)) / 2, t
        momentum = np.float32((before - 1) / t)
        step = [part * scale for part in step]
        q = [step[k] + momentum * (step[k] - p[k]) for k in (0, 1)]
        p = step
    return plain_primal(image, p)


def matching(valid: Image, grey: Grey, low: float, high: float) -> Image:
    return ((low <= grey / 65535) & (grey / 65535 <= high)).astype(np.uint8) & valid


def refined(
    inside: Image, open_cells: Image, valid: Image, grey: Grey, low: float = LOW, high: float = HIGH
) -> Image:
    return denoised(inside, open_cells, valid, grey, matching(valid, grey, low, high), low, high)


def plain(inside: Image, open_cells: Image, valid: Image, grey: Grey, low: float, high: float) -> Image:
    near = ndimage.maximum_filter(open_cells, 3, mode="constant")
    fits = matching(valid, grey, low, high)
    inside = np.where(per_pixel(near), fits, inside)
    mixed = per_cell(fits, 8) * per_cell(valid & (1 - fits), 8) * near > 0
    active = near & ndimage.maximum_filter(mixed, 3, mode="constant")
    u = plain_denoised(grey.astype(np.float32), plain_weights(active, valid, grey)) / 65535.0
    mask = np.where(per_pixel(active) & valid, (low <= u) & (u <= high), inside).astype(np.uint8)
    return np.where(per_pixel(active) & plain_specks(mask, valid), 1 - mask, mask).astype(np.uint8)


def plain_specks(mask: Image, valid: Image) -> NDArray[np.bool_]:
    """Pieces of less than 9 pixels, 4-connected inside and 8-connected outside, by the other side."""
    found = np.zeros(mask.shape, bool)
    square = np.ones((3, 3), bool)
    for side, joins in ((1, None), (0, square)):
        pieces, count = ndimage.label((mask == side) & (valid > 0), joins)
        others = (mask != side) & (valid > 0)
        for name in range(1, count + 1):
            piece = pieces == name
            if piece.sum() < 9 and (ndimage.binary_dilation(piece, square) & others).any():
                found |= piece
    return found


@settings(deadline=None, max_examples=60)
@given(seeds, st.tuples(st.integers(1, 9), st.integers(1, 9)))
def test_the_kernels_do_what_plain_arrays_do(seed: int, cells: tuple[int, int]) -> None:
    case = random_case(seed, cells)
    expected = plain(*case, LOW, HIGH)
    assert np.array_equal(refined(*case), expected)


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_a_cut_out_with_reach_around_it_is_decided_as_the_whole(seed: int) -> None:
    assert cut_out_agrees(seed, REACH // 8)


def test_a_cut_out_with_less_around_it_may_not_be() -> None:
    assert not all(cut_out_agrees(seed, 1) for seed in range(50))


def cut_out_agrees(seed: int, margin: int) -> bool:
    """Whether 2 x 3 cells and a pixel around, cut out with cells around them, are as in the whole."""
    case = random_case(seed, (24, 26))
    row, col = 10, 11
    whole = decided(case)[8 * row - 1 : 8 * row + 17, 8 * col - 1 : 8 * col + 25]
    cells = np.s_[row - margin : row + 2 + margin, col - margin : col + 3 + margin]
    pixels = np.s_[8 * (row - margin) : 8 * (row + 2 + margin), 8 * (col - margin) : 8 * (col + 3 + margin)]
    part = tuple(image[cells if k == 1 else pixels] for k, image in enumerate(case))
    first = 8 * margin - 1
    return np.array_equal(decided(part)[first : first + 18, first : first + 26], whole)


def decided(case: tuple[Any, ...]) -> Image:
    inside, *rest = (np.ascontiguousarray(image).copy() for image in case)
    return refined(inside, *rest)


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_cells_that_are_settled_and_do_not_touch_others_stay_as_they_are(seed: int) -> None:
    inside, unsettled_cells, valid, grey = random_case(seed, (12, 13))
    found = decided((inside, unsettled_cells, valid, grey))
    far = per_pixel(ndimage.maximum_filter(unsettled_cells, 3, mode="constant")) == 0
    assert np.array_equal(found[far], inside[far])
    assert not (found & (1 - valid)).any()


@settings(deadline=None, max_examples=30)
@given(seeds, st.integers(0, 65535))
def test_an_image_of_one_grey_is_as_its_grey(seed: int, value: int) -> None:
    inside, _, valid, _ = random_case(seed, (5, 6))
    found = decided((inside, np.ones((5, 6), np.uint8), valid, valid * np.uint16(value)))
    assert np.array_equal(found, valid * np.uint8(LOW <= value / 65535 <= HIGH))


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_greys_that_all_lie_in_the_range_stay_in_it(seed: int) -> None:
    _, _, valid, grey = random_case(seed, (7, 6))
    narrow = (30000 + grey // 16) * valid
    found = decided((valid * np.uint8(0), np.ones((7, 6), np.uint8), valid, narrow))
    assert np.array_equal(found, valid)


def test_a_noisy_shore_is_straight_and_alone() -> None:
    rng = np.random.default_rng(3)
    v = np.where(np.arange(128) < 61, 0.42, 0.68) + rng.normal(0, 0.1, (128, 128))
    grey = (np.clip(v, 0, 1) * 65535).astype(np.uint16)
    ones = np.ones((128, 128), np.uint8)
    found = refined(ones * 0, np.ones((16, 16), np.uint8), ones, grey, 0.55, 1.0)
    truth = np.broadcast_to(np.arange(128) >= 61, found.shape)
    assert ((found > 0) & truth).sum() / ((found > 0) | truth).sum() > 0.98
    assert ndimage.label(found)[1] == 1


def blocks_of(v: NDArray[np.float64]) -> BlockMap:
    """A block map of these means of cells."""
    blocks = BlockMap.empty((8 * v.shape[0], 8 * v.shape[1]))
    blocks.sums[: v.shape[0], : v.shape[1]] = np.rint(v * 65535 * 64)
    blocks.counts[: v.shape[0], : v.shape[1]] = 64
    return blocks


def test_cells_far_from_the_ends_of_a_range_are_settled() -> None:
    v = np.full((8, 16), 0.3)
    v[:, 8:] = 0.7
    blocks = blocks_of(v)
    inside = np.zeros((8, 16), np.uint8)
    inside[:, 8:] = 1
    found = unsettled(blocks, inside, 0.5, 1.0)
    assert found[:, 7:9].all() and not found[:, :7].any() and not found[:, 9:].any()


def test_a_thin_road_leaves_the_cells_that_it_crosses_and_those_around_unsettled() -> None:
    v = np.full((8, 8), 0.42)
    v[:, 4] += 0.26 * 3 / 8  # three pixels of eight
    found = unsettled(blocks_of(v), np.zeros((8, 8), np.uint8), 0.55, 1.0)
    assert found[:, 3:6].all() and not found[:, :3].any() and not found[:, 6:].any()


def test_a_cell_that_is_not_as_its_leaf_is_unsettled_and_one_without_pixels_is_not() -> None:
    blocks = blocks_of(np.full((8, 8), 0.3))
    blocks.counts[:, :4] = blocks.sums[:, :4] = 0
    found = unsettled(blocks, np.ones((8, 8), np.uint8), 0.5, 1.0)
    assert found[:, 4:].all() and not found[:, :4].any()


@pytest.mark.parametrize("low, high", [(0.0, 0.5), (0.5, 1.0)])
def test_nothing_lies_beyond_the_ends_of_v(low: float, high: float) -> None:
    blocks = blocks_of(np.full((8, 8), low if low == 0 else high))
    assert not unsettled(blocks, np.ones((8, 8), np.uint8), low, high).any()
