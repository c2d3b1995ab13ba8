"""Arcs: boundary pieces between nodes, in one orientation for both rings that share them."""

from uavseg._jit import inlined
from uavseg.regions.sorted_keys import lower_bound


@inlined
def unit_corners(vertices, begin, end, by_row, by_col, rows, cols, corners, fixed):  # type: ignore[no-untyped-def]
    """Write all pixel corners of a ring, and which of them are fixed; returns their number."""
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
            k = lower_bound(by_row, first)
            while k < by_row.shape[0] and by_row[k] <= first + length:
                away = abs(by_row[k] - row * (cols + 1) - col)
                if away < length:
                    fixed[used + away] = 1
                k += 1
        else:
            first = col * (rows + 1) + min(row, row + down)
            k = lower_bound(by_col, first)
            while k < by_col.shape[0] and by_col[k] <= first + length:
                away = abs(by_col[k] - col * (rows + 1) - row)
                if away < length:
                    fixed[used + away] = 1
                k += 1
        used += length
    return used


@inlined
def edge_key(corners, here, there, cols):  # type: ignore[no-untyped-def]
    """Key of the edge from one corner to the next: number of the corner, and a direction."""
    down = corners[there, 0] - corners[here, 0]
    across = corners[there, 1] - corners[here, 1]
    direction = 0 if across > 0 else 2 if across < 0 else 1 if down > 0 else 3
    return (corners[here, 0] * (cols + 1) + corners[here, 1]) * 4 + direction


@inlined
def compare_corners(corners, one, other):  # type: ignore[no-untyped-def]
    """Raster order of two corners: -1 if the first one precedes, 1 if it follows, 0 if equal."""
    rows = corners[one, 0] - corners[other, 0]
    cols = corners[one, 1] - corners[other, 1]
    first = rows if rows != 0 else cols
    return 1 if first > 0 else -1 if first < 0 else 0


@inlined
def load_arc(corners, total, start, n, reverse, base):  # type: ignore[no-untyped-def]
    """Write the corners of an arc relative to its first one, in the arc's own orientation."""
    first = (start + n) % total if reverse else start
    for k in range(n + 1):
        here = (start + (n - k if reverse else k)) % total
        base[0, k] = corners[here, 1] - corners[first, 1]
        base[1, k] = corners[here, 0] - corners[first, 0]
    return first


@inlined
def is_reversed(corners, total, start, n):  # type: ignore[no-untyped-def]
    """Whether an arc's own orientation, from the end that precedes, is opposite to the ring's."""
    end = (start + n) % total
    order = compare_corners(corners, start, end)
    if order == 0:
        order = compare_corners(corners, (start + 1) % total, (start + n - 1) % total)
    return order > 0
