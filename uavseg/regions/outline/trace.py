"""Boundary tracing (vectorisation): from a label image to rings on pixel edges, strip by strip.

Chains of boundaries are linked end to end, and rings are split where they pass a vertex twice.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.arguments import checked
from uavseg.arrays import Integers
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.execution.executors import Map, serial
from uavseg.regions.outline.chains import (
    FIRST,
    HEAD,
    LAST,
    OWNER,
    START,
    TAIL,
    Chains,
    PackedChains,
    join_packed,
    pack_chains,
    trace_tile,
)
from uavseg.regions.outline.rings import Rings, dense_parts, reorder_rings
from uavseg.segmentation.components import STRIP, LabelRows, component_values, label_equal_values, union_roots

BATCH = 1 << 21  # vertices of the chains that are linked at a time
Vertices = NDArray[np.int32]


@checked
def trace(labels: LabelRows, map: Map = serial) -> Rings:
    """Trace the outlines of the regions of a label image.

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


def trace_strips(labels: LabelRows, map: Map = serial) -> list["_Strip"]:
    """Trace the strips of a label image: the first half of `trace`, which alone needs the image."""
    return list(map(partial(_trace_strip, labels), range(0, labels.shape[0], STRIP)))


def link_strips(strips: list["_Strip"]) -> Rings:
    """Link the outlines of strips: the second half of `trace`. The list is emptied, see `link_rings`."""
    offsets = np.cumsum([0] + [len(strip.labels) for strip in strips])
    for strip, offset in zip(strips, offsets, strict=False):
        strip.chains.table[:, OWNER] += offset
    of_component = np.concatenate([np.empty(0, np.int64), *(strip.labels for strip in strips)])
    parts = union_roots(_contacts(strips, offsets), len(of_component))
    chains = [strip.chains for strip in strips]
    strips.clear()
    return link_rings(chains, of_component, parts)


@dataclass(frozen=True, slots=True)
class _Strip:
    """Traced rows of a label image."""

    chains: PackedChains  # of connected components 0..n - 1
    labels: NDArray[np.int64]  # of each component
    top: NDArray[np.int64]  # the component of each pixel of the first row, -1 for none
    bottom: NDArray[np.int64]  # the same of the last row


def _trace_strip(image: LabelRows, top: int) -> _Strip:
    near = np.ascontiguousarray(image[max(top - 1, 0) : top + STRIP + 1], np.uint32)
    first = 1 if top == 0 else 0
    inner = near[1 - first :][:STRIP]
    components, count = label_equal_values(inner)
    rows, cols = components.shape
    framed = np.zeros((rows + 2, cols + 2), np.uint32)
    framed[first : first + len(near), 1:-1] = near
    chains = trace_tile(framed, components, 1, (top, 0), cols)
    chains.table[:, OWNER] -= 1
    return _Strip(
        chains=pack_chains(chains),
        labels=component_values(inner, components, count),
        top=components[0].astype(np.int64) - 1,
        bottom=components[-1].astype(np.int64) - 1,
    )


def _contacts(strips: Sequence[_Strip], offsets: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return pairs of components of one label that share an edge across two strips, (k, 2)."""
    pairs = [np.empty((0, 2), np.int64)]
    for k, (above, below) in enumerate(pairwise(strips)):
        both = (above.bottom >= 0) & (below.top >= 0)
        upper, lower = above.bottom[both], below.top[both]
        same = above.labels[upper] == below.labels[lower]
        pairs.append(np.stack([upper[same] + offsets[k], lower[same] + offsets[k + 1]], 1))
    return np.concatenate(pairs)


def link_rings(tiles: list[PackedChains], labels: NDArray[np.int64], parts: NDArray[np.int64]) -> Rings:
    """Link the chains of all tiles to rings; the list of tiles is emptied.

    They are linked for some regions at a time, so that beside the rings little memory is needed. The owners
    of chains are components, numbered over all tiles. `labels`, (n,), are those of the components; `parts`,
    (n,), the number of the connected set of pixels that each belongs to, in raster order of the sets' first
    pixels.
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
    for batch in _batches(packed.counts[order], of_chain[order]):
        linked, linked_starts, owners = _linked(packed.unpacked(np.sort(order[batch])), labels, parts)
        vertices[used : used + len(linked)] = linked
        starts.append(linked_starts[1:] + used)
        ring_labels.append(labels[owners])
        ring_parts.append(parts[owners])
        used += len(linked)
    return Rings(
        vertices=vertices[:used],
        starts=np.concatenate(starts),
        labels=np.concatenate(ring_labels),
        parts=dense_parts(np.concatenate(ring_parts)),
    )


def _batches(counts: NDArray[np.int64], labels: NDArray[np.int64]) -> Iterator[slice]:
    """Split chains, sorted by label, into slices of about `BATCH` vertices; no label is in two."""
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
    """Return vertices, starts and components of the rings of chains, in the order of `Rings`."""
    linked = link_chains(chains.vertices, chains.pinched, chains.table)
    del chains  # one region may be most of a raster
    vertices, starts, owners, hole = split_simple_rings(*linked)
    del linked
    first = vertices[starts[:-1]]
    order = np.lexsort((first[:, 1], first[:, 0], hole, parts[owners], labels[owners]))
    return *reorder_rings(vertices, starts, order), owners[order]


def link_chains(
    vertices: Vertices, pinched: NDArray[np.uint8], table: Integers
) -> tuple[Vertices, NDArray[np.uint8], Integers, Integers]:
    """Join open chains of all tiles, see `Chains`, to closed rings.

    The results are vertices and pinches in the order of the rings, without first vertices on straight edges
    unless they are nodes; the offset of each ring in the vertices, (r + 1,); and the component that it
    belongs to, (r,).
    """
    after = np.arange(len(table))
    opened = np.flatnonzero(table[:, HEAD] >= 0)
    order = opened[np.argsort(table[opened, HEAD])]
    after[opened] = order[np.searchsorted(table[order, HEAD], table[opened, TAIL])]
    ends = np.append(table[1:, START], len(vertices))
    joined, joined_pinched = np.empty_like(vertices), np.empty_like(pinched)
    starts, owners = np.zeros(len(table) + 1, np.int64), np.empty(len(table), np.int64)
    done = np.zeros(len(table), np.uint8)
    rings = _join(vertices, pinched, table, ends, after, done, joined, joined_pinched, starts, owners)
    used = starts[rings]
    return joined[:used], joined_pinched[:used], starts[: rings + 1], owners[:rings]


def split_simple_rings(
    vertices: Vertices, pinched: NDArray[np.uint8], starts: Integers, owners: Integers
) -> tuple[Vertices, Integers, Integers, NDArray[np.uint8]]:
    """Split rings where they pass a vertex twice; each begins at its uppermost, then leftmost vertex.

    A region that touches itself corner to corner gives a ring that passes the corner twice. It is split there
    into an exterior and a hole, or two holes, that touch in a point, as valid polygons may. The last array,
    (r,), is 1 where a ring is a hole.
    """
    partners = _partners(vertices, pinched, starts)
    max_rings = len(owners) + int((partners >= 0).sum()) // 2
    simple = np.empty_like(vertices)
    simple_starts, simple_owners = np.zeros(max_rings + 1, np.int64), np.empty(max_rings, np.int64)
    hole = np.empty(max_rings, np.uint8)
    longest = int(np.diff(starts).max(initial=0))
    stack, place = np.empty(longest, np.int64), np.empty(longest, np.int64)
    rings = _split(
        vertices, starts, owners, partners, stack, place, simple, simple_starts, simple_owners, hole
    )
    used = simple_starts[rings]
    return simple[:used], simple_starts[: rings + 1], simple_owners[:rings], hole[:rings]


def _partners(vertices: Vertices, pinched: NDArray[np.uint8], starts: Integers) -> NDArray[np.int32]:
    """Return the position in its ring at which each vertex occurs a second time; -1 where it occurs once."""
    partners = np.full(len(vertices), -1, np.int32)
    candidates = np.flatnonzero(pinched)
    ring = np.searchsorted(starts, candidates, "right") - 1
    row, col = vertices[candidates].T
    order = np.lexsort((col, row, ring))
    sequence = np.stack([ring, row, col], 1)[order]
    twice = np.flatnonzero((sequence[1:] == sequence[:-1]).all(axis=1))
    first, second = candidates[order[twice]], candidates[order[twice + 1]]
    begin = starts[ring[order[twice]]]
    partners[first] = second - begin
    partners[second] = first - begin
    return partners


@kernel("i8(i4[:,::1], u1[::1], i8[:,::1], i8[::1], i8[::1], u1[::1], i4[:,::1], u1[::1], i8[::1], i8[::1])")
def _join(vertices, pinched, table, ends, after, done, joined, joined_pinched, starts, owners):  # type: ignore[no-untyped-def]
    used, rings = 0, 0
    for chain in range(table.shape[0]):
        if done[chain]:
            continue
        piece = chain
        before = table[chain, LAST]
        if table[chain, HEAD] >= 0:  # find the direction in which the ring reaches its first vertex
            while after[piece] != chain:
                piece = after[piece]
            before = table[piece, LAST]
            piece = chain
        while not done[piece]:
            done[piece] = 1
            straight = table[piece, HEAD] >= 0 and before == table[piece, FIRST]
            for v in range(table[piece, START] + straight, ends[piece]):
                joined[used, 0] = vertices[v, 0]
                joined[used, 1] = vertices[v, 1]
                joined_pinched[used] = pinched[v]
                used += 1
            before = table[piece, LAST]
            piece = after[piece]
        owners[rings] = table[chain, OWNER]
        rings += 1
        starts[rings] = used
    return rings


@inlined
def write_ring(vertices, begin, stack, bottom, top, owner, rings, written):  # type: ignore[no-untyped-def]
    """Write the stack from bottom to top as a ring that begins at its uppermost, then leftmost vertex."""
    simple, starts, owners, hole = written
    first = bottom
    doubled = np.int64(0)
    for k in range(bottom, top + 1):
        here = begin + stack[k]
        there = begin + stack[k + 1 if k < top else bottom]
        best = begin + stack[first]
        if vertices[here, 0] < vertices[best, 0] or (
            vertices[here, 0] == vertices[best, 0] and vertices[here, 1] < vertices[best, 1]
        ):
            first = k
        doubled += np.int64(vertices[here, 1]) * np.int64(vertices[there, 0])
        doubled -= np.int64(vertices[there, 1]) * np.int64(vertices[here, 0])
    count = top - bottom + 1
    used = starts[rings]
    for k in range(count):
        at = begin + stack[bottom + (first - bottom + k) % count]
        simple[used + k, 0] = vertices[at, 0]
        simple[used + k, 1] = vertices[at, 1]
    owners[rings] = owner
    hole[rings] = doubled < 0
    starts[rings + 1] = used + count


@kernel("i8(i4[:,::1], i8[::1], i8[::1], i4[::1], i8[::1], i8[::1], i4[:,::1], i8[::1], i8[::1], u1[::1])")
def _split(vertices, starts, owners, partners, stack, place, simple, simple_starts, simple_owners, hole):  # type: ignore[no-untyped-def]
    # Vertices are pushed on a stack; one that is on it already closes the loop above it.
    rings = 0
    written = (simple, simple_starts, simple_owners, hole)
    for ring in range(owners.shape[0]):
        begin = starts[ring]
        top = -1
        for k in range(starts[ring + 1] - begin):
            place[k] = -1
            twin = partners[begin + k]
            if twin >= 0 and twin < k and place[twin] >= 0:
                bottom = place[twin]
                write_ring(vertices, begin, stack, bottom, top, owners[ring], rings, written)
                rings += 1
                for above in range(bottom + 1, top + 1):
                    place[stack[above]] = -1
                top = bottom
            else:
                top += 1
                stack[top], place[k] = k, top
        write_ring(vertices, begin, stack, 0, top, owners[ring], rings, written)
        rings += 1
    return rings
