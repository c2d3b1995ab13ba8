"""Smooth outlines: surface nets and sleeve fitting, with shared borders, pixels and areas preserved."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import ParameterError
from uavseg.raster.grid.geobox import GeoBox, scaled
from uavseg.raster.grid.ground import ground_resolution
from uavseg.regions.outline.rings import Rings, reorder_rings
from uavseg.regions.smooth.nodes import Nodes, find_nodes
from uavseg.regions.smooth.sleeve import STEPS_PER_PIXEL
from uavseg.regions.smooth.smooth_rings import SmoothRings, smooth_rings

Integers = NDArray[np.int64]

AREA_TOLERANCE = 0.01  # largest relative change of a region's area
_MAX_SIDE = np.iinfo(np.int32).max // STEPS_PER_PIXEL - 1


def smooth_outlines(rings: Rings, metres: float, geobox: GeoBox) -> tuple[Rings, GeoBox]:
    """Smooth the outlines of regions; none vanishes, overlaps another or becomes invalid.

    An outline still runs between the same pixel centres, so burning it into the raster's grid gives the same
    labels, and stays within half a pixel of the pixel edges (constrained elastic surface nets, see
    `surface_nets`). A border between two regions stays one line. Nodes, and corners on the raster's border,
    are fixed. Where the area of a region would change by more than a hundredth, its outline stays on the
    pixel edges, and so do its neighbours' borders with it.

    Parameters
    ----------
    rings : Rings
        Along the pixel edges of `geobox`.
    metres : float
        Largest distance of outlines from the pixel edges. More than half a pixel counts as half a pixel; with
        less, stairs are flattened, not removed. Units of the transform where there is no CRS.
    geobox : GeoBox

    Returns
    -------
    rings : Rings
        In corners of the finer grid; a ring may begin at any of its vertices.
    geobox : GeoBox
        The finer grid, with STEPS_PER_PIXEL times as many rows and columns.

    Raises
    ------
    ParameterError
        If `metres` is negative or not finite, or the raster has more than eight million rows or columns.

    Examples
    --------
    >>> from affine import Affine
    >>> from uavseg.regions.outline.trace import trace
    >>> box = GeoBox((3, 3), Affine(2.0, 0.0, 0.0, 0.0, -2.0, 0.0), None)
    >>> pixel = trace(np.array([[0, 0, 0], [0, 1, 0], [0, 0, 0]], np.uint32))
    >>> smooth, fine = smooth_outlines(pixel, 1.0, box)
    >>> (smooth.vertices / STEPS_PER_PIXEL).round(1).tolist()
    [[0.8, 1.5], [1.5, 2.2], [2.2, 1.5], [1.5, 0.8]]
    """
    if not 0 <= metres < np.inf:
        raise ParameterError(f"expected outlines to be smoothed by 0 or more metres, got {metres:g}")
    if max(geobox.shape) > _MAX_SIDE:
        raise ParameterError(
            f"outlines of a raster of more than {_MAX_SIDE:,} rows or columns cannot be smoothed; "
            "leave --smooth-outline out"
        )
    rows, cols = geobox.shape
    fine = replace(
        geobox,
        shape=(STEPS_PER_PIXEL * rows, STEPS_PER_PIXEL * cols),
        transform=scaled(geobox.transform, 1 / STEPS_PER_PIXEL, 1 / STEPS_PER_PIXEL),
    )
    share = min(metres / (max(ground_resolution(geobox)) / 2), 1.0)
    if share == 0 or not len(rings.labels):
        return replace(rings, vertices=rings.vertices * np.int32(STEPS_PER_PIXEL)), fine
    return _smooth_preserving_areas(rings, geobox.shape, share), fine


def _smooth_preserving_areas(rings: Rings, shape: tuple[int, int], share: float) -> Rings:
    """Smooth rings; the arcs of regions whose area would change too much are not smoothed."""
    nodes = find_nodes(rings, shape)
    smooth = smooth_rings(rings, nodes, shape, np.empty(0, np.int64), share)
    expected = _areas(rings) * STEPS_PER_PIXEL**2
    unsmoothed = np.empty(0, np.int64)
    while (wrong := np.abs(_areas(smooth.rings) - expected) > AREA_TOLERANCE * expected).any():
        of_wrong = wrong[rings.labels]
        more = np.setdiff1d(smooth.arcs[of_wrong[smooth.owners]], unsmoothed)
        assert len(more), "regions on pixel edges have the area of their pixels"
        unsmoothed = np.union1d(unsmoothed, more)
        affected = np.zeros(len(rings.labels), bool)
        affected[smooth.owners[np.isin(smooth.arcs, more)]] = True
        again = smooth_rings(rings.select(affected), nodes, shape, unsmoothed, share)
        smooth = replace(smooth, rings=_replace_rings(smooth.rings, again, affected))
    return smooth.rings if share == 1 else _drop_collinear(smooth.rings, nodes, shape)


def _drop_collinear(rings: Rings, nodes: Nodes, shape: tuple[int, int]) -> Rings:
    """Rings without the vertices at which they do not turn, nodes aside."""
    here = rings.vertices.astype(np.int64)
    index = np.arange(len(here))
    before, after = index - 1, index + 1
    before[rings.starts[:-1]], after[rings.starts[1:] - 1] = rings.starts[1:] - 1, rings.starts[:-1]
    incoming, outgoing = here - here[before], here[after] - here
    corner, rest = np.divmod(here, STEPS_PER_PIXEL)
    node = (rest == 0).all(axis=1) & np.isin(corner[:, 0] * (shape[1] + 1) + corner[:, 1], nodes.by_row)
    turning = node | (incoming[:, 0] * outgoing[:, 1] != incoming[:, 1] * outgoing[:, 0])
    starts = np.concatenate([[0], np.cumsum(turning)])[rings.starts]
    return replace(rings, vertices=rings.vertices[turning], starts=starts)


def _areas(rings: Rings) -> NDArray[np.float64]:
    """The area of each region 0..n, in square units of the rings."""
    return np.asarray(np.bincount(rings.labels, rings.pixel_areas()), np.float64)


def _replace_rings(rings: Rings, again: SmoothRings, which: NDArray[np.bool_]) -> Rings:
    """Rings of which some are replaced."""
    order = np.arange(len(rings.labels))
    order[which] = len(order) + np.arange(int(which.sum()))
    vertices = np.concatenate([rings.vertices, again.rings.vertices])
    starts = np.concatenate([rings.starts, len(rings.vertices) + again.rings.starts[1:]])
    vertices, starts = reorder_rings(vertices, starts, order)
    return replace(rings, vertices=vertices, starts=starts)
