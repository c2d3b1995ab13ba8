"""Boundary tracing (vectorisation): from a label image to rings on pixel edges, strip by strip."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from uavseg.arguments import checked
from uavseg.errors import ParameterError
from uavseg.execution.executors import Map, serial
from uavseg.regions.outline.chains import OWNER, START, Chains, trace_tile
from uavseg.regions.outline.linking import link_chains, split_simple_rings
from uavseg.regions.outline.rings import Rings, reorder_rings
from uavseg.segmentation.components import component_values, label_equal_values, union_roots

STRIP = 256  # rows of a label image that are traced at a time: their working memory is reused


class LabelRows(Protocol):
    """A label image of which rows can be read: an array, or `LazyLabels`."""

    @property
    def shape(self) -> tuple[int, ...]: ...

    def __getitem__(self, rows: slice, /) -> NDArray[np.uint32]: ...


@checked
def trace(labels: LabelRows, map: Map = serial) -> Rings:
    """Outlines of the regions of a label image.

    Parameters
    ----------
    labels : (M, N) uint32 array or LabelRows
        0 is background; pixels of one label that share no edges become several polygons of one region.
    map : Map
        Executor of the strips.

    Returns
    -------
    Rings

    Examples
    --------
    >>> rings = trace(np.array([[1, 1], [1, 0]], np.uint32))
    >>> rings.vertices.tolist()
    [[0, 0], [0, 2], [1, 2], [1, 1], [2, 1], [2, 0]]
    """
    if len(labels.shape) != 2 or getattr(labels, "dtype", np.dtype(np.uint32)).kind not in "iub":
        raise ParameterError("labels are a 2-D array of whole numbers, 0 the background")
    return link_strips(trace_strips(labels, map))


def trace_strips(labels: LabelRows, map: Map = serial) -> list["Strip"]:
    """The first half of `trace`, after which the label image is not needed any more."""
    return list(map(partial(_trace_strip, labels), range(0, labels.shape[0], STRIP)))


def link_strips(strips: list["Strip"]) -> Rings:
    """The second half of `trace`; the list is emptied, see `link_rings`."""
    offsets = np.cumsum([0] + [len(strip.labels) for strip in strips])
    for strip, offset in zip(strips, offsets, strict=False):
        strip.chains.table[:, OWNER] += offset
    of_component = _concatenate([strip.labels for strip in strips], (0,), np.int64)
    parts = union_roots(_contacts(strips, offsets), len(of_component))
    chains = [strip.chains for strip in strips]
    strips.clear()
    return link_rings(chains, of_component, parts)


@dataclass(frozen=True, slots=True)
class Strip:
    """Some rows of a label image, traced.

    Parameters
    ----------
    chains : Chains
        Of connected components 0..n - 1.
    labels : (n,) int64 array
        Label of each component.
    top, bottom : (N,) int64 arrays
        The component of each pixel of the first and of the last row, -1 for none.
    """

    chains: Chains
    labels: NDArray[np.int64]
    top: NDArray[np.int64]
    bottom: NDArray[np.int64]


def _trace_strip(image: LabelRows, top: int) -> Strip:
    near = np.ascontiguousarray(image[max(top - 1, 0) : top + STRIP + 1], np.uint32)
    first = 1 if top == 0 else 0
    own = near[1 - first :][:STRIP]
    components, count = label_equal_values(own)
    rows, cols = components.shape
    framed = np.zeros((rows + 2, cols + 2), np.uint32)
    framed[first : first + len(near), 1:-1] = near
    chains = trace_tile(framed, components, 1, (top, 0), cols)
    chains.table[:, OWNER] -= 1
    labels = component_values(own, components, count)
    return Strip(chains, labels, components[0].astype(np.int64) - 1, components[-1].astype(np.int64) - 1)


def _contacts(strips: Sequence[Strip], offsets: NDArray[np.int64]) -> NDArray[np.int64]:
    """Pairs of components of one label that share an edge across the border of two strips, (k, 2)."""
    pairs = [np.empty((0, 2), np.int64)]
    for k, (above, below) in enumerate(pairwise(strips)):
        both = (above.bottom >= 0) & (below.top >= 0)
        upper, lower = above.bottom[both], below.top[both]
        same = above.labels[upper] == below.labels[lower]
        pairs.append(np.stack([upper[same] + offsets[k], lower[same] + offsets[k + 1]], 1))
    return np.concatenate(pairs)


def link_rings(tiles: list[Chains], labels: NDArray[np.int64], parts: NDArray[np.int64]) -> Rings:
    """Rings from the chains of all tiles.

    Parameters
    ----------
    tiles : list of Chains
        Their owners are components, numbered over all tiles. The list is emptied: its arrays are freed before
        most memory is needed.
    labels : (n,) int64 array
        Label of each component.
    parts : (n,) int64 array
        Number of the connected set of pixels that each component belongs to, in raster order of the sets'
        first pixels.

    Returns
    -------
    Rings
    """
    offsets = np.cumsum([0] + [len(chains.vertices) for chains in tiles])
    vertices = _concatenate([chains.vertices for chains in tiles], (0, 2), np.int32)
    pinched = _concatenate([chains.pinched for chains in tiles], (0,), np.uint8)
    table = _concatenate([chains.table for chains in tiles], (0, 6), np.int64)
    table[:, START] += np.repeat(offsets[:-1], [len(chains.table) for chains in tiles])
    tiles.clear()
    vertices, pinched, starts, owners = link_chains(vertices, pinched, table)
    vertices, starts, owners, hole = split_simple_rings(vertices, pinched, starts, owners)
    first = vertices[starts[:-1]]
    order = np.lexsort((first[:, 1], first[:, 0], hole, parts[owners], labels[owners]))
    part = parts[owners][order]
    return Rings(
        *reorder_rings(vertices, starts, order),
        labels[owners][order],
        np.cumsum(np.diff(part, prepend=part[:1]) != 0),
    )


def _concatenate(arrays: Sequence[NDArray[Any]], empty: tuple[int, ...], dtype: type) -> NDArray[Any]:
    return np.concatenate([np.empty(empty, dtype), *arrays])
