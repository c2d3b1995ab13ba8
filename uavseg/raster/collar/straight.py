"""Straight lines among points: how much of an outline a few long lines explain (a Hough transform)."""

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.grid.pixel_mask import ALL, PixelMask
from uavseg.raster.grid.tiling import Window
from uavseg.units import BLOCK

MAX_POINTS = 20_000
_ANGLES = np.deg2rad(np.arange(0, 180, 0.5))


def straight_share(points: NDArray[np.float64], tolerance: float, length: float, max_lines: int = 8) -> float:
    """Share of the points that lie on a few straight lines.

    Parameters
    ----------
    points : (n, 2) array
        Rows and columns.
    tolerance : float
        Largest distance from a line, in pixels.
    length : float
        The points of a line extend at least so far.
    max_lines : int

    Examples
    --------
    >>> across = np.column_stack([np.arange(100), np.full(100, 7)]).astype(float)
    >>> straight_share(across, 1, 50), straight_share(across, 1, 200)
    (1.0, 0.0)
    """
    left = points
    for _ in range(max_lines):
        if len(left) < 2:
            break
        on_line, extent = _best_line(left, tolerance)
        if extent < length:
            break
        left = left[~on_line]
    return 1 - len(left) / max(len(points), 1)


def outline_points(mask: PixelMask, shape: tuple[int, int]) -> NDArray[np.float64]:
    """Pixels of a set with a neighbour beside them that is not in it, evenly thinned to 20 000.

    Returns
    -------
    points : (n, 2) float array
        Rows and columns, in raster order of blocks.
    """
    rows, cols = np.nonzero(_blocks_at_outline(mask))
    found = [np.zeros((0, 2), np.int64)]
    for row, col in zip(rows.tolist(), cols.tolist(), strict=True):
        block = Window(row * BLOCK, col * BLOCK, BLOCK, BLOCK).clipped(shape)
        around = block.grown(1).clipped(shape)
        inside = mask.read(around)
        wide = np.pad(inside, 1, mode="edge")
        inner = wide[:-2, 1:-1] & wide[2:, 1:-1] & wide[1:-1, :-2] & wide[1:-1, 2:]
        own = Window(block.row - around.row, block.col - around.col, block.rows, block.cols).slices
        found.append(np.argwhere((inside & ~inner)[own]) + np.array([block.row, block.col]))
    points = np.concatenate(found)
    step = -(-len(points) // MAX_POINTS) if len(points) else 1
    return points[::step].astype(np.float64)


def _blocks_at_outline(mask: PixelMask) -> NDArray[np.bool_]:
    """Blocks that may hold pixels at the outline: mixed ones, and whole ones beside others."""
    whole = np.pad(mask.codes == ALL, 1, mode="edge")
    inner = whole[:-2, 1:-1] & whole[2:, 1:-1] & whole[1:-1, :-2] & whole[1:-1, 2:]
    result: NDArray[np.bool_] = (mask.codes != 0) & ~inner
    return result


def _best_line(points: NDArray[np.float64], tolerance: float) -> tuple[NDArray[np.bool_], float]:
    """The points on the line with most of them, and how far these extend."""
    center = points.mean(axis=0)
    row, col = (points - center).T
    best, normal, offset = -1, 0.0, 0.0
    for angle in _ANGLES.tolist():
        rho = np.floor((row * np.cos(angle) + col * np.sin(angle)) / tolerance).astype(np.int64)
        least = int(rho.min())
        counts = np.bincount(rho - least)
        peak = int(counts.argmax())
        if counts[peak] > best:
            best, normal, offset = int(counts[peak]), angle, (peak + least + 0.5) * tolerance
    near = np.abs(row * np.cos(normal) + col * np.sin(normal) - offset) <= tolerance
    on_line = _fitted(points, near, tolerance)
    along = points[on_line] @ _direction(points[on_line])
    return on_line, float(along.max() - along.min()) if len(along) else 0.0


def _fitted(points: NDArray[np.float64], near: NDArray[np.bool_], tolerance: float) -> NDArray[np.bool_]:
    """Points near the line of total least squares through some of them."""
    for _ in range(2):
        middle = points[near].mean(axis=0)
        along = _direction(points[near])
        across = (points - middle) @ np.array([-along[1], along[0]])
        near = np.abs(across) <= tolerance
        if not near.any():
            break
    return near


def _direction(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vector of the largest variance."""
    away = points - points.mean(axis=0)
    vector: NDArray[np.float64] = np.linalg.eigh(away.T @ away)[1][:, -1]
    return vector
