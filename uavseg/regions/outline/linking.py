"""Ring linking: boundary chains joined end to end, and split where a ring passes a vertex twice."""

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.regions.outline.chains import FIRST, HEAD, LAST, OWNER, START, TAIL

Vertices = NDArray[np.int32]
Integers = NDArray[np.int64]


def link_chains(
    vertices: Vertices, pinched: NDArray[np.uint8], table: Integers
) -> tuple[Vertices, NDArray[np.uint8], Integers, Integers]:
    """Join open chains to closed ones.

    Parameters
    ----------
    vertices : (v, 2) int32 array
    pinched : (v,) uint8 array
    table : (k, 6) int64 array
        Of all tiles, see `Chains`.

    Returns
    -------
    vertices, pinched
        As given, in the order of the rings, without first vertices on straight edges unless they are nodes.
    starts : (r + 1,) int64 array
        Offset of each ring in `vertices`.
    owners : (r,) int64 array
        The component that each ring belongs to.
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
    into an exterior and a hole, or two holes, that touch in a point, as valid polygons may.

    Parameters
    ----------
    vertices, pinched, starts, owners
        From `link_chains`.

    Returns
    -------
    vertices, starts, owners
    hole : (r,) uint8 array
        1 where a ring is a hole.
    """
    partners = _partners(vertices, pinched, starts)
    most = len(owners) + int((partners >= 0).sum()) // 2
    simple = np.empty_like(vertices)
    simple_starts, simple_owners = np.zeros(most + 1, np.int64), np.empty(most, np.int64)
    hole = np.empty(most, np.uint8)
    longest = int(np.diff(starts).max(initial=0))
    stack, place = np.empty(longest, np.int64), np.empty(longest, np.int64)
    rings = _split(
        vertices, starts, owners, partners, stack, place, simple, simple_starts, simple_owners, hole
    )
    used = simple_starts[rings]
    return simple[:used], simple_starts[: rings + 1], simple_owners[:rings], hole[:rings]


def _partners(vertices: Vertices, pinched: NDArray[np.uint8], starts: Integers) -> NDArray[np.int32]:
    """Position in its ring at which each vertex occurs a second time; -1 where it occurs once."""
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


_JOIN = "i8(i4[:,::1], u1[::1], i8[:,::1], i8[::1], i8[::1], u1[::1], i4[:,::1], u1[::1], i8[::1], i8[::1])"


@kernel(_JOIN)
def _join(vertices, pinched, table, ends, after, done, joined, joined_pinched, starts, owners):  # type: ignore[no-untyped-def]
    used = 0
    rings = 0
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
def write_ring(vertices, begin, stack, bottom, top, owner, rings, found):  # type: ignore[no-untyped-def]
    """Write the stack from bottom to top as a ring that begins at its uppermost, then leftmost vertex."""
    simple, starts, owners, hole = found
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


_SPLIT = "i8(i4[:,::1], i8[::1], i8[::1], i4[::1], i8[::1], i8[::1], i4[:,::1], i8[::1], i8[::1], u1[::1])"


@kernel(_SPLIT)
def _split(vertices, starts, owners, partners, stack, place, simple, simple_starts, simple_owners, hole):  # type: ignore[no-untyped-def]
    # Vertices are pushed on a stack; one that is on it already closes the loop above it.
    rings = 0
    found = (simple, simple_starts, simple_owners, hole)
    for ring in range(owners.shape[0]):
        begin = starts[ring]
        top = -1
        for k in range(starts[ring + 1] - begin):
            place[k] = -1
            twin = partners[begin + k]
            if twin >= 0 and twin < k and place[twin] >= 0:
                bottom = place[twin]
                write_ring(vertices, begin, stack, bottom, top, owners[ring], rings, found)
                rings += 1
                for above in range(bottom + 1, top + 1):
                    place[stack[above]] = -1
                top = bottom
            else:
                top += 1
                stack[top] = k
                place[k] = top
        write_ring(vertices, begin, stack, 0, top, owners[ring], rings, found)
        rings += 1
    return rings
