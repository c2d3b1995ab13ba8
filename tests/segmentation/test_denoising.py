"""Total variation as it is told, pixel by pixel in plain arrays; and what it leaves alone."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import ndimage

from uavseg.segmentation.blockmap import BlockMap
from uavseg.segmentation.denoising import STEPS, denoised, unsettled
from uavseg.segmentation.refinement import REACH

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


def plain_weights(active: Image, valid: Image, grey: Grey) -> Plane:
    """w of each pixel: twice the noise of the 5 x 5 cells around, by Immerkaer's operator."""
    operator = np.outer([1, -2, 1], [1, -2, 1])
    response = np.abs(ndimage.convolve(grey.astype(np.int64), operator, mode="constant"))
    whole = ndimage.minimum_filter(valid, 3, mode="constant").astype(np.int64)

    def around(values: NDArray[np.int64]) -> NDArray[np.int64]:
        cells = values.reshape(active.shape[0], 8, active.shape[1], 8).sum(axis=(1, 3))
        return ndimage.convolve(cells, np.ones((5, 5), int), mode="constant")

    noise = math.sqrt(math.pi / 2) / 6 * around(response * whole) / np.maximum(around(whole), 1)
    return (per_pixel(np.maximum(2 * noise, 1) * active) * valid).astype(np.float32)


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


def plain(inside: Image, open_cells: Image, valid: Image, grey: Grey, low: float, high: float) -> Image:
    active = ndimage.maximum_filter(open_cells, 3, mode="constant")
    u = plain_denoised(grey.astype(np.float32), plain_weights(active, valid, grey)) / 65535.0
    return np.where(per_pixel(active) & valid, (low <= u) & (u <= high), inside).astype(np.uint8)


@settings(deadline=None, max_examples=60)
@given(seeds, st.tuples(st.integers(1, 9), st.integers(1, 9)))
def test_the_kernels_do_what_plain_arrays_do(seed: int, cells: tuple[int, int]) -> None:
    case = random_case(seed, cells)
    expected = plain(*case, LOW, HIGH)
    assert np.array_equal(denoised(*case, LOW, HIGH), expected)
