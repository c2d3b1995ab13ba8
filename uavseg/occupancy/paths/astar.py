"""A*: the shortest path over the cells of a mask, eight-connected, without cutting corners.

Hart, Nilsson and Raphael, "A formal basis for the heuristic determination of minimum cost paths", IEEE
Transactions on Systems Science and Cybernetics 4 (1968) 100-107. A step costs its Euclidean length, 1 or
sqrt 2; the heuristic is the octile distance. Of the many paths of one cost, only those that run diagonally
first are searched, by jump point search (Harabor and Grastien, "Online graph pruning for pathfinding on grid
maps", AAAI 2011, in the variant that cuts no corners): straight jumps over a bitmap stop only where a side
opens. Dead ends are filled before.

The cost of a straight and b diagonal steps is the integer STRAIGHT * a + DIAGONAL * b. DIAGONAL / STRAIGHT is
a convergent of the continued fraction of sqrt 2, and no fraction with a smaller denominator lies between the
two, so the integers compare as a + b sqrt 2 as long as b is below STRAIGHT: all costs are exact. The open
list is a bucket queue of cost plus heuristic, last in first out. The order within a bucket does not matter,
because a cell that is reached at a lower cost is expanded again. So the result depends neither on rounding
nor on the machine.
"""

from math import sqrt

import numpy as np

from uavseg._jit import inlined, kernel
from uavseg.arrays import Bools, Integers
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, PathError
from uavseg.occupancy.paths.bitmap import (
    Bitmap,
    fill_dead_ends,
    is_open,
    next_stop,
    pack_mask,
    previous_stop,
    transpose_bitmap,
)

MAX_SEARCH_CELLS = (1 << 31) - 1
STRAIGHT, DIAGONAL = 1311738121, 1855077841  # Pell numbers: their ratio is sqrt 2 to 2e-19
_BUCKETS = 1 << 16
_NO_ENTRY = -1
_UNREACHED = 1 << 62
_ALL_DIRECTIONS = 15  # bits of the four straight directions
_MIN_BUCKET_BITS = 27  # bits of the narrowest bucket: a tenth of a straight step
_NORTH, _EAST, _SOUTH, _WEST = range(4)  # bits of directions; bit 4 + k is the diagonal between k and k + 1

# Indices of the search state, which survives the growth of the pools.
_BUCKET, _WAITING, _FREE, _ENTRIES, _NODES, _BEST, _EXPANDED, _BITS, _ORIGIN, _GOAL_ROW, _GOAL_COL, _WIDTH = (
    range(12)
)


@dataclass(frozen=True)
class CellPath:
    """A path from cell to cell."""

    # (n, 2) int64; rows and columns, start and goal included; each is one of the eight neighbours of the one
    # before.
    cells: Integers
    straight: int  # numbers of straight and of diagonal steps
    diagonal: int
    expanded: int  # number of cells that the search expanded

    @property
    def cost(self) -> float:
        """Return the length in cells: straight + diagonal * sqrt 2."""
        return self.straight + self.diagonal * sqrt(2)


def shortest_path(mask: Bools, start: tuple[int, int], goal: tuple[int, int]) -> CellPath:
    """Find the shortest path between two cells of a mask.

    A step leads to one of the eight neighbours; a diagonal one needs both cells beside it to be passable.
    `mask` (M, N) are the passable cells; `start` and `goal` are row and column.

    Examples
    --------
    >>> mask = np.array([[1, 1, 1], [1, 0, 1]], bool)
    >>> shortest_path(mask, (1, 0), (1, 2)).cells.tolist()
    [[1, 0], [0, 0], [0, 1], [0, 2], [1, 2]]
    >>> shortest_path(np.ones((3, 3), bool), (0, 0), (2, 2)).cost == 2 * 2**0.5
    True
    """
    rows, cols = mask.shape
    if (rows + 2) * (cols + 2) > MAX_SEARCH_CELLS:
        raise ParameterError(
            f"a map of {rows} x {cols} cells is too large for the path search; make its cells larger"
        )
    for name, (row, col) in (("start", start), ("goal", goal)):
        if not (0 <= row < rows and 0 <= col < cols) or not mask[row, col]:
            raise PathError(f"the {name}, row {row} and column {col}, is not a passable cell")
    first, last = (start[0] + 1, start[1] + 1), (goal[0] + 1, goal[1] + 1)
    bitmap = pack_mask(mask)
    fill_dead_ends(bitmap, first, last)
    turns, expanded = _search_turns(bitmap, transpose_bitmap(bitmap, cols), mask.shape, first, last)
    cells = _fill_between(turns - 1)
    diagonal = int(np.abs(np.diff(cells, axis=0)).prod(axis=1).sum())
    return CellPath(cells=cells, straight=len(cells) - 1 - diagonal, diagonal=diagonal, expanded=expanded)


def _search_turns(
    rows: Bitmap, cols: Bitmap, shape: tuple[int, int], start: tuple[int, int], goal: tuple[int, int]
) -> tuple[Integers, int]:
    """Search the framed cells between which a path runs diagonally, then straight; count expansions."""
    width = shape[1] + 2
    node_of_cell = np.zeros((shape[0] + 2) * width, np.int32)  # number of the node on a cell, 0 for none
    heads = np.full(_BUCKETS, _NO_ENTRY, np.int32)
    bits = max(_MIN_BUCKET_BITS, (3 * max(shape) * STRAIGHT // _BUCKETS).bit_length())
    origin = octile_cost(*start, *goal)
    state = np.array([0, 1, _NO_ENTRY, 1, 2, _UNREACHED, 0, bits, origin, *goal, width], np.int64)
    reserve = 8 * max(shape) + 64  # upper bound of what one expansion adds
    node_cells, parents, entries, next_entry = (np.zeros(2 * reserve, np.int32) for _ in range(4))
    costs, directions = np.zeros(2 * reserve, np.int64), np.zeros(2 * reserve, np.uint8)
    # Node 1 is the start, the only entry of the first bucket.
    node_cells[1], directions[1] = start[0] * width + start[1], _ALL_DIRECTIONS
    entries[0], next_entry[0], heads[0] = 1, _NO_ENTRY, 0
    node_of_cell[node_cells[1]] = 1
    if start == goal:
        return np.array([start]), 0
    grid = (rows, cols, node_of_cell)
    while _search(*grid, node_cells, parents, costs, directions, entries, next_entry, heads, state, reserve):
        if state[_NODES] + reserve > len(node_cells):
            node_cells, parents = np.tile(node_cells, 2), np.tile(parents, 2)
            costs, directions = np.tile(costs, 2), np.tile(directions, 2)
        if state[_ENTRIES] + reserve > len(entries):
            entries, next_entry = np.tile(entries, 2), np.tile(next_entry, 2)
    chain = [int(node_of_cell[goal[0] * width + goal[1]])]
    if not chain[0]:
        raise PathError("no path leads from the start to the goal")
    while parents[chain[-1]]:
        chain.append(int(parents[chain[-1]]))
    return np.stack(np.divmod(node_cells[chain[::-1]].astype(np.int64), width), axis=1), int(state[_EXPANDED])


def _fill_between(turns: Integers) -> Integers:
    """List all cells of a path that runs from each turn to the next, diagonally first."""
    moves = np.diff(turns, axis=0)
    lengths = np.abs(moves).max(axis=1)
    step = np.arange(1, lengths.sum() + 1) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    walked = np.minimum(step[:, None], np.repeat(np.abs(moves), lengths, axis=0))
    cells = np.repeat(turns[:-1], lengths, axis=0) + np.repeat(np.sign(moves), lengths, axis=0) * walked
    return np.concatenate([turns[:1], cells])


@inlined
def octile_cost(row, col, goal_row, goal_col):  # type: ignore[no-untyped-def]
    """Return the octile distance: the cost of the shortest path to the goal without obstacles."""
    rows, cols = abs(row - goal_row), abs(col - goal_col)
    return STRAIGHT * max(rows, cols) + (DIAGONAL - STRAIGHT) * min(rows, cols)


@inlined
def _down(direction):  # type: ignore[no-untyped-def]
    """Return the rows that one step in a straight direction adds."""
    return (direction == _SOUTH) - (direction == _NORTH)


@inlined
def _right(direction):  # type: ignore[no-untyped-def]
    """Return the columns that one step in a straight direction adds."""
    return (direction == _EAST) - (direction == _WEST)


@inlined
def _jump_length(rows, cols, row, col, direction, goal_row, goal_col):  # type: ignore[no-untyped-def]
    """Count the steps in a straight direction to the next jump point or to the goal; 0 if there is none."""
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
    """Return bits of directions to search from a cell: straight on, and to sides that have just opened."""
    if arrived == _ALL_DIRECTIONS:
        return 255
    directions = 0
    for direction in range(4):
        if (arrived >> direction) & 1:
            directions |= 1 << direction
            down = _down(direction)
            right = _right(direction)
            for turn in (1, -1):  # clockwise: (down, right) becomes (right, -down)
                side_row, side_col = row + turn * right, col - turn * down
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
        node = state[_NODES]
        state[_NODES] += 1
        node_of_cell[cell], node_cells[node] = node, cell
    elif costs[node] == cost:  # from another direction, which may lead on to other cells
        if (directions[node] | directions[node] >> 4) & arrived == 0:
            directions[node] |= arrived
            _enqueue(queue, state, node, total)
        return
    elif costs[node] < cost:
        return
    costs[node], parents[node], directions[node] = cost, parent, arrived
    if row == state[_GOAL_ROW] and col == state[_GOAL_COL]:
        state[_BEST] = cost
    else:
        _enqueue(queue, state, node, total)


@inlined
def _enqueue(queue, state, node, total):  # type: ignore[no-untyped-def]
    """Add a node to the bucket of its total cost."""
    entries, next_entry, heads = queue
    entry = state[_FREE]
    if entry == _NO_ENTRY:
        entry = state[_ENTRIES]
        state[_ENTRIES] += 1
    else:
        state[_FREE] = next_entry[entry]
    slot = ((total - state[_ORIGIN]) >> state[_BITS]) & (_BUCKETS - 1)
    entries[entry] = node
    next_entry[entry] = heads[slot]
    heads[slot] = entry
    state[_WAITING] += 1


@inlined
def _dequeue(queue, state):  # type: ignore[no-untyped-def]
    """Take a node from the first bucket that holds one; _NO_ENTRY once the goal lies in one before it."""
    entries, next_entry, heads = queue
    last = (state[_BEST] - state[_ORIGIN]) >> state[_BITS]
    while state[_WAITING] > 0 and state[_BUCKET] <= last:
        slot = state[_BUCKET] & (_BUCKETS - 1)
        entry = np.int64(heads[slot])
        if entry != _NO_ENTRY:
            heads[slot] = next_entry[entry]
            next_entry[entry] = state[_FREE]
            state[_FREE] = entry
            state[_WAITING] -= 1
            return np.int64(entries[entry])
        state[_BUCKET] += 1
    return np.int64(_NO_ENTRY)


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
def _search(  # type: ignore[no-untyped-def]
    rows, cols, node_of_cell, node_cells, parents, costs, directions, entries, next_entry, heads, state,
    reserve,
):  # fmt: skip
    # 1 if the pools must grow before the search continues, 0 if it is over. Low bits of directions: those in
    # which a node was reached and is yet to be expanded; high bits: expanded.
    nodes = (node_of_cell, node_cells, parents, costs, directions)
    queue = (entries, next_entry, heads)
    while state[_NODES] + reserve <= node_cells.shape[0] and state[_ENTRIES] + reserve <= entries.shape[0]:
        node = _dequeue(queue, state)
        if node == _NO_ENTRY:
            return 0
        arrived = directions[node] & _ALL_DIRECTIONS
        row = np.int64(np.uint32(node_cells[node]) // np.uint32(state[_WIDTH]))
        col = node_cells[node] - row * state[_WIDTH]
        cost = costs[node]
        if arrived == 0 or cost + octile_cost(row, col, state[_GOAL_ROW], state[_GOAL_COL]) >= state[_BEST]:
            continue
        directions[node] = (directions[node] | arrived << 4) & ~np.uint8(_ALL_DIRECTIONS)
        state[_EXPANDED] += 1
        successors = _successor_directions(rows, row, col, arrived)
        for direction in range(4):
            if (successors >> direction) & 1:
                _jump_straight(rows, cols, nodes, queue, state, node, row, col, cost, direction)
        for direction in range(4):
            if (successors >> direction) & 16:
                _jump_diagonally(rows, cols, nodes, queue, state, node, row, col, cost, direction)
    return 1
