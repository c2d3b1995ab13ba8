"""Outlines without stairs, of which neighbours still share every border."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import ParameterError
from uavseg.raster.geobox import GeoBox, scaled
from uavseg.raster.geodesy.ground import ground_resolution
from uavseg.regions.outline.rings import Rings, reorder_rings
from uavseg.regions.smooth.nodes import Nodes, nodes_of
from uavseg.regions.smooth.sleeve import UNIT
from uavseg.regions.smooth.smooth_rings import Smooth, smooth_rings

Integers = NDArray[np.int64]

AREA_TOLERANCE = 0.01  # of a region's area, that smoothing may change
_MOST_SIDE = np.iinfo(np.int32).max // UNIT - 1


def smoothed(rings: Rings, metres: float, geobox: GeoBox) -> tuple[Rings, GeoBox]:
    """Draw the outlines of regions without stairs; none vanishes, overlaps or becomes invalid.

    An outline runs between the centres of the same pixels as before, so that burning it into the raster's
    grid gives the same labels, and stays within half a pixel of the pixel edges (Gibson's constrained
    elastic surface nets, see `elastic`). A border between two regions stays one line. Where regions meet or
    touch, and on the raster's border, outlines stay where they are. Where the area of a region would change
    by more than a hundredth, its outline stays on the pixel edges, and so do its neighbours' borders with it.

    Parameters
    ----------
    rings : Rings
        Along the pixel edges of `geobox`.
    metres : float
        How far outlines may leave the pixel edges, at most. What is more than half a pixel counts as half a
        pixel; with less, stairs are only flattened. Units of the transform where there is no CRS.
    geobox : GeoBox

    Returns
    -------
    rings : Rings
        On the corners of the finer grid; a ring may begin at any of its vertices.
    geobox : GeoBox
        The finer grid, `portals.UNIT` times as many rows and columns.

    Raises
    ------
    ParameterError
        If `metres` is negative or no number, or the raster has more than eight million rows or columns.

    Examples
    --------
    >>> from affine import Affine
    >>> from uavseg.regions.outline.trace import trace
    >>> box = GeoBox((3, 3), Affine(2.0, 0.0, 0.0, 0.0, -2.0, 0.0), None)
    >>> pixel = trace(np.array([[0, 0, 0], [0, 1, 0], [0, 0, 0]], np.uint32))
    >>> drawn, fine = smoothed(pixel, 1.0, box)
    >>> (drawn.vertices / UNIT).round(1).tolist()
    [[0.8, 1.5], [1.5, 2.2], [2.2, 1.5], [1.5, 0.8]]
    """
    if not 0 <= metres < np.inf:
        raise ParameterError(f"outlines are smoothed by 0 or more metres, not {metres:g}")
    if max(geobox.shape) > _MOST_SIDE:
        raise ParameterError(
            f"outlines of a raster of more than {_MOST_SIDE:,} rows or columns cannot be smoothed; "
            "leave --smooth-outline out"
        )
    rows, cols = geobox.shape
    fine = replace(
        geobox, shape=(UNIT * rows, UNIT * cols), transform=scaled(geobox.transform, 1 / UNIT, 1 / UNIT)
    )
    share = min(metres / (max(ground_resolution(geobox)) / 2), 1.0)
    if share == 0 or not len(rings.labels):
        return replace(rings, vertices=rings.vertices * np.int32(UNIT)), fine
    return _of_kept_area(rings, geobox.shape, share), fine


def _of_kept_area(rings: Rings, shape: tuple[int, int], share: float) -> Rings:
    """Smooth rings; where that takes too much of a region or adds too much, stretches are not smoothed."""
    nodes = nodes_of(rings, shape)
    drawn = smooth_rings(rings, nodes, shape, np.empty(0, np.int64), share)
    wanted = _areas(rings) * UNIT**2
    kept = np.empty(0, np.int64)
    while (wrong := np.abs(_areas(drawn.rings) - wanted) > AREA_TOLERANCE * wanted).any():
        lost = wrong[rings.labels]
        more = np.setdiff1d(drawn.stretches[lost[drawn.owners]], kept)
        assert len(more), "regions on pixel edges have the area of their pixels"
        kept = np.union1d(kept, more)
        touched = np.zeros(len(rings.labels), bool)
        touched[drawn.owners[np.isin(drawn.stretches, more)]] = True
        again = smooth_rings(rings.select(touched), nodes, shape, kept, share)
        drawn = replace(drawn, rings=_with(drawn.rings, again, touched))
    return drawn.rings if share == 1 else _turning(drawn.rings, nodes, shape)


def _turning(rings: Rings, nodes: Nodes, shape: tuple[int, int]) -> Rings:
    """Rings without the vertices, nodes aside, at which they go straight on."""
    here = rings.vertices.astype(np.int64)
    places = np.arange(len(here))
    before, after = places - 1, places + 1
    before[rings.starts[:-1]], after[rings.starts[1:] - 1] = rings.starts[1:] - 1, rings.starts[:-1]
    come, go = here - here[before], here[after] - here
    corner, rest = np.divmod(here, UNIT)
    node = (rest == 0).all(axis=1) & np.isin(corner[:, 0] * (shape[1] + 1) + corner[:, 1], nodes.by_row)
    turning = node | (come[:, 0] * go[:, 1] != come[:, 1] * go[:, 0])
    starts = np.concatenate([[0], np.cumsum(turning)])[rings.starts]
    return replace(rings, vertices=rings.vertices[turning], starts=starts)


def _areas(rings: Rings) -> NDArray[np.float64]:
    """The area of each region 0..n, in square units of the rings."""
    return np.asarray(np.bincount(rings.labels, rings.pixel_areas()), np.float64)


def _with(rings: Rings, again: Smooth, places: NDArray[np.bool_]) -> Rings:
    """Rings with some of them drawn again."""
    order = np.arange(len(rings.labels))
    order[places] = len(order) + np.arange(int(places.sum()))
    vertices = np.concatenate([rings.vertices, again.rings.vertices])
    starts = np.concatenate([rings.starts, len(rings.vertices) + again.rings.starts[1:]])
    vertices, starts = reorder_rings(vertices, starts, order)
    return replace(rings, vertices=vertices, starts=starts)
