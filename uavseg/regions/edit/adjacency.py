"""Who borders on whom, and along how many pixel edges."""

import numpy as np
from numpy.typing import NDArray

from uavseg.regions.outline.rings import Rings
from uavseg.regions.smooth.nodes import distinct

Integers = NDArray[np.int64]


def shared_borders(rings: Rings) -> tuple[Integers, Integers]:
    """Pairs of regions that share pixel edges.

    Parameters
    ----------
    rings : Rings
        Along pixel edges.

    Returns
    -------
    pairs : (k, 2) int64 array
        Labels, the smaller one first, in ascending order.
    lengths : (k,) int64 array
        How many edges of pixels each pair shares.

    Examples
    --------
    >>> from uavseg.regions.outline.trace import trace
    >>> pairs, lengths = shared_borders(trace(np.array([[1, 1, 2], [3, 0, 2]], np.uint32)))
    >>> pairs.tolist(), lengths.tolist()
    ([[1, 2], [1, 3]], [1, 1])
    """
    found = [_along(rings, axis) for axis in (0, 1)]
    one, other, lengths = (np.concatenate(parts) for parts in zip(*found, strict=True))
    size = int(rings.labels.max(initial=0)) + 1
    keys, place = np.unique(np.minimum(one, other) * size + np.maximum(one, other), return_inverse=True)
    sums = np.zeros(len(keys), np.int64)
    np.add.at(sums, place, lengths)
    return np.stack(np.divmod(keys, size), axis=1), sums


def _along(rings: Rings, axis: int) -> tuple[Integers, Integers, Integers]:
    """The two regions beside each stretch of shared border along an axis, and its length."""
    vertices = rings.vertices.astype(np.int64)
    after = np.arange(1, len(vertices) + 1)
    after[rings.starts[1:] - 1] = rings.starts[:-1]
    here, there = vertices[:, axis], vertices[after, axis]
    edges = np.flatnonzero(here != there)
    stride = int(vertices[:, axis].max(initial=0)) + 2  # edges of different lines never meet
    line = vertices[edges, 1 - axis] * stride
    starts, ends = line + np.minimum(here, there)[edges], line + np.maximum(here, there)[edges]
    labels = rings.labels[np.searchsorted(rings.starts, edges, "right") - 1]
    forth = (here < there)[edges]
    breaks = distinct(np.concatenate([starts, ends]))
    sides = [_beside(starts[side], ends[side], labels[side], breaks[:-1]) for side in (forth, ~forth)]
    shared = (sides[0] > 0) & (sides[1] > 0)
    return sides[0][shared], sides[1][shared], np.diff(breaks)[shared]


def _beside(starts: Integers, ends: Integers, labels: Integers, places: Integers) -> Integers:
    """The label of the edge that lies on each place; 0 where there is none."""
    order = np.argsort(starts)
    edge = np.searchsorted(starts[order], places, "right") - 1
    found = np.where(edge >= 0, np.append(labels[order], 0)[edge], 0)
    return np.where(np.append(ends[order], 0)[edge] > places, found, 0)
