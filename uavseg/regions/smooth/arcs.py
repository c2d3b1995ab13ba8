"""Stretches of boundary between nodes: the same from whichever ring they are seen."""

from uavseg._jit import inlined
from uavseg.regions.smooth.nodes import first_from


@inlined
def unit_corners(vertices, begin, end, by_row, by_col, rows, cols, corners, fixed):  # type: ignore[no-untyped-def]
    """All corners of a ring, and which of them stay where they are; gives how many."""
    used = 0
    for v in range(begin, end):
        after = v + 1 if v + 1 < end else begin
        row = int(vertices[v, 0])
        col = int(vertices[v, 1])
        down = int(vertices[after, 0]) - row
        across = int(vertices[after, 1]) - col
        length = abs(down) + abs(across)
        step_row = (down > 0) - (down < 0)
        step_col = (across > 0) - (across < 0)
        for k in range(length):
            corners[used + k, 0] = row + k * step_row
            corners[used + k, 1] = col + k * step_col
            fixed[used + k] = 0
        if row == 0 or row == rows or col == 0 or col == cols:
            fixed[used] = 1
        if down == 0:
            first = row * (cols + 1) + min(col, col + across)
            k = first_from(by_row, first)
            while k < by_row.shape[0] and by_row[k] <= first + length:
                away = abs(by_row[k] - row * (cols + 1) - col)
                if away < length:
                    fixed[used + away] = 1
                k += 1
        else:
            first = col * (rows + 1) + min(row, row + down)
            k = first_from(by_col, first)
            while k < by_col.shape[0] and by_col[k] <= first + length:
                away = abs(by_col[k] - col * (rows + 1) - row)
                if away < length:
                    fixed[used + away] = 1
                k += 1
        used += length
    return used


@inlined
def edge_key(corners, here, there, cols):  # type: ignore[no-untyped-def]
    """A number for the edge from one corner to the next: that of the corner and a direction."""
    down = corners[there, 0] - corners[here, 0]
    across = corners[there, 1] - corners[here, 1]
    way = 0 if across > 0 else 2 if across < 0 else 1 if down > 0 else 3
    return (corners[here, 0] * (cols + 1) + corners[here, 1]) * 4 + way


@inlined
def corner_before(corners, one, other):  # type: ignore[no-untyped-def]
    """Which of two corners comes first in raster order: -1 the one, 1 the other, 0 they are the same."""
    rows = corners[one, 0] - corners[other, 0]
    cols = corners[one, 1] - corners[other, 1]
    first = rows if rows != 0 else cols
    return (first > 0) - (first < 0)


@inlined
def load(corners, total, start, n, turned, base):  # type: ignore[no-untyped-def]
    """The corners of a stretch, seen from its first one, in the direction in which it is drawn."""
    first = (start + n) % total if turned else start
    for k in range(n + 1):
        here = (start + (n - k if turned else k)) % total
        base[0, k] = corners[here, 1] - corners[first, 1]
        base[1, k] = corners[here, 0] - corners[first, 0]
    return first


@inlined
def is_turned(corners, total, start, n):  # type: ignore[no-untyped-def]
    """Whether a stretch is drawn against the direction of the ring: from the end that comes first."""
    end = (start + n) % total
    order = corner_before(corners, start, end)
    if order == 0:
        order = corner_before(corners, (start + 1) % total, (start + n - 1) % total)
    return order > 0
