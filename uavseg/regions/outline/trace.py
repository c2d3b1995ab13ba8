"""Boundary tracing (vectorisation): from a label image to rings on pixel edges, strip by strip."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from uavseg.arguments import checked
from uavseg.errors import ParameterError
from uavseg.execution.executors import Map, serial
from uavseg.regions.outline.chains import OWNER, Chains, PackedChains, join_packed, pack_chains, trace_tile
from uavseg.regions.outline.linking import link_chains, split_simple_rings
from uavseg.regions.outline.rings import Rings, reorder_rings
from uavseg.segmentation.components import component_values, label_equal_values, union_roots

BATCH = 1 << 21  # vertices of the chains that are linked at a time
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
    chains : PackedChains
        Of connected components 0..n - 1.
    labels : (n,) int64 array
        Label of each component.
    top, bottom : (N,) int64 arrays
        The component of each pixel of the first and of the last row, -1 for none.
    """

    chains: PackedChains
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
    return Strip(
        pack_chains(chains), labels, components[0].astype(np.int64) - 1, components[-1].astype(np.int64) - 1
    )


def _contacts(strips: Sequence[Strip], offsets: NDArray[np.int64]) -> NDArray[np.int64]:
    """Pairs of components of one label that share an edge across the border of two strips, (k, 2)."""
    pairs = [np.empty((0, 2), np.int64)]
    for k, (above, below) in enumerate(pairwise(strips)):
        both = (above.bottom >= 0) & (below.top >= 0)
        upper, lower = above.bottom[both], below.top[both]
        same = above.labels[upper] == below.labels[lower]
        pairs.append(np.stack([upper[same] + offsets[k], lower[same] + offsets[k + 1]], 1))
    return np.concatenate(pairs)


def link_rings(tiles: list[PackedChains], labels: NDArray[np.int64], parts: NDArray[np.int64]) -> Rings:
    """Rings from the chains of all tiles.

    They are linked for some regions at a time, so that beside the rings little memory is needed.

    Parameters
    ----------
    tiles : list of PackedChains
        Their owners are components, numbered over all tiles. The list is emptied.
    labels : (n,) int64 array
        Label of each component.
    parts : (n,) int64 array
        Number of the connected set of pixels that each component belongs to, in raster order of the sets'
        first pixels.

    Returns
    -------
    Rings
    """
    if not tiles:
        tiles = [
            pack_chains(Chains(np.empty((0, 2), np.int32), np.empty(0, np.uint8), np.empty((0, 6), np.int64)))
        ]
    packed = join_packed(tiles)
    of_chain = labels[packed.table[:, OWNER]]
    order = np.argsort(of_chain, kind="stable")
    vertices = np.empty((int(packed.counts.sum()), 2), np.int32)
    starts, ring_labels, ring_parts, used = [np.zeros(1, np.int64)], [labels[:0]], [parts[:0]], 0
    for some in _batches(packed.counts[order], of_chain[order]):
        own, own_starts, owners = _linked(packed.unpacked(np.sort(order[some])), labels, parts)
        vertices[used : used + len(own)] = own
        starts.append(own_starts[1:] + used)
        ring_labels.append(labels[owners])
        ring_parts.append(parts[owners])
        used += len(own)
    part = np.concatenate(ring_parts)
    return Rings(
        vertices[:used],
        np.concatenate(starts),
        np.concatenate(ring_labels),
        np.cumsum(np.diff(part, prepend=part[:1]) != 0),
    )


def _batches(counts: NDArray[np.int64], labels: NDArray[np.int64]) -> Iterator[slice]:
    """Slices of chains, sorted by label, with few vertices more than `BATCH`; no label is in two."""
    ends = np.cumsum(counts)
    first = 0
    while first < len(ends):
        full = int(np.searchsorted(ends, ends[first] - counts[first] + BATCH))
        last = int(np.searchsorted(labels, labels[min(full, len(labels) - 1)], "right"))
        yield slice(first, last)
        first = last


def _linked(
    chains: Chains, labels: NDArray[np.int64], parts: NDArray[np.int64]
) -> tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.int64]]:
    """Vertices, starts and components of the rings of chains, in the order of `Rings`."""
    linked = link_chains(chains.vertices, chains.pinched, chains.table)
    del chains  # one region may be most of a raster
    vertices, starts, owners, hole = split_simple_rings(*linked)
    del linked
    first = vertices[starts[:-1]]
    order = np.lexsort((first[:, 1], first[:, 0], hole, parts[owners], labels[owners]))
    return *reorder_rings(vertices, starts, order), owners[order]


def _concatenate(arrays: Sequence[NDArray[Any]], empty: tuple[int, ...], dtype: type) -> NDArray[Any]:
    return np.concatenate([np.empty(empty, dtype), *arrays])
