"""The inner loop of A*: how a search goes from node to node by jumps over a bitmap.

A node is a cell at which a straight way stops, for beside it something opens. Pools hold what is known of
nodes and which of them wait; when they are full the loop returns, and goes on with larger ones.
"""

import numpy as np

from uavseg._jit import inlined, kernel
from uavseg.occupancy.paths.bitmap import is_open, stop_after, stop_before

STRAIGHT, DIAGONAL = 1311738121, 1855077841  # Pell numbers: their ratio is sqrt 2 to 2e-19
BUCKETS = 1 << 16
NONE = -1
FAR = 1 << 62
EVERY = 15  # bits of all straight ways

_NORTH, _EAST, _SOUTH, _WEST = range(4)  # ways; bit 4 + k is the diagonal between k and k + 1

# What a search remembers while its pools grow.
_BUCKET, _WAITING, _FREE, ENTRIES, NODES, _BEST, EXPANDED, _BITS, _ORIGIN, _GOAL_ROW, _GOAL_COL, _WIDTH = (
    range(12)
)


@inlined
def left_to(row, col, goal_row, goal_col):  # type: ignore[no-untyped-def]
    """Cost of the shortest path to the goal if nothing were in the way."""
    rows = abs(row - goal_row)
    cols = abs(col - goal_col)
    return STRAIGHT * max(rows, cols) + (DIAGONAL - STRAIGHT) * min(rows, cols)


@inlined
def _down(way):  # type: ignore[no-untyped-def]
    """Rows that one step of a straight way adds."""
    return (way == _SOUTH) - (way == _NORTH)


@inlined
def _right(way):  # type: ignore[no-untyped-def]
    """Columns that one step of a straight way adds."""
    return (way == _EAST) - (way == _WEST)


@inlined
def _jump(rows, cols, row, col, way, goal_row, goal_col):  # type: ignore[no-untyped-def]
    """How many steps it is in a straight way to the next cell to stop at, or to the goal; 0 for none."""
    if way in (_EAST, _WEST):
        at = col
        ahead = goal_col - col if row == goal_row else 0
        stop = stop_after(rows, row, col) if way == _EAST else stop_before(rows, row, col)
    else:
        at = row
        ahead = goal_row - row if col == goal_col else 0
        stop = stop_after(cols, col, row) if way == _SOUTH else stop_before(cols, col, row)
    steps = abs(abs(stop) - at)
    if way in (_NORTH, _WEST):
        ahead = -ahead
    if 0 < ahead < steps:
        return ahead
    return steps if stop > 0 else 0


@inlined
def _ways_on(rows, row, col, came):  # type: ignore[no-untyped-def]
    """Bits of the ways worth taking from a cell that was come to by the straight ways `came`.

    Straight on; and where a side is open but was not one step before, to that side and between the two.
    """
    if came == EVERY:
        return 255
    ways = 0
    for way in range(4):
        if (came >> way) & 1:
            ways |= 1 << way
            down = _down(way)
            right = _right(way)
            for turn in (1, -1):  # clockwise: (down, right) becomes (right, -down)
                side_row = row + turn * right
                side_col = col - turn * down
                if is_open(rows, side_row, side_col) and not is_open(rows, side_row - down, side_col - right):
                    side = (way + turn) & 3
                    ways |= 1 << side | 16 << (way if turn == 1 else side)
    return ways


@inlined
def _reach(nodes, queue, memory, parent, row, col, cost, came):  # type: ignore[no-untyped-def]
    """Take in that a cell can be come to at a cost, by the straight ways `came`, from a parent."""
    numbers, places, parents, costs, ways = nodes
    total = cost + left_to(row, col, memory[_GOAL_ROW], memory[_GOAL_COL])
    if total >= memory[_BEST]:
        return
    place = row * memory[_WIDTH] + col
    node = np.int64(numbers[place])
    if node == 0:
        node = memory[NODES]
        memory[NODES] += 1
        numbers[place] = node
        places[node] = place
    elif costs[node] == cost:  # on another way, which may lead on to other cells
        if (ways[node] | ways[node] >> 4) & came == 0:
            ways[node] |= came
            _enqueue(queue, memory, node, total)
        return
    elif costs[node] < cost:
        return
    costs[node] = cost
    parents[node] = parent
    ways[node] = came
    if row == memory[_GOAL_ROW] and col == memory[_GOAL_COL]:
        memory[_BEST] = cost
    else:
        _enqueue(queue, memory, node, total)


@inlined
def _enqueue(queue, memory, node, total):  # type: ignore[no-untyped-def]
    waiting, links, heads = queue
    entry = memory[_FREE]
    if entry == NONE:
        entry = memory[ENTRIES]
        memory[ENTRIES] += 1
    else:
        memory[_FREE] = links[entry]
    slot = ((total - memory[_ORIGIN]) >> memory[_BITS]) & (BUCKETS - 1)
    waiting[entry] = node
    links[entry] = heads[slot]
    heads[slot] = entry
    memory[_WAITING] += 1


@inlined
def _dequeue(queue, memory):  # type: ignore[no-untyped-def]
    """A node of the first bucket that holds one; none where the goal is not farther than that bucket."""
    waiting, links, heads = queue
    last = (memory[_BEST] - memory[_ORIGIN]) >> memory[_BITS]
    while memory[_WAITING] > 0 and memory[_BUCKET] <= last:
        slot = memory[_BUCKET] & (BUCKETS - 1)
        entry = np.int64(heads[slot])
        if entry != NONE:
            heads[slot] = links[entry]
            links[entry] = memory[_FREE]
            memory[_FREE] = entry
            memory[_WAITING] -= 1
            return np.int64(waiting[entry])
        memory[_BUCKET] += 1
    return np.int64(NONE)


@inlined
def _look_straight(rows, cols, nodes, queue, memory, node, row, col, cost, way):  # type: ignore[no-untyped-def]
    """Reach the next cell to stop at on a straight way."""
    steps = _jump(rows, cols, row, col, way, memory[_GOAL_ROW], memory[_GOAL_COL])
    if steps:
        there = row + steps * _down(way), col + steps * _right(way)
        _reach(nodes, queue, memory, node, there[0], there[1], cost + steps * STRAIGHT, 1 << way)


@inlined
def _look_diagonally(rows, cols, nodes, queue, memory, node, row, col, cost, way):  # type: ignore[no-untyped-def]
    """Go diagonally between a straight way and the next one, looking along both at every step."""
    beside = (way + 1) & 3
    down = _down(way) + _down(beside)
    right = _right(way) + _right(beside)
    while is_open(rows, row + down, col) and is_open(rows, row, col + right):
        row += down
        col += right
        cost += DIAGONAL
        left = left_to(row, col, memory[_GOAL_ROW], memory[_GOAL_COL])
        if not is_open(rows, row, col) or cost + left >= memory[_BEST]:
            return
        if left == 0:
            _reach(nodes, queue, memory, node, row, col, cost, 1)
            return
        _look_straight(rows, cols, nodes, queue, memory, node, row, col, cost, way)
        _look_straight(rows, cols, nodes, queue, memory, node, row, col, cost, beside)


@kernel(
    "i8(u8[:,::1], u8[:,::1], i4[::1], i4[::1], i4[::1], i8[::1], u1[::1], i4[::1], i4[::1], i4[::1],"
    " i8[::1], i8)"
)
def search(  # type: ignore[no-untyped-def]
    rows, cols, numbers, places, parents, costs, ways, waiting, links, heads, memory, room
):
    # 1 where the pools must grow before the search goes on, 0 where it is over.
    # Low bits of ways: straight ways by which a node was come to and is yet to be expanded; high bits: was.
    nodes = (numbers, places, parents, costs, ways)
    queue = (waiting, links, heads)
    while memory[NODES] + room <= places.shape[0] and memory[ENTRIES] + room <= waiting.shape[0]:
        node = _dequeue(queue, memory)
        if node == NONE:
            return 0
        came = ways[node] & EVERY
        row = np.int64(np.uint32(places[node]) // np.uint32(memory[_WIDTH]))
        col = places[node] - row * memory[_WIDTH]
        cost = costs[node]
        if came == 0 or cost + left_to(row, col, memory[_GOAL_ROW], memory[_GOAL_COL]) >= memory[_BEST]:
            continue
        ways[node] = (ways[node] | came << 4) & ~np.uint8(EVERY)
        memory[EXPANDED] += 1
        on = _ways_on(rows, row, col, came)
        for way in range(4):
            if (on >> way) & 1:
                _look_straight(rows, cols, nodes, queue, memory, node, row, col, cost, way)
        for way in range(4):
            if (on >> way) & 16:
                _look_diagonally(rows, cols, nodes, queue, memory, node, row, col, cost, way)
    return 1
