"""Labels to rings on pixel edges; tile by tile without seams."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from uavseg.execution.executors import Map, serial
from uavseg.regions.outline.chains import OWNER, START, Chains, trace_tile
from uavseg.regions.outline.linking import joined_chains, simple_rings
from uavseg.regions.outline.rings import Rings, gathered
from uavseg.segmentation.components import component_values, label_equal_values, union_roots

STRIP = 256  # rows of a label image that are traced at a time: what that takes is used again and again


class LabelRows(Protocol):
    """A label image of which rows are looked at, such as an array."""

    @property
    def shape(self) -> tuple[int, ...]: ...

    def __getitem__(self, rows: slice, /) -> NDArray[np.uint32]: ...


def trace(labels: LabelRows, map: Map = serial) -> Rings:
    """Outlines of the regions of a label image.

    Parameters
    ----------
    labels : (M, N) uint32 array, or what gives rows of one
        0 is nothing; pixels of one label that share no edges become several polygons of one region.
    map : Map
        Who runs the work.

    Examples
    --------
    >>> rings = trace(np.array([[1, 1], [1, 0]], np.uint32))
    >>> rings.vertices.tolist()
    [[0, 0], [0, 2], [1, 2], [1, 1], [2, 1], [2, 0]]
    """
    strips = list(map(partial(_trace_strip, labels), range(0, labels.shape[0], STRIP)))
    before = np.cumsum([0] + [len(strip.names) for strip in strips])
    for strip, offset in zip(strips, before, strict=False):
        strip.chains.table[:, OWNER] += offset
    names = _stacked([strip.names for strip in strips], (0,), np.int64)
    return link([strip.chains for strip in strips], names, union_roots(_meetings(strips, before), len(names)))


@dataclass(frozen=True, slots=True)
class _Strip:
    """What some rows of a label image add: chains of its pieces 0..n - 1, the label of each, and which pieces
    lie along the first row and the last, -1 where there is none.
    """

    chains: Chains
    names: NDArray[np.int64]
    top: NDArray[np.int64]
    bottom: NDArray[np.int64]


def _trace_strip(image: LabelRows, top: int) -> _Strip:
    near = np.ascontiguousarray(image[max(top - 1, 0) : top + STRIP + 1], np.uint32)
    first = 1 if top == 0 else 0
    own = near[1 - first :][:STRIP]
    pieces, count = label_equal_values(own)
    rows, cols = pieces.shape
    framed = np.zeros((rows + 2, cols + 2), np.uint32)
    framed[first : first + len(near), 1:-1] = near
    chains = trace_tile(framed, pieces, 1, (top, 0), cols)
    chains.table[:, OWNER] -= 1
    names = component_values(own, pieces, count)
    return _Strip(chains, names, pieces[0].astype(np.int64) - 1, pieces[-1].astype(np.int64) - 1)


def _meetings(strips: Sequence[_Strip], before: NDArray[np.int64]) -> NDArray[np.int64]:
    """Pairs of pieces of one label that share an edge between two strips, (k, 2)."""
    pairs = [np.empty((0, 2), np.int64)]
    for k, (above, below) in enumerate(pairwise(strips)):
        both = (above.bottom >= 0) & (below.top >= 0)
        upper, lower = above.bottom[both], below.top[both]
        same = above.names[upper] == below.names[lower]
        pairs.append(np.stack([upper[same] + before[k], lower[same] + before[k + 1]], 1))
    return np.concatenate(pairs)


def link(pieces: list[Chains], labels: NDArray[np.int64], parts: NDArray[np.int64]) -> Rings:
    """Rings from the chains of all tiles.

    Parameters
    ----------
    pieces : list of Chains
        Their owners are numbers of components, over all tiles. The list is emptied: what was in it is no
        longer needed when the most memory is.
    labels : (n,) int64 array
        Label of each component.
    parts : (n,) int64 array
        A number for each connected piece of pixels, in raster order of their first pixels.
    """
    offsets = np.cumsum([0] + [len(chains.vertices) for chains in pieces])
    vertices = _stacked([chains.vertices for chains in pieces], (0, 2), np.int32)
    pinched = _stacked([chains.pinched for chains in pieces], (0,), np.uint8)
    table = _stacked([chains.table for chains in pieces], (0, 6), np.int64)
    table[:, START] += np.repeat(offsets[:-1], [len(chains.table) for chains in pieces])
    pieces.clear()
    vertices, pinched, starts, owners = joined_chains(vertices, pinched, table)
    vertices, starts, owners, hole = simple_rings(vertices, pinched, starts, owners)
    first = vertices[starts[:-1]]
    order = np.lexsort((first[:, 1], first[:, 0], hole, parts[owners], labels[owners]))
    part = parts[owners][order]
    return Rings(
        *gathered(vertices, starts, order),
        labels[owners][order],
        np.cumsum(np.diff(part, prepend=part[:1]) != 0),
    )


def _stacked(arrays: Sequence[NDArray], empty: tuple[int, ...], dtype: type) -> NDArray:  # type: ignore[type-arg]
    return np.concatenate([np.empty(empty, dtype), *arrays])
