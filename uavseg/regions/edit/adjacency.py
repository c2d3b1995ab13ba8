"""Region adjacency graph: pairs of neighbouring regions, weighted by the length of their shared border."""

import numpy as np
from numpy.typing import NDArray

from uavseg.regions.outline.rings import Rings
from uavseg.regions.sorted_keys import sorted_unique

Integers = NDArray[np.int64]


def border_lengths(rings: Rings) -> tuple[Integers, Integers]:
    """Length of the border that each pair of adjacent regions shares.

    Parameters
    ----------
    rings : Rings
        Along pixel edges.

    Returns
    -------
    pairs : (k, 2) int64 array
        Labels of adjacent regions, the smaller one first, in ascending order.
    lengths : (k,) int64 array
        Pixel edges that each pair shares.

    Examples
    --------
    >>> from uavseg.regions.outline.trace import trace
    >>> pairs, lengths = border_lengths(trace(np.array([[1, 1, 2], [3, 0, 2]], np.uint32)))
    >>> pairs.tolist(), lengths.tolist()
    ([[1, 2], [1, 3]], [1, 1])
    """
    found = [_shared_along(rings, axis) for axis in (0, 1)]
    one, other, lengths = (np.concatenate(parts) for parts in zip(*found, strict=True))
    size = int(rings.labels.max(initial=0)) + 1
    keys, place = np.unique(np.minimum(one, other) * size + np.maximum(one, other), return_inverse=True)
    sums = np.zeros(len(keys), np.int64)
    np.add.at(sums, place, lengths)
    return np.stack(np.divmod(keys, size), axis=1), sums


def _shared_along(rings: Rings, axis: int) -> tuple[Integers, Integers, Integers]:
    """The regions on either side of each straight shared border along an axis, and its length."""
    vertices = rings.vertices.astype(np.int64)
    after = np.arange(1, len(vertices) + 1)
    after[rings.starts[1:] - 1] = rings.starts[:-1]
    here, there = vertices[:, axis], vertices[after, axis]
    edges = np.flatnonzero(here != there)
    stride = int(vertices[:, axis].max(initial=0)) + 2  # keys of different lines never overlap
    line = vertices[edges, 1 - axis] * stride
    starts, ends = line + np.minimum(here, there)[edges], line + np.maximum(here, there)[edges]
    labels = rings.labels[np.searchsorted(rings.starts, edges, "right") - 1]
    forward = (here < there)[edges]
    breaks = sorted_unique(np.concatenate([starts, ends]))
    sides = [_labels_at(starts[side], ends[side], labels[side], breaks[:-1]) for side in (forward, ~forward)]
    shared = (sides[0] > 0) & (sides[1] > 0)
    return sides[0][shared], sides[1][shared], np.diff(breaks)[shared]


def _labels_at(starts: Integers, ends: Integers, labels: Integers, positions: Integers) -> Integers:
    """The label of the edge that covers each position; 0 where none does."""
    order = np.argsort(starts)
    edge = np.searchsorted(starts[order], positions, "right") - 1
    found = np.where(edge >= 0, np.append(labels[order], 0)[edge], 0)
    return np.where(np.append(ends[order], 0)[edge] > positions, found, 0)
