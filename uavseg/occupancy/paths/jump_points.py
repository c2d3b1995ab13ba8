"""Jump point search: the inner loop of A*, which jumps from node to node over a bitmap.

A node is a cell at which a straight jump stops because a side opens there. Pools hold the nodes and the
bucket queue; when one is full the loop returns, and the caller continues it with larger pools.
"""

import numpy as np

from uavseg._jit import inlined, kernel
from uavseg.occupancy.paths.bitmap import is_open, next_stop, previous_stop

STRAIGHT, DIAGONAL = 1311738121, 1855077841  # Pell numbers: their ratio is sqrt 2 to 2e-19
BUCKETS = 1 << 16
NO_ENTRY = -1
UNREACHED = 1 << 62
ALL_DIRECTIONS = 15  # bits of the four straight directions

_NORTH, _EAST, _SOUTH, _WEST = range(4)  # bits of directions; bit 4 + k is the diagonal between k and k + 1

# Indices of the search state, which survives the growth of the pools.
_BUCKET, _WAITING, _FREE, ENTRIES, NODES, _BEST, EXPANDED, _BITS, _ORIGIN, _GOAL_ROW, _GOAL_COL, _WIDTH = (
    range(12)
)


@inlined
def octile_cost(row, col, goal_row, goal_col):  # type: ignore[no-untyped-def]
    """Octile distance: the cost of the shortest path to the goal without obstacles."""
    rows = abs(row - goal_row)
    cols = abs(col - goal_col)
    return STRAIGHT * max(rows, cols) + (DIAGONAL - STRAIGHT) * min(rows, cols)


@inlined
def _down(direction):  # type: ignore[no-untyped-def]
    """Rows that one step in a straight direction adds."""
    return (direction == _SOUTH) - (direction == _NORTH)


@inlined
def _right(direction):  # type: ignore[no-untyped-def]
    """Columns that one step in a straight direction adds."""
    return (direction == _EAST) - (direction == _WEST)


@inlined
def _jump_length(rows, cols, row, col, direction, goal_row, goal_col):  # type: ignore[no-untyped-def]
    """Number of steps in a straight direction to the next jump point or to the goal; 0 if there is none."""
    if direction in (_EAST, _WEST):
        position = col
        ahead = goal_col - col if row == goal_row else 0
        stop = next_stop(rows, row, col) if direction == _EAST else previous_stop(rows, row, col)
    else:
        position = row
        ahead = goal_row - row if col == goal_col else 0
        stop = next_stop(cols, col, row) if direction == _SOUTH else previous_stop(cols, col, row)
    steps = abs(abs(stop) - position)
    if direction in (_NORTH, _WEST):
        ahead = -ahead
    if 0 < ahead < steps:
        return ahead
    return steps if stop > 0 else 0


@inlined
def _successor_directions(rows, row, col, arrived):  # type: ignore[no-untyped-def]
    """Bits of the directions to search from a cell that was reached in the straight directions `arrived`.

    Straight on; and where a side is open but was not one step before, to that side and between the two.
    """
    if arrived == ALL_DIRECTIONS:
        return 255
    directions = 0
    for direction in range(4):
        if (arrived >> direction) & 1:
            directions |= 1 << direction
            down = _down(direction)
            right = _right(direction)
            for turn in (1, -1):  # clockwise: (down, right) becomes (right, -down)
                side_row = row + turn * right
                side_col = col - turn * down
                if is_open(rows, side_row, side_col) and not is_open(rows, side_row - down, side_col - right):
                    side = (direction + turn) & 3
                    directions |= 1 << side | 16 << (direction if turn == 1 else side)
    return directions


@inlined
def _relax_node(nodes, queue, state, parent, row, col, cost, arrived):  # type: ignore[no-untyped-def]
    """Record that a cell can be reached from a parent at a cost, in the straight directions `arrived`."""
    node_of_cell, node_cells, parents, costs, directions = nodes
    total = cost + octile_cost(row, col, state[_GOAL_ROW], state[_GOAL_COL])
    if total >= state[_BEST]:
        return
    cell = row * state[_WIDTH] + col
    node = np.int64(node_of_cell[cell])
    if node == 0:
        node = state[NODES]
        state[NODES] += 1
        node_of_cell[cell] = node
        node_cells[node] = cell
    elif costs[node] == cost:  # from another direction, which may lead on to other cells
        if (directions[node] | directions[node] >> 4) & arrived == 0:
            directions[node] |= arrived
            _enqueue(queue, state, node, total)
        return
    elif costs[node] < cost:
        return
    costs[node] = cost
    parents[node] = parent
    directions[node] = arrived
    if row == state[_GOAL_ROW] and col == state[_GOAL_COL]:
        state[_BEST] = cost
    else:
        _enqueue(queue, state, node, total)


@inlined
def _enqueue(queue, state, node, total):  # type: ignore[no-untyped-def]
    """Add a node to the bucket of its total cost."""
    entries, next_entry, heads = queue
    entry = state[_FREE]
    if entry == NO_ENTRY:
        entry = state[ENTRIES]
        state[ENTRIES] += 1
    else:
        state[_FREE] = next_entry[entry]
    slot = ((total - state[_ORIGIN]) >> state[_BITS]) & (BUCKETS - 1)
    entries[entry] = node
    next_entry[entry] = heads[slot]
    heads[slot] = entry
    state[_WAITING] += 1


@inlined
def _dequeue(queue, state):  # type: ignore[no-untyped-def]
    """Take a node from the first bucket that holds one; NO_ENTRY once the goal lies in a bucket before it."""
    entries, next_entry, heads = queue
    last = (state[_BEST] - state[_ORIGIN]) >> state[_BITS]
    while state[_WAITING] > 0 and state[_BUCKET] <= last:
        slot = state[_BUCKET] & (BUCKETS - 1)
        entry = np.int64(heads[slot])
        if entry != NO_ENTRY:
            heads[slot] = next_entry[entry]
            next_entry[entry] = state[_FREE]
            state[_FREE] = entry
            state[_WAITING] -= 1
            return np.int64(entries[entry])
        state[_BUCKET] += 1
    return np.int64(NO_ENTRY)


@inlined
def _jump_straight(rows, cols, nodes, queue, state, node, row, col, cost, direction):  # type: ignore[no-untyped-def]
    """Reach the next jump point in a straight direction."""
    steps = _jump_length(rows, cols, row, col, direction, state[_GOAL_ROW], state[_GOAL_COL])
    if steps:
        target = row + steps * _down(direction), col + steps * _right(direction)
        _relax_node(nodes, queue, state, node, target[0], target[1], cost + steps * STRAIGHT, 1 << direction)


@inlined
def _jump_diagonally(rows, cols, nodes, queue, state, node, row, col, cost, direction):  # type: ignore[no-untyped-def]
    """Go diagonally between a straight direction and the next; at each step, jump straight in both."""
    beside = (direction + 1) & 3
    down = _down(direction) + _down(beside)
    right = _right(direction) + _right(beside)
    while is_open(rows, row + down, col) and is_open(rows, row, col + right):
        row += down
        col += right
        cost += DIAGONAL
        left = octile_cost(row, col, state[_GOAL_ROW], state[_GOAL_COL])
        if not is_open(rows, row, col) or cost + left >= state[_BEST]:
            return
        if left == 0:
            _relax_node(nodes, queue, state, node, row, col, cost, 1)
            return
        _jump_straight(rows, cols, nodes, queue, state, node, row, col, cost, direction)
        _jump_straight(rows, cols, nodes, queue, state, node, row, col, cost, beside)


@kernel(
    "i8(u8[:,::1], u8[:,::1], i4[::1], i4[::1], i4[::1], i8[::1], u1[::1], i4[::1], i4[::1], i4[::1],"
    " i8[::1], i8)"
)
def search(  # type: ignore[no-untyped-def]
    rows,
    cols,
    node_of_cell,
    node_cells,
    parents,
    costs,
    directions,
    entries,
    next_entry,
    heads,
    state,
    reserve,
):
    # 1 if the pools must grow before the search continues, 0 if it is over. Low bits of directions: those in
    # which a node was reached and is yet to be expanded; high bits: expanded.
    nodes = (node_of_cell, node_cells, parents, costs, directions)
    queue = (entries, next_entry, heads)
    while state[NODES] + reserve <= node_cells.shape[0] and state[ENTRIES] + reserve <= entries.shape[0]:
        node = _dequeue(queue, state)
        if node == NO_ENTRY:
            return 0
        arrived = directions[node] & ALL_DIRECTIONS
        row = np.int64(np.uint32(node_cells[node]) // np.uint32(state[_WIDTH]))
        col = node_cells[node] - row * state[_WIDTH]
        cost = costs[node]
        if arrived == 0 or cost + octile_cost(row, col, state[_GOAL_ROW], state[_GOAL_COL]) >= state[_BEST]:
            continue
        directions[node] = (directions[node] | arrived << 4) & ~np.uint8(ALL_DIRECTIONS)
        state[EXPANDED] += 1
        successors = _successor_directions(rows, row, col, arrived)
        for direction in range(4):
            if (successors >> direction) & 1:
                _jump_straight(rows, cols, nodes, queue, state, node, row, col, cost, direction)
        for direction in range(4):
            if (successors >> direction) & 16:
                _jump_diagonally(rows, cols, nodes, queue, state, node, row, col, cost, direction)
    return 1
