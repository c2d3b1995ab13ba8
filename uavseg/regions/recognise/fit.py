"""Registration of outlines with incomplete evidence: likelihood over position, rotation and size.

Surface that was seen has to lie on the outline, the outline may not pass through free space, and outline in
unknown space costs nothing.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import shapely

from uavseg._jit import inlined, kernel
from uavseg.arrays import Bools, Floats

FREE, SURFACE = 0.4, 0.6  # probabilities below which a cell is free, and above which it is surface
_CORNERS, _SIDE = 96, 64  # samples of an outline; side of the image of distances to it
_ANGLES, _SCALES, _LARGEST = 36, 7, 2.5  # of the search; the largest outline, in extents of what was seen
_RANKED, _KEPT = 400, 24  # candidates, and maxima among them
_HALVINGS, _ROUNDS = 5, 20  # of the step of the pattern search; rounds for each step
_CAP = 9.0  # limit of a squared residual, in variances: robust to outliers
_MIN_SAMPLES = 8  # cells along a surface: fewer are a speck, which fits anything
_MAX_CELLS, _MAX_SAMPLES = 400, 128.0  # of a surface that are used; independent ones that they count for
_VARIATION, _WHOLE_SAMPLES = 0.07, 32.0  # of whole outlines of one name: by extent, at independent places


class Evidence(NamedTuple):
    """Cells that are surface of an object, and free space around it; y is up."""

    surface: Floats  # (n, 3): x, y from the middle of the surface, and weight: how many independent points
    free: Floats  # (rows, cols): depth in free space, 0 elsewhere
    grid: Floats  # x, y of the first cell, its side, deviation of surface from the outline, depth behind it


def evidence_of_cells(probabilities: Floats, of_object: Bools, cell: float) -> Evidence | None:
    """Return what a part of a map says of one object; None where too few cells are surface.

    `probabilities` are 0.5 where unknown, and `of_object` the cells that may be its surface. A laser marks a
    band of cells behind the surface, whose thickness says how exact it is.
    """
    from scipy import ndimage
    from skimage.morphology import skeletonize

    surface = (probabilities > SURFACE) & of_object
    length = int(skeletonize(ndimage.binary_closing(np.pad(surface, 3), np.ones((3, 3)))).sum())
    if length < _MIN_SAMPLES:
        return None
    row, col = np.nonzero(surface)
    thickness = max(len(row) / length, 1.0) * cell
    x, y = col * cell, -row * cell
    points = np.column_stack([x - x.mean(), y - y.mean(), 2 * probabilities[surface] - 1])
    points = np.ascontiguousarray(points[:: math.ceil(len(points) / _MAX_CELLS)], np.float64)
    points[:, 2] *= min(length, _MAX_SAMPLES) / points[:, 2].sum()
    free = ~solid_cells(probabilities, probabilities > SURFACE)
    grid = np.array([-x.mean(), -y.mean(), cell, max(0.6 * thickness, cell), thickness / 3])
    return Evidence(points, np.asarray(ndimage.distance_transform_edt(free) * cell, np.float64), grid)


def solid_cells(probabilities: Floats, seeds: Bools) -> Bools:
    """Return the cells that are not free and connected with some cells; specks in free space are free."""
    from scipy.ndimage import binary_propagation

    return np.asarray(binary_propagation(seeds, np.ones((3, 3)), mask=probabilities >= FREE))


def smooth_contour(cells: Bools) -> Floats | None:
    """Return the contour (n, 2) of cells as (col, row); None unless they are one piece off the border."""
    from scipy.ndimage import gaussian_filter, label
    from skimage.measure import find_contours

    contours = find_contours(gaussian_filter(cells.astype(np.float64), 1.0), 0.5)
    longest = max(contours, key=len, default=np.empty((0, 2)))
    inside = label(cells, np.ones((3, 3)))[1] == 1 and cells[1:-1, 1:-1].sum() == cells.sum()
    return longest[:, ::-1] + 0.5 if inside and len(longest) > 3 else None


class Outline(NamedTuple):
    """The exterior of a polygon without position and size: its centroid at 0, its area 1."""

    corners: Floats  # (96, 2), evenly spaced
    distances: Floats  # (64, 64), to the outline; negative inside
    shape: Floats  # half the side of that image, perimeter, extent

    @classmethod
    def of(cls, polygon: Any) -> "Outline":
        """Return the outline of a polygon, or of the largest of several."""
        ring = shapely.Polygon(max(shapely.get_parts(polygon), key=shapely.area).exterior)
        middle, size = shapely.get_coordinates(ring.centroid), math.sqrt(ring.area)
        ring = shapely.transform(ring, lambda xy: (xy - middle) / size)
        shares = (np.arange(_CORNERS) + 0.5) / _CORNERS
        corners = shapely.get_coordinates(ring.exterior.interpolate(shares, normalized=True))
        half = 1.3 * float(np.abs(corners).max())
        centres = ((np.arange(_SIDE) + 0.5) / _SIDE * 2 - 1) * half
        points = shapely.points(*np.meshgrid(centres, centres))
        shapely.prepare([ring, ring.exterior])
        distances = shapely.distance(ring.exterior, points)
        distances[shapely.contains(ring, points)] *= -1
        return cls(corners, distances, np.array([half, ring.length, _extent(corners)]))

    def as_evidence(self) -> Evidence:
        """Return the outline as evidence of an object that is known as a whole."""
        half, _, extent = self.shape
        cell, middle = 2 * half / _SIDE, self.corners.mean(axis=0)
        weights = np.full(_CORNERS, _WHOLE_SAMPLES / _CORNERS)
        grid = np.array([*((cell / 2 - half, half - cell / 2) - middle), cell, _VARIATION * extent, 0.0])
        free = np.ascontiguousarray(np.maximum(self.distances[::-1], 0.0))
        return Evidence(np.column_stack([self.corners - middle, weights]), free, grid)


def _extent(xy: Floats) -> float:
    """Return the diameter of the smallest circle around points."""
    return 2 * float(shapely.minimum_bounding_radius(shapely.multipoints(xy[:, :2])))


def log_evidence(outline: Outline, evidence: Evidence) -> tuple[float, float]:
    """Return the logarithm of the likelihood of an outline and its maximum, which is 0 for a perfect fit.

    The likelihood is the sum of its distinct local maxima over position, rotation and size, so an outline
    that fits in a single pose counts less than one that fits in many.
    """
    sigma = float(evidence.grid[3])
    seen = max(_extent(evidence.surface), 2 * sigma)
    limits = np.array([max(seen - 3 * sigma, 0.7 * seen), _LARGEST * seen]) / outline.shape[2]
    steps = 0.7 * sigma * 0.5 ** np.arange(_HALVINGS)[:, None]
    factors = np.exp(steps * (0, 0, 0, 0, 2j, -2j, 2, -2) / seen)  # around the middle of the surface
    shifts = steps * (1, -1, 1j, -1j, 0, 0, 0, 0)
    moves = np.stack([factors.real, factors.imag, shifts.real, shifts.imag], axis=-1)
    poses = _distinct(_candidates(outline, evidence, limits), outline, 2.5 * sigma)
    _climb(poses, moves, limits, *outline, *evidence)
    maxima = _distinct(poses, outline, 1.5 * sigma)[:, 4]
    return float(np.logaddexp.reduce(maxima)), float(maxima[0])


def _candidates(outline: Outline, evidence: Evidence, limits: Floats) -> Floats:
    """Return poses (n, 5) of a coarse search in which some corner lies on the middle of the surface."""
    # They are x, y, size times cosine and sine of the rotation, and log-likelihood.
    surface, wide = evidence.surface, evidence.grid * (1.0, 1.0, 1.0, 2.0, 1.0)
    anchor = surface[np.hypot(*(surface[:, :2] - np.median(surface[:, :2], axis=0)).T).argmin(), :2]
    angles = np.exp(1j * math.tau / _ANGLES * np.arange(_ANGLES))
    turns = (angles[:, None] * np.geomspace(limits[0], limits[1], _SCALES)).ravel().repeat(_CORNERS // 3)
    poses = np.zeros((len(turns), 5))
    poses[:, 2], poses[:, 3] = turns.real, turns.imag
    corners = np.tile(outline.corners[::3], (_ANGLES * _SCALES, 1))
    poses[:, :2] = anchor - _placed(poses, corners[:, None])[:, 0]
    few = surface[:: math.ceil(len(surface) / 60)]
    few = few * (1.0, 1.0, surface[:, 2].sum() / few[:, 2].sum())
    half = np.ascontiguousarray(outline.corners[::2])
    _climb(poses, np.empty((0, 0, 4)), limits, half, *outline[1:], few, evidence.free, wide)
    return poses


def _placed(poses: Floats, points: Floats) -> Floats:
    """Return points (n or 1, m, 2) of an outline where poses (n, 5) put them."""
    turned = (points[..., 0] + 1j * points[..., 1]) * (poses[:, 2] + 1j * poses[:, 3])[:, None]
    return np.asarray(poses[:, None, :2] + np.stack([turned.real, turned.imag], axis=-1))


def _distinct(poses: Floats, outline: Outline, apart: float) -> Floats:
    """Return the best poses, best first, that differ from better ones by more than a distance somewhere."""
    poses = poses[np.argsort(-poses[:, 4], kind="stable")[:_RANKED]]
    placed = _placed(poses, outline.corners[None, ::12])
    chosen: list[int] = []
    left = np.arange(len(poses))
    while len(left) and len(chosen) < _KEPT:
        chosen.append(int(left[0]))
        left = left[np.abs(placed[left] - placed[left[0]]).max(axis=(1, 2)) > apart]
    return poses[chosen]


@inlined
def _capped(image, row, col, behind, size, sigma):  # type: ignore[no-untyped-def]
    """Interpolate an image of distances, and return the capped square; the cap outside of the image."""
    if not (0.0 <= row < image.shape[0] - 1 and 0.0 <= col < image.shape[1] - 1):
        return _CAP
    i, j = int(row), int(col)
    down, right = row - i, col - j
    above = image[i, j] * (1.0 - right) + image[i, j + 1] * right
    below = image[i + 1, j] * (1.0 - right) + image[i + 1, j + 1] * right
    d = ((above * (1.0 - down) + below * down) * size + behind) / sigma
    return d * d * _CAP / (d * d + _CAP)


@inlined
def _log_likelihood(x, y, a, b, corners, distances, shape, surface, free, grid):  # type: ignore[no-untyped-def]
    """Sum capped squares: of seen surface from the outline, and of outline in free space."""
    square = a * a + b * b
    size = math.sqrt(square)
    scale = distances.shape[0] / (2.0 * shape[0])
    squares = outside = 0.0
    for k in range(surface.shape[0]):
        dx, dy = (surface[k, 0] - x) / square, (surface[k, 1] - y) / square
        col, row = (a * dx + b * dy + shape[0]) * scale - 0.5, (a * dy - b * dx + shape[0]) * scale - 0.5
        squares += surface[k, 2] * _capped(distances, row, col, grid[4], size, grid[3])
    for k in range(corners.shape[0]):
        col = (x + a * corners[k, 0] - b * corners[k, 1] - grid[0]) / grid[2]
        row = (grid[1] - y - b * corners[k, 0] - a * corners[k, 1]) / grid[2]
        if 0.0 <= row < free.shape[0] - 1 and 0.0 <= col < free.shape[1] - 1:
            outside += _capped(free, row, col, 0.0, 1.0, grid[3])
    spacing = shape[1] * size / (corners.shape[0] * grid[2])
    return -0.5 * (squares + spacing * outside)


@kernel("void(f8[:,::1], f8[:,:,::1], f8[::1], f8[:,::1], f8[:,::1], f8[::1], f8[:,::1], f8[:,::1], f8[::1])")
def _climb(poses, moves, limits, corners, distances, shape, surface, free, grid):  # type: ignore[no-untyped-def]
    """Score each pose and move it to a local maximum by pattern search (Hooke and Jeeves 1961)."""
    for n in range(poses.shape[0]):
        x, y, a, b = poses[n, 0], poses[n, 1], poses[n, 2], poses[n, 3]
        best = _log_likelihood(x, y, a, b, corners, distances, shape, surface, free, grid)
        for level in range(moves.shape[0]):
            rounds, moved = 0, True
            while moved and rounds < _ROUNDS:
                rounds, moved = rounds + 1, False
                for k in range(moves.shape[1]):
                    c, s = moves[level, k, 0], moves[level, k, 1]
                    u, v = c * x - s * y + moves[level, k, 2], s * x + c * y + moves[level, k, 3]
                    p, q = c * a - s * b, s * a + c * b
                    if limits[0] <= math.sqrt(p * p + q * q) <= limits[1]:
                        score = _log_likelihood(u, v, p, q, corners, distances, shape, surface, free, grid)
                        if score > best + 1e-9:
                            best, moved, x, y, a, b = score, True, u, v, p, q
        poses[n, 0], poses[n, 1], poses[n, 2], poses[n, 3], poses[n, 4] = x, y, a, b, best
