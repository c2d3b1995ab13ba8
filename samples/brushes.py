"""Drawing primitives of the sample rasters: noise, distances to lines, domes, hillshade and shadows.

Only additions, multiplications, divisions and square roots are used, and a random bit stream that numpy
guarantees to keep. The pixels are therefore identical on every machine and with every version of numpy.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Shape = tuple[int, ...]
Line = Sequence[tuple[float, float]]  # (row, col) of its vertices


class RandomStream:
    """Random numbers that are identical with every version of numpy."""

    def __init__(self, seed: int) -> None:
        self._bits = np.random.PCG64(seed)

    def uniform(self, *shape: int) -> Array:
        """Uniformly distributed numbers from [0, 1)."""
        raw = self._bits.random_raw(int(np.prod(shape)))
        return (raw >> np.uint64(11)).astype(np.float64).reshape(shape) * 2.0**-53


def grid(shape: Shape) -> tuple[Array, Array]:
    """Row and column of every pixel."""
    rows, cols = np.indices(shape, dtype=np.float64)
    return rows, cols


def blur(image: Array, radius: int, passes: int = 3) -> Array:
    """Repeated box filter, approximately a Gaussian."""
    side = 2 * radius + 1
    for axis in (0, 1) * passes:
        image = np.moveaxis(image, axis, 0)
        sums = np.cumsum(np.pad(image, [(radius + 1, radius), (0, 0)], mode="reflect"), axis=0)
        image = np.moveaxis((sums[side:] - sums[:-side]) / side, 0, axis)
    return image


def soften(image: Array) -> Array:
    """Blur of a lens: the mean of each pixel and its 3 x 3 box mean."""
    return (image + blur(image, 1, passes=1)) / 2


def noise(rng: RandomStream, shape: Shape, scale: int) -> Array:
    """Smooth noise with blobs of about `scale` pixels, mean 0, two thirds of the values within -1..1."""
    white = rng.uniform(*shape) + rng.uniform(*shape) - 1
    return _normalised(blur(white, scale) if scale else white)


def waves(rng: RandomStream, shape: Shape) -> Array:
    """Short waves with oblique crests."""
    crests = rng.uniform(*shape) - 0.5
    for shift in range(1, 5):
        crests = (crests + np.roll(crests, (shift, 3 * shift), axis=(0, 1))) / 2
    return _normalised(blur(crests, 1))


def _normalised(image: Array) -> Array:
    return image / (1.4826 * float(np.median(np.abs(image))))


def smooth(ramp: Array) -> Array:
    """Smoothstep: maps 0..1 to 0..1 with zero slope at both ends."""
    return ramp * ramp * (3 - 2 * ramp)


def wave(phase: Array) -> Array:
    """Smooth periodic wave 0..1..0 with a period of 1 in `phase`."""
    return smooth(1 - np.abs(2 * (phase - np.floor(phase)) - 1))


def terraces(depth: Array) -> Array:
    """Replace an even slope by steps with steep faces."""
    step = np.floor(depth)
    return step + smooth(np.clip((depth - step) * 4, 0, 1))


def mix(first: Sequence[float], second: Sequence[float], share: Array) -> Array:
    """Linear interpolation between two colours, a (3, rows, cols) array."""
    a, b = (np.array(colour, dtype=np.float64)[:, None, None] for colour in (first, second))
    mixed: Array = a + (b - a) * share
    return mixed


def distance(shape: Shape, line: Line) -> Array:
    """Distance in pixels from a polyline or a point."""
    pairs = list(pairwise(line)) or [(line[0], line[0])]
    return union_distance(*(_segment_distance(shape, a, b) for a, b in pairs))


def _segment_distance(shape: Shape, a: tuple[float, float], b: tuple[float, float]) -> Array:
    rows, cols = grid(shape)
    down, right = b[0] - a[0], b[1] - a[1]
    share = ((rows - a[0]) * down + (cols - a[1]) * right) / max(down * down + right * right, 1e-9)
    share = np.clip(share, 0, 1)
    away_rows, away_cols = rows - a[0] - share * down, cols - a[1] - share * right
    return np.sqrt(away_rows * away_rows + away_cols * away_cols)


def union_distance(*distances: Array) -> Array:
    """Minimum of several distances: the distance to the union of their shapes."""
    least: Array = np.minimum.reduce(distances)
    return least


def chaikin(*line: tuple[float, float]) -> Line:
    """The polyline after three iterations of Chaikin's corner cutting."""
    for _ in range(3):
        cut = [(0.75 * a + 0.25 * b, 0.25 * a + 0.75 * b) for a, b in pairwise(np.array(line))]
        line = (line[0], *(tuple(point) for pair in cut for point in pair), line[-1])
    return line


def domes(rng: RandomStream, shape: Shape, count: int, radii: tuple[float, float], where: Mask) -> Array:
    """Heights of up to `count` random domes (trees, heaps) with their centres in `where`; 0 between them."""
    height = np.zeros(shape)
    for row, col, size, lift in zip(*rng.uniform(4, count), strict=True):
        row, col = row * shape[0], col * shape[1]
        if where[int(row), int(col)]:
            _raise_dome(height, row, col, radii[0] + (radii[1] - radii[0]) * size, 4 * lift)
    return height


def _raise_dome(height: Array, row: float, col: float, radius: float, lift: float) -> None:
    top, start = max(int(row - radius), 0), max(int(col - radius), 0)
    spot = height[top : int(row + radius) + 2, start : int(col + radius) + 2]
    rows, cols = grid(spot.shape)
    down, right = rows + top - row, cols + start - col
    inside = 1 - (down * down + right * right) / (radius * radius)
    dome = np.where(inside > 0, radius * np.sqrt(np.maximum(inside, 0)) + lift, 0)
    np.maximum(spot, dome, out=spot)


def hillshade(height: Array, steep: float) -> Array:
    """Hillshade with light from the upper left, 0..1; flat terrain has 0.5."""
    down, right = np.gradient(height)
    slope = steep * (down + right)
    light: Array = 0.5 + 0.5 * slope / np.sqrt(1 + slope * slope)
    return light


def shadow(height: Array, reach: int, fall: float) -> Mask:
    """Mask of the pixels shaded by terrain up to `reach` pixels to the upper left."""
    dark = np.zeros(height.shape, dtype=bool)
    for step in range(1, reach):
        dark[step:, step:] |= height[:-step, :-step] > height[step:, step:] + fall * step + 0.5
    return dark


def farmland(rng: RandomStream, shape: Shape, side: int) -> tuple[Array, Array]:
    """Brightness of oblique parcels, and the crop rows in them."""
    rows, cols = grid(shape)
    along, across = (cols + 0.2 * rows) / side, (rows - 0.2 * cols + 200) / (0.7 * side)
    tone = rng.uniform(32, 32)[across.astype(int) % 32, along.astype(int) % 32]
    edge = (wave(along + 0.5) > 0.985) | (wave(across + 0.5) > 0.985)
    return 0.2 * (tone - 0.35) - 0.05 * edge, np.where(tone > 0.5, wave(along * 12), wave(across * 9))


def photo_footprints(
    rng: RandomStream, shape: Shape, half: tuple[float, float], step: tuple[int, int]
) -> Mask:
    """Mask of the union of rotated drone photographs of half-size `half`, about `step` pixels apart."""
    rows, cols = grid(shape)
    covered = np.zeros(shape, dtype=bool)
    for row in range(int(half[0]) + 30, int(shape[0] - half[0] - 20), step[0]):
        for col in range(int(half[1]) + 30, int(shape[1] - half[1] - 20), step[1]):
            lean, down, right = (rng.uniform(3) - 0.5) * (0.2, 26, 26)
            away_rows, away_cols = rows - row - down, cols - col - right
            along, across = away_cols - (lean + 0.12) * away_rows, away_rows + (lean + 0.12) * away_cols
            covered |= (np.abs(across) < half[0]) & (np.abs(along) < half[1])
    return covered
