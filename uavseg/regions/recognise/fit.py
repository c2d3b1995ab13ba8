"""Registration of an outline with incomplete evidence: its likelihood, integrated over similarity transforms.

Surface that was seen has to lie on the outline, the outline may not pass through free space, and outline in
unknown space costs nothing. The integral over position, rotation and size is the sum over local maxima of
Laplace's approximation (D. J. C. MacKay, "Information Theory, Inference, and Learning Algorithms", 2003,
chapter 27), so an outline that fits only in one exact pose counts less than one that fits in many.
"""

from __future__ import annotations

import math
from dataclasses import field
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.dataclass import dataclass

Floats = NDArray[np.float64]

_CORNERS, _SIDE = 96, 128  # samples of an outline; side of the image of distances to it
_ANGLES, _SCALES, _LARGEST = 48, 8, 2.5  # of the search; the largest outline, by the extent of what was seen
_KEPT, _RANKED = 24, 400  # maxima that are refined, of so many candidates
_ROUNDS = 60
_CAP = 9.0  # limit of one squared residual, in squares of sigma: robust to outliers
_FREE_WEIGHT = 0.5  # of outline in free space, against surface beside the outline
_PATCH = 64  # cells across the evidence, at most about twice as many
MAX_SAMPLES = 128.0  # independent points of a surface; neighbours share errors that the noise does not explain


@dataclass(frozen=True, eq=False)
class Evidence:
    """What is known of an object: surface that was seen, and space that is free.

    Parameters
    ----------
    surface : (n, 3) float64 array
        x, y from the middle of what was seen, and the weight of each cell of it.
    free : (rows, cols) float64 array
        How deep each cell lies in free space, 0 elsewhere.
    grid : (5,) float64 array
        x and y of the centre of the first cell, side of a cell, standard deviation of a surface cell, and
        how far behind the surface they lie on average. Rows go down, against y.
    """

    surface: Floats
    free: Floats
    grid: Floats

    @property
    def samples(self) -> float:
        """Return the number of independent points of the surface."""
        return float(self.surface[:, 2].sum())


def evidence_of_cells(probabilities: Floats, of_object: NDArray[np.bool_], cell: float) -> Evidence | None:
    """Return what the cells of a map say of one object; None where none of its cells is occupied.

    A laser marks a band of cells, whose thickness says how exact it is, from the surface on.

    Parameters
    ----------
    probabilities : (rows, cols) float array
        A part of the map; 0.5 is unknown.
    of_object : (rows, cols) bool array
        Cells that may be surface of this object rather than of another.
    cell : float
        Side of a cell.
    """
    from scipy import ndimage
    from skimage.morphology import skeletonize

    step = max(round(math.sqrt(of_object.sum()) / (2 * _PATCH)), 1)
    if step > 1:  # of a large object: means of squares of cells
        rows, cols = (length // step * step for length in probabilities.shape)
        squares = (rows // step, step, cols // step, step)
        of_object = of_object[:rows, :cols].reshape(squares).any(axis=(1, 3))
        probabilities = probabilities[:rows, :cols].reshape(squares).mean(axis=(1, 3))
        cell *= step
    surface = (probabilities > 0.6) & of_object
    if not surface.any():
        return None
    known, _ = ndimage.label(probabilities >= 0.4, np.ones((3, 3)))  # specks in free space are free
    free = ~np.isin(known, np.setdiff1d(known[probabilities > 0.6], [0]))
    row, col = np.nonzero(surface)
    length = float(skeletonize(ndimage.binary_closing(np.pad(surface, 3), np.ones((3, 3)))).sum()) or 1.0
    thickness = max(len(row) / length, 1.0) * cell
    weights = 2.0 * probabilities[surface] - 1.0
    weights *= min(length, MAX_SAMPLES) / weights.sum()
    x, y = col * cell, -row * cell
    middle = x.mean(), y.mean()
    return Evidence(
        surface=np.column_stack([x - middle[0], y - middle[1], weights]).astype(np.float64),
        free=np.ascontiguousarray(ndimage.distance_transform_edt(free) * cell, np.float64),
        grid=np.array([-middle[0], -middle[1], cell, max(0.6 * thickness, cell), thickness / 3]),
    )


def evidence_of_polygon(polygon: Any) -> Evidence:
    """Return a region whose whole outline is known, in units of its coordinates, as evidence."""
    x_min, y_min, x_max, y_max = polygon.bounds
    cell = max(x_max - x_min, y_max - y_min) / _PATCH
    rows, cols = (int((high - low) / cell) + 24 for low, high in ((y_min, y_max), (x_min, x_max)))
    x, y = np.meshgrid(x_min + (np.arange(cols) - 11.5) * cell, y_max - (np.arange(rows) - 11.5) * cell)
    outline = polygon.exterior
    shapely.prepare(polygon)
    probabilities = np.where(shapely.contains_xy(polygon, x, y), 0.5, 0.0)
    probabilities[shapely.distance(shapely.points(x, y), outline) <= 0.5 * cell] = 1.0
    found = evidence_of_cells(probabilities, np.ones(x.shape, bool), cell)
    assert found is not None, "an outline crosses cells"
    found.grid[3:] = 1.5 * cell, 0.0
    return found


@dataclass(frozen=True, eq=False)
class Outline:
    """A polygon's exterior without position and size: its centroid at 0, its area 1.

    Parameters
    ----------
    polygon : shapely Polygon
    smoothing : float
        Standard deviation by which the outline is smoothed, in units of the polygon: of an example that is
        as jagged as the cells of a map.
    """

    polygon: Any
    smoothing: float = 0.0
    corners: Floats = field(init=False, repr=False)  # (96, 2), evenly spaced
    distances: Floats = field(init=False, repr=False)  # (128, 128), to the outline; negative inside
    shape: Floats = field(init=False, repr=False)  # half the side of that image, perimeter, diameter

    def __post_init__(self) -> None:
        ring = shapely.Polygon(self.polygon.exterior)
        if self.smoothing > 0:
            from scipy.ndimage import gaussian_filter1d

            spacing = ring.length / 512
            xy = shapely.get_coordinates(ring.exterior.interpolate(np.arange(512) * spacing))
            ring = shapely.Polygon(gaussian_filter1d(xy, self.smoothing / spacing, axis=0, mode="wrap"))
        middle, size = np.ravel(shapely.get_coordinates(ring.centroid)), math.sqrt(ring.area)
        ring = shapely.transform(ring, lambda xy: (xy - middle) / size)
        line = ring.exterior
        corners = shapely.get_coordinates(
            line.interpolate((np.arange(_CORNERS) + 0.5) / _CORNERS, normalized=True)
        )
        half = 1.3 * float(np.abs(corners).max())
        centres = ((np.arange(_SIDE) + 0.5) / _SIDE * 2 - 1) * half
        x, y = np.meshgrid(centres, centres)
        shapely.prepare([line, ring])
        inside = np.where(shapely.contains_xy(ring, x, y), -1.0, 1.0)
        distances = shapely.distance(shapely.points(x, y), line) * inside
        object.__setattr__(self, "corners", np.ascontiguousarray(corners))
        object.__setattr__(self, "distances", np.ascontiguousarray(distances))
        object.__setattr__(self, "shape", np.array([half, line.length, _extent(corners)]))


def _extent(xy: Floats) -> float:
    """Return the largest extent of points in any direction, by 32 directions."""
    turn = np.arange(32) * math.pi / 32
    return float(np.ptp(xy[:, :2] @ np.stack([np.cos(turn), np.sin(turn)]), axis=0).max())


def log_evidence(outline: Outline, evidence: Evidence) -> tuple[float, float]:
    """Integrate the likelihood of an outline over position, rotation and size.

    Returns
    -------
    total : float
        Logarithm of the integral, up to a constant that all outlines share.
    best : float
        Logarithm of the largest likelihood; 0 for surface exactly on the outline.
    """
    sigma = float(evidence.grid[3])
    seen = max(_extent(evidence.surface), 2 * sigma)
    smallest = max(seen - 3 * sigma, 0.7 * seen) / outline.shape[2]
    limits = np.log([smallest, _LARGEST * seen / outline.shape[2]])
    steps = np.array([1.0, 1.0, 2 / seen, 2 / seen]) * 0.7 * sigma
    poses = _distinct(_candidates(outline, evidence, limits), outline, 2.5 * sigma)
    fields = outline.corners, outline.distances, outline.shape, evidence.surface, evidence.free, evidence.grid
    _climb(poses, steps, limits, _ROUNDS, *fields)
    poses = _distinct(poses[np.argsort(-poses[:, 4], kind="stable")], outline, 1.5 * sigma)
    modes = poses[:, 4] - _half_log_curvature(poses, steps * 0.7, fields)
    top = modes.max()
    return float(top + np.log(np.exp(modes - top).sum())), float(poses[0, 4])


def _candidates(outline: Outline, evidence: Evidence, limits: Floats) -> Floats:
    """Return the best poses of a coarse search, best first: some point of the outline lies on the surface.

    (n, 5): x, y, rotation in radians, logarithm of the size, score.
    """
    surface, sigma = evidence.surface, evidence.grid[3]
    from_middle = np.hypot(*(surface[:, :2] - np.median(surface[:, :2], axis=0)).T)
    anchor = surface[int(np.argmin(from_middle)), :2]
    angles = np.arange(_ANGLES) * math.tau / _ANGLES
    angle, size, point = np.meshgrid(
        angles, np.linspace(*limits, _SCALES), np.arange(0, _CORNERS, 2), indexing="ij"
    )
    poses = np.zeros((angle.size, 5))
    poses[:, 2], poses[:, 3] = angle.ravel(), size.ravel()
    poses[:, :2] = anchor - _placed(poses, outline.corners[point.ravel(), None])[:, 0]
    few = np.ascontiguousarray(surface[:: max(len(surface) // 60, 1)])
    few[:, 2] *= surface[:, 2].sum() / few[:, 2].sum()
    wide = evidence.grid.copy()
    wide[3] = 2 * sigma
    half = np.ascontiguousarray(outline.corners[::2])
    _evaluate(poses, half, outline.distances, outline.shape, few, evidence.free, wide)
    return poses[np.argsort(-poses[:, 4], kind="stable")[:_RANKED]]


def _placed(poses: Floats, points: Floats) -> Floats:
    """Return points (n or 1, m, 2) of an outline where poses (n, 5) put them."""
    turn = poses[:, 2, None]
    x, y = points[..., 0], points[..., 1]
    rotated = np.stack([np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y], axis=-1)
    return poses[:, None, :2] + np.exp(poses[:, 3])[:, None, None] * rotated


def _distinct(poses: Floats, outline: Outline, apart: float) -> Floats:
    """Return poses, best first, that differ from better ones by more than a distance somewhere."""
    placed = _placed(poses, outline.corners[None, ::12])
    chosen, left = [], np.arange(len(poses))
    while len(left) and len(chosen) < _KEPT:
        first, left = left[0], left[1:]
        chosen.append(first)
        left = left[np.abs(placed[left] - placed[first]).max(axis=(1, 2)) > apart]
    return poses[chosen].copy()


def _half_log_curvature(poses: Floats, steps: Floats, fields: tuple[Floats, ...]) -> Floats:
    """Return half the logarithm of the determinant of the Hessian at each maximum, in units of steps."""
    pairs = [(i, j, a, b) for i in range(4) for j in range(i + 1) for a in (1, -1) for b in (1, -1)]
    moves = np.array([a * np.eye(4)[i] + b * np.eye(4)[j] for i, j, a, b in pairs]) * steps
    probes = np.repeat(poses, len(moves), axis=0)
    moves = np.tile(moves, (len(poses), 1))
    grown = np.exp(moves[:, 3])
    c, s = np.cos(moves[:, 2]), np.sin(moves[:, 2])
    x, y = probes[:, 0].copy(), probes[:, 1].copy()
    probes[:, 0], probes[:, 1] = grown * (c * x - s * y), grown * (s * x + c * y)
    probes[:, :4] += moves
    _evaluate(probes, *fields)
    signs = np.array([a * b for _, _, a, b in pairs])
    second = -(probes[:, 4].reshape(len(poses), 10, 4) * signs.reshape(10, 4)).sum(axis=2) / 4
    hessian = np.zeros((len(poses), 4, 4))
    for k, (i, j) in enumerate((i, j) for i in range(4) for j in range(i + 1)):
        hessian[:, i, j] = hessian[:, j, i] = second[:, k]
    curvature = np.maximum(np.linalg.eigvalsh(hessian), 0.0) + 0.1  # no flatter than the spacing of maxima
    half: Floats = 0.5 * np.log(curvature).sum(axis=1)
    return half


@inlined
def _bilinear(image, row, col):  # type: ignore[no-untyped-def]
    """Interpolate an image at a place inside it."""
    i, j = int(row), int(col)
    down, right = row - i, col - j
    above = image[i, j] * (1.0 - right) + image[i, j + 1] * right
    below = image[i + 1, j] * (1.0 - right) + image[i + 1, j + 1] * right
    return above * (1.0 - down) + below * down


@inlined
def _log_likelihood(x, y, turn, log_size, corners, distances, shape, surface, free, grid):  # type: ignore[no-untyped-def]
    """Sum capped squared residuals: of seen surface from the outline, and of outline in free space."""
    size = math.exp(log_size)
    c, s = math.cos(turn), math.sin(turn)
    side = distances.shape[0]
    scale = side / (2.0 * shape[0])
    squares = 0.0
    for k in range(surface.shape[0]):
        dx, dy = (surface[k, 0] - x) / size, (surface[k, 1] - y) / size
        col = (c * dx + s * dy + shape[0]) * scale - 0.5
        row = (c * dy - s * dx + shape[0]) * scale - 0.5
        q = 1e9
        if col >= 0.0 and row >= 0.0 and col < side - 1 and row < side - 1:
            d = (_bilinear(distances, row, col) * size + grid[4]) / grid[3]
            q = d * d
        squares += surface[k, 2] * q * _CAP / (q + _CAP)
    outside = 0.0
    for k in range(corners.shape[0]):
        col = (x + size * (c * corners[k, 0] - s * corners[k, 1]) - grid[0]) / grid[2]
        row = (grid[1] - y - size * (s * corners[k, 0] + c * corners[k, 1])) / grid[2]
        if col >= 0.0 and row >= 0.0 and col < free.shape[1] - 1 and row < free.shape[0] - 1:
            d = _bilinear(free, row, col) / grid[3]
            q = d * d
            outside += q * _CAP / (q + _CAP)
    spacing = shape[1] * size / (corners.shape[0] * grid[2])
    return -0.5 * (squares + _FREE_WEIGHT * spacing * outside)


@kernel("void(f8[:,::1], f8[:,::1], f8[:,::1], f8[::1], f8[:,::1], f8[:,::1], f8[::1])")
def _evaluate(poses, corners, distances, shape, surface, free, grid):  # type: ignore[no-untyped-def]
    for n in range(poses.shape[0]):
        poses[n, 4] = _log_likelihood(
            *(poses[n, 0], poses[n, 1], poses[n, 2], poses[n, 3]),
            *(corners, distances, shape, surface, free, grid),
        )


@kernel(
    "void(f8[:,::1], f8[::1], f8[::1], i8, f8[:,::1], f8[:,::1], f8[::1], f8[:,::1], f8[:,::1], f8[::1])"
)
def _climb(poses, steps, limits, rounds, corners, distances, shape, surface, free, grid):  # type: ignore[no-untyped-def]
    """Move each pose to a local maximum: steps in turn, halved where none helps (Hooke and Jeeves 1961)."""
    for n in range(poses.shape[0]):
        best = _log_likelihood(
            *(poses[n, 0], poses[n, 1], poses[n, 2], poses[n, 3]),
            *(corners, distances, shape, surface, free, grid),
        )
        share = 1.0
        for _ in range(rounds):
            moved = False
            for k in range(8):
                h = share * steps[k // 2] * (1.0 if k % 2 else -1.0)
                x, y, turn, size = poses[n, 0], poses[n, 1], poses[n, 2], poses[n, 3]
                if k < 2:
                    x += h
                elif k < 4:
                    y += h
                elif k < 6:  # around the middle of the surface, as is growing
                    x, y = math.cos(h) * x - math.sin(h) * y, math.sin(h) * x + math.cos(h) * y
                    turn += h
                else:
                    x, y, size = math.exp(h) * x, math.exp(h) * y, size + h
                if size < limits[0] or size > limits[1]:
                    continue
                score = _log_likelihood(x, y, turn, size, corners, distances, shape, surface, free, grid)
                if score > best + 1e-9:
                    best, moved = score, True
                    poses[n, 0], poses[n, 1], poses[n, 2], poses[n, 3] = x, y, turn, size
            if not moved:
                share *= 0.5
                if share < 0.06:
                    break
        poses[n, 4] = best
