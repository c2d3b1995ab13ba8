"""Reference implementation of the algorithm: slow, independent of the package, written from its description.

Whole arrays and plain loops; nothing is tiled, compiled or shared with the package. Where the description is
ambiguous, a comment that starts with "Reading:" gives the interpretation.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Bool = NDArray[np.bool_]
Ints = NDArray[np.int64]
Floats = NDArray[np.float64]
Grey = NDArray[np.uint16]
Labels = NDArray[np.uint32]

BLOCK, CELL = 64, 8
FREE, UNKNOWN, OCCUPIED = 1, 2, 3
FREE_TO, UNKNOWN_TO = 0.498, 0.502
RUN = 8
NEIGHBOURS = [(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)]


class Leaf(NamedTuple):
    """A block that is not divided: its corner and side in pixels, sum and count of its valid grey values."""

    row: int
    col: int
    side: int
    sum: int
    count: int  # type: ignore[assignment]

    @property
    def op(self) -> float:
        """The mean v of a leaf that has valid pixels."""
        # Reading: one division in double precision, of integers that are exact in it, so 13107/65535 is 0.2.
        return self.sum / (65535 * self.count)


# 0. Grey levels


def intensity(values: ArrayLike) -> Floats:
    """One band of intensity, (rows, cols), from one band or from red, green and blue."""
    bands: Floats = np.asarray(values).astype(np.float64)
    if bands.ndim == 2:
        return bands
    if len(bands) == 1:
        return intensity(bands[0])
    red, green, blue = bands
    # Reading: each product is rounded to double precision, and the sum is evaluated from left to right.
    return np.asarray(0.2126 * red + 0.7152 * green + 0.0722 * blue)


def grey(
    values: ArrayLike,
    valid: Bool,
    low: float,
    high: float,
    lows: Sequence[float] = (),
    edges: Sequence[float] = (),
) -> Grey:
    """Grey levels 0..65535 of values stretched from low..high; 0 where invalid.

    `lows` are low ends of ranges, `edges` those whose own value belongs to what is below them.
    """
    # Reading: the description gives no v for low = high (a constant raster), so that is not supported.
    assert low < high
    x = np.where(valid, intensity(values), low)
    v = (x - low) / (high - low)
    v = np.minimum(np.maximum(v, 0.0), 1.0)
    g = np.floor(65535 * v + 0.5).astype(np.int64)
    # Reading: ends are closed for values. A pixel whose grey was rounded to the other side of an end than its
    # value gets the next grey, on the right side.
    decided = g.copy()
    of_greys = np.arange(65536) / 65535
    ends = [(end, True) for end in lows] + [(end, False) for end in edges]
    for end, is_low in ends:
        if not 0 < end < 1:
            continue
        first = int(np.searchsorted(of_greys, end, "left" if is_low else "right"))  # above the end
        bound = low + end * (high - low)
        if np.asarray(values).dtype.kind in "iu":
            bound = round(bound, 6)
        elif np.asarray(values).dtype == np.float32:
            bound = float(np.float32(bound))
        is_above = x >= bound if is_low else x > bound
        decided[(g == first) & ~is_above] = first - 1
        decided[(g == first - 1) & is_above] = first
    return np.where(valid, decided, 0).astype(np.uint16)


# 1. Texture


def texture(grey: Grey, valid: Bool) -> tuple[Ints, Ints, Bool]:
    """LBP code, contrast and whether it is counted, for every pixel; the first two are 0 where it is not."""
    rows, cols = grey.shape
    codes, contrast = np.zeros((2, rows, cols), np.int64)
    counted = np.zeros((rows, cols), bool)
    if rows < 3 or cols < 3:
        return codes, contrast, counted
    inner = slice(1, -1), slice(1, -1)
    centre = grey[inner].astype(np.int64)
    code, n, hi, lo = np.zeros((4, *centre.shape), np.int64)
    complete = valid[inner].copy()
    for bit, (down, right) in enumerate(NEIGHBOURS):
        shifted = slice(1 + down, rows - 1 + down), slice(1 + right, cols - 1 + right)
        q = grey[shifted].astype(np.int64)
        complete &= valid[shifted]
        above = q >= centre
        code += np.where(above, 1 << bit, 0)
        n += above
        hi += np.where(above, q, 0)
        lo += np.where(above, 0, q)
    m = 8 - n
    both = (n > 0) & (m > 0)
    quotient = (hi * m - lo * n) // np.where(both, n * m, 1)
    codes[inner] = np.where(complete, code, 0)
    contrast[inner] = np.where(complete & both, quotient, 0)
    counted[inner] = complete
    return codes, contrast, counted


def contrast_bin_edges(contrast: Ints, counted: Bool) -> Ints:
    """The seven edges between the eight bins of contrast."""
    ordered = np.sort(contrast[counted])
    N = len(ordered)
    if N == 0:
        return np.zeros(7, np.int64)
    ranks = [-(-k * N // 8) for k in range(1, 8)]
    return np.array([ordered[rank - 1] for rank in ranks], np.int64)


def bins(contrast: Ints, edges: Ints) -> Ints:
    """The number of edges strictly below each contrast."""
    return sum(((edge < contrast).astype(np.int64) for edge in edges), np.zeros(contrast.shape, np.int64))


# 2. Hierarchical division


def xlogx(f: Floats) -> float:
    """Sum of f ln f, where 0 ln 0 = 0."""
    some = f[f > 0]
    return float(np.sum(some * np.log(some)))


def g_statistic(one: Ints, other: Ints) -> float:
    """The log-likelihood ratio G of two histograms of counts."""
    f_s, f_m = one.astype(np.float64), other.astype(np.float64)
    N_s, N_m = float(f_s.sum()), float(f_m.sum())
    N = N_s + N_m
    totals = N_s * math.log(N_s) + N_m * math.log(N_m)
    G = 2 * (xlogx(f_s) + xlogx(f_m) - totals - xlogx(f_s + f_m) + N * math.log(N))
    return 0.0 if G < 1e-9 * N else G


class PaddedImage:
    """Grey, symbols and masks of a raster, padded to whole blocks."""

    def __init__(self, grey: Grey, valid: Bool) -> None:
        codes, contrast, counted = texture(grey, valid)
        rows, cols = grey.shape
        padding = (0, -rows % BLOCK), (0, -cols % BLOCK)
        symbols = 8 * codes + bins(contrast, contrast_bin_edges(contrast, counted))
        self.symbols = np.pad(symbols, padding)
        self.counted = np.pad(counted, padding)
        self.grey = np.pad(np.where(valid, grey, 0).astype(np.int64), padding)
        self.valid = np.pad(valid, padding)

    def corners(self, side: int) -> Iterator[tuple[int, int]]:
        rows, cols = self.valid.shape
        return ((row, col) for row in range(0, rows, side) for col in range(0, cols, side))

    def leaf(self, row: int, col: int, side: int) -> Leaf:
        window = slice(row, row + side), slice(col, col + side)
        return Leaf(row, col, side, int(self.grey[window].sum()), int(self.valid[window].sum()))

    def histogram(self, row: int, col: int, side: int) -> Ints:
        window = slice(row, row + side), slice(col, col + side)
        return np.bincount(self.symbols[window][self.counted[window]], minlength=2048)

    def ratio(self, row: int, col: int, side: int) -> float:
        """R of a block; 0 if it is uniform or fewer than two of its children have counted pixels."""
        histograms = [self.histogram(*child) for child in children(row, col, side)]
        pairs = combinations([h for h in histograms if h.sum() > 0], 2)
        G = [g_statistic(one, other) for one, other in pairs]
        if not G or max(G) == 0:
            return 0.0
        return math.inf if min(G) == 0 else max(G) / min(G)

    def step(self, row: int, col: int, side: int) -> float:
        """The largest difference between the means of a block's children."""
        # Reading: this test uses the children with valid pixels; fewer than two with *counted* pixels end the
        # texture test, not this one. Means and their difference are in double precision.
        leaves = [self.leaf(*child) for child in children(row, col, side)]
        means = [leaf.op for leaf in leaves if leaf.count > 0]
        return max(means) - min(means) if means else 0.0


def children(row: int, col: int, side: int) -> list[tuple[int, int, int]]:
    """The four quarters of a block, as (row, col, side)."""
    half = side // 2
    return [(row + down, col + right, half) for down in (0, half) for right in (0, half)]


def divide(grey: Grey, valid: Bool, X: float = 1.2, tau: float | None = None) -> list[Leaf]:
    """Leaves of the hierarchical division; without an intensity test (the paper's method) if tau is None."""
    image = PaddedImage(grey, valid)
    leaves = []
    pending = [(row, col, BLOCK) for row, col in image.corners(BLOCK)]
    while pending:
        block = pending.pop()
        if block[2] > CELL and is_divided(image, block, X, tau):
            pending.extend(children(*block))
        else:
            leaves.append(image.leaf(*block))
    return sorted(leaves)


def is_divided(image: PaddedImage, block: tuple[int, int, int], X: float, tau: float | None) -> bool:
    """Whether the texture of a block, or with tau its intensity, differs between its children."""
    return image.ratio(*block) > X or (tau is not None and image.step(*block) > tau)


def ratios(grey: Grey, valid: Bool) -> dict[tuple[int, int, int], float]:
    """R of every block of side 64, 32 and 16, by (row, col, side)."""
    image = PaddedImage(grey, valid)
    blocks = [(row, col, side) for side in (64, 32, 16) for row, col in image.corners(side)]
    return {block: image.ratio(*block) for block in blocks}


# 3. Segment creation


def classify_cells(leaves: list[Leaf], shape: tuple[int, int], kind: Callable[[float], int]) -> Ints:
    """The kind of every 8 x 8 cell, from the OP of its leaf; 0 where the leaf has no valid pixels."""
    rows, cols = (-(-size // BLOCK) * BLOCK // CELL for size in shape)
    cells = np.zeros((rows, cols), np.int64)
    for leaf in leaves:
        row, col, side = leaf.row // CELL, leaf.col // CELL, leaf.side // CELL
        cells[row : row + side, col : col + side] = kind(leaf.op) if leaf.count else 0
    return cells


def pixels(cells: Ints, valid: Bool) -> Ints:
    """Cells upsampled to the valid pixels of a raster; 0 elsewhere."""
    rows, cols = valid.shape
    complete = np.repeat(np.repeat(cells, CELL, axis=0), CELL, axis=1)[:rows, :cols]
    return np.where(valid, complete, 0)


def in_range(leaves: list[Leaf], shape: tuple[int, int], valid: Bool, lo: float, hi: float) -> Bool:
    """Valid pixels of the leaves whose OP is in [lo, hi]."""
    return pixels(classify_cells(leaves, shape, lambda op: int(lo <= op <= hi)), valid) > 0


def connected(classes: Ints) -> Ints:
    """4-connected components of equal class, numbered in raster order from 1; 0 where the class is 0."""
    rows, cols = classes.shape
    kind = classes.tolist()
    label = [[0] * cols for _ in range(rows)]
    last = 0
    for row in range(rows):
        for col in range(cols):
            if kind[row][col] == 0 or label[row][col] != 0:
                continue
            last += 1
            label[row][col] = last
            edge = [(row, col)]
            while edge:
                r, c = edge.pop()
                for y, x in ((r - 1, c), (r + 1, c), (r, c - 1), (r, c + 1)):
                    if 0 <= y < rows and 0 <= x < cols and kind[y][x] == kind[r][c] and label[y][x] == 0:
                        label[y][x] = last
                        edge.append((y, x))
    return np.array(label, np.int64).reshape(rows, cols)


def by_size(segments: Ints) -> Labels:
    """Labels 1..n of numbered segments: most pixels first, ties in raster order of the first pixel."""
    numbers, first, size = np.unique(segments, return_index=True, return_counts=True)
    order = sorted((-s, f, number) for number, f, s in zip(numbers, first, size, strict=True) if number)
    labels = np.zeros(segments.shape, np.uint32)
    for label, (_, _, number) in enumerate(order, 1):
        labels[segments == number] = label
    return labels


def components(mask: Bool) -> Labels:
    """4-connected components of a mask, labelled by size."""
    return by_size(connected(mask.astype(np.int64)))


def extract(
    values: ArrayLike,
    valid: Bool,
    low: float,
    high: float,
    lo: float,
    hi: float,
    X: float = 1.2,
    tau: float | None = None,
    refine: str = "scan",
    connect: str = "leaves",
    decided: bool = True,
) -> Labels:
    """Labels of the regions whose intensity is in [lo, hi].

    Reading: without refinement, leaves connect ("leaves that share an edge form one region"), so invalid
    pixels never split a leaf; only refined regions are components of pixels. `connect="pixels"` is the other
    interpretation: components of pixels in both cases. They differ only where pixels are invalid. With
    `decided`, values decide on which side of an end a grey lies.
    """
    g = grey(values, valid, low, high, *(([lo], [hi]) if decided else ()))
    leaves = divide(g, valid, X, tau)
    if refine == "none" and connect == "leaves":
        cells = classify_cells(leaves, g.shape, lambda op: int(lo <= op <= hi))
        return by_size(pixels(connected(cells), valid))
    mask = in_range(leaves, g.shape, valid, lo, hi)
    return components(mask if refine == "none" else refine_scan(mask, g, valid, lo, hi))


# 4. Refinement


def scans(shape: tuple[int, int]) -> Iterator[Iterator[list[tuple[int, int]]]]:
    """The four scans in order, each as lines of pixels (row, col) in visiting order."""
    rows, cols = shape
    yield ([(row, col) for col in reversed(range(cols))] for row in range(rows))  # right to left
    yield ([(row, col) for col in range(cols)] for row in range(rows))  # left to right
    yield ([(row, col) for row in reversed(range(rows))] for col in range(cols))  # bottom to top
    yield ([(row, col) for row in range(rows)] for col in range(cols))  # top to bottom


def refine_scan(mask: Bool, grey: Grey, valid: Bool, lo: float, hi: float) -> Bool:
    """Regions after four scans that shrink and four that grow, pixel by pixel as described."""
    # Reading: "outside" means valid and in no region. A run is a sequence of adjacent changes in one line of
    # one scan; the ninth pixel does not change, so it does not cause further changes either.
    inside, is_valid = mask.tolist(), valid.tolist()
    in_interval = ((lo <= grey / 65535) & (grey / 65535 <= hi)).tolist()

    def leaves(before: tuple[int, int], now: tuple[int, int]) -> bool:
        (r, c), (row, col) = before, now
        was_outside = is_valid[r][c] and not inside[r][c]
        return was_outside and is_valid[row][col] and inside[row][col] and not in_interval[row][col]

    def joins(before: tuple[int, int], now: tuple[int, int]) -> bool:
        (r, c), (row, col) = before, now
        return inside[r][c] and not inside[row][col] and is_valid[row][col] and in_interval[row][col]

    for changes in (leaves, joins):
        for lines in scans(mask.shape):
            for line in lines:
                run = 0
                for before, now in pairwise(line):
                    if run < RUN and changes(before, now):
                        inside[now[0]][now[1]] = changes is joins
                        run += 1
                    else:
                        run = 0
    return np.array(inside, bool).reshape(mask.shape)


# Views of an image whose rows, from first to last, are visited in turn by each of the four scans.
TURNS: list[Callable[[Bool], Bool]] = [lambda a: a[:, ::-1].T, lambda a: a.T, lambda a: a[::-1], lambda a: a]


def refine_scan_by_lines(mask: Bool, grey: Grey, valid: Bool, lo: float, hi: float) -> Bool:
    """An equivalent of `refine_scan`: all lines of a scan advance together."""
    v = grey / 65535
    fits = valid & (v >= lo) & (v <= hi)
    misfits = valid & ~fits
    inside = mask & valid
    outside = valid & ~inside
    for spreading, target, candidates in ((outside, inside, misfits), (inside, outside, fits)):
        for turn in TURNS:
            source, remaining, allowed = turn(spreading), turn(target), turn(candidates)
            run = np.zeros(source.shape[1], int)
            for k in range(1, len(source)):
                change = source[k - 1] & remaining[k] & allowed[k] & (run < RUN)
                source[k] |= change
                remaining[k] &= ~change
                run = np.where(change, run + 1, 0)
    return inside


# States and levels


def state_of(v: float) -> int:
    """FREE, UNKNOWN or OCCUPIED, from an occupancy in 0..1."""
    return FREE if v <= FREE_TO else UNKNOWN if v <= UNKNOWN_TO else OCCUPIED


def refine_states(states: Ints, grey: Grey) -> Ints:
    """States of pixels (0 where invalid) after compaction, and then the scans of free against occupied."""
    # Reading: the stop after 8 pixels applies to ranges only, so a run of compaction is unbounded.
    state = states.tolist()
    states_of_greys = {g: state_of(g / 65535) for g in np.unique(grey).tolist()}
    own = [[states_of_greys[g] for g in line] for line in grey.tolist()]
    for lines in scans(states.shape):
        for line in lines:
            compact(line, state, own)
    for lines in scans(states.shape):
        for line in lines:
            settle(line, state, own)
    return np.array(state, np.int64).reshape(states.shape)


def compact(line: list[tuple[int, int]], state: list[list[int]], own: list[list[int]]) -> None:
    """Pixels whose own value is unknown become unknown after an unknown pixel."""
    for (r, c), (row, col) in pairwise(line):
        if state[r][c] == UNKNOWN and state[row][col] in (FREE, OCCUPIED) and own[row][col] == UNKNOWN:
            state[row][col] = UNKNOWN


def settle(line: list[tuple[int, int]], state: list[list[int]], own: list[list[int]]) -> None:
    """Adjacent free and occupied pixels: the first of three that is not half decides."""
    k = 1
    while k < len(line):
        A = state[line[k - 1][0]][line[k - 1][1]]
        B = state[line[k][0]][line[k][1]]
        end = k + 1
        if A != B and {A, B} == {FREE, OCCUPIED}:
            votes = []
            for row, col in line[k : k + 3]:
                if state[row][col] != B:
                    break
                votes.append(own[row][col])
                if own[row][col] != UNKNOWN:
                    break
            if votes[-1] == A:
                end = k + len(votes)
                for row, col in line[k:end]:
                    state[row][col] = A
        k = end


def states(
    values: ArrayLike,
    valid: Bool,
    low: float = 0.0,
    high: float = 1.0,
    X: float = 1.2,
    tau: float | None = None,
    refine: bool = True,
) -> tuple[Ints, Labels]:
    """State of every pixel (0 where invalid), and labels: all free, all unknown, each occupied segment."""
    g = grey(values, valid, low, high, edges=(FREE_TO, UNKNOWN_TO))
    state, occupied = states_of_leaves(divide(g, valid, X, tau), g, valid, refine)
    segments = np.where(state == OCCUPIED, occupied + 2, state)  # 1 free, 2 unknown, 3... occupied
    return state, by_size(segments)


def states_of_leaves(leaves: list[Leaf], grey: Grey, valid: Bool, refine: bool) -> tuple[Ints, Ints]:
    """State of every pixel (0 where invalid), and the occupied segments in raster order; 0 for none."""
    cells = classify_cells(leaves, grey.shape, state_of)
    state = pixels(cells, valid)
    if not refine:
        return state, pixels(connected((cells == OCCUPIED).astype(np.int64)), valid)
    state = refine_states(state, grey)
    return state, connected((state == OCCUPIED).astype(np.int64))


def level_edges(P: float) -> list[float]:
    """Edges of the levels of width P, from 0 to at least 1."""
    n = math.ceil(1 / P - 1e-9)
    return [round(k * P, 12) for k in range(n + 1)]


def level_of(v: float, edges: list[float]) -> int:
    """The level, from 0, whose interval (low, high] contains v; level 0 also contains 0."""
    # Reading: where rounding leaves the last edge slightly below 1, values above it are in the last level.
    last = len(edges) - 2
    return next((k for k in range(last) if v <= edges[k + 1]), last)


def levels(
    values: ArrayLike,
    valid: Bool,
    low: float,
    high: float,
    P: float,
    X: float = 1.2,
    tau: float | None = None,
) -> tuple[Ints, Labels]:
    """Level of every pixel (-1 where invalid), and labels of segments: adjacent leaves of one level."""
    g = grey(values, valid, low, high, edges=level_edges(P))
    return levels_of_leaves(divide(g, valid, X, tau), valid, P)


def levels_of_leaves(leaves: list[Leaf], valid: Bool, P: float) -> tuple[Ints, Labels]:
    """Level of every pixel (-1 where invalid), and labels of segments."""
    # Reading: levels are not refined, and leaves connect.
    edges = level_edges(P)
    cells = classify_cells(leaves, valid.shape, lambda op: level_of(op, edges) + 1)
    return pixels(cells, valid) - 1, by_size(pixels(connected(cells), valid))


# Random rasters


def random_raster(seed: int) -> tuple[NDArray[np.generic], Bool, float, float]:
    """A raster that depends only on the seed: values (rows, cols), valid, and low and high of a stretch."""
    rng = np.random.default_rng(seed)
    rows, cols = (int(rng.integers(1, 10 if rng.random() < 0.1 else 201)) for _ in range(2))
    field = FIELDS[seed % len(FIELDS)](rng, rows, cols)
    if rng.random() < 0.5:
        other = FIELDS[int(rng.integers(len(FIELDS)))](rng, rows, cols)
        field = np.where(blobs(rng, rows, cols) > 0.5, field, other)
    if rng.random() < 0.5:
        field = field + rng.normal(0, rng.choice([0.003, 0.02, 0.1]), field.shape)
    valid = random_valid(rng, rows, cols)
    values = quantised(rng, np.clip(field, 0, 1))
    if values.dtype.kind == "f" and rng.random() < 0.7:
        values[~valid] = np.nan
    return values, valid, *random_stretch(rng, values, valid)


def random_choices(seed: int) -> tuple[float, float, float, float | None]:
    """lo, hi, X and tau for a random raster."""
    rng = np.random.default_rng([seed, 1])
    lo, hi = sorted(np.round(rng.random(2), int(rng.integers(1, 4))).tolist())
    lo, hi = [(lo, hi), (0.0, hi), (lo, 1.0), (lo, lo + 0.1)][int(rng.integers(4))]
    X = float(rng.choice([1.03, 1.2, 1.2, 1.5, 3.0]))
    tau = [None, None, 0.0173, 0.05, 0.21][int(rng.integers(5))]
    return lo, max(hi, lo + 0.01), X, tau


def constant(rng: np.random.Generator, rows: int, cols: int) -> Floats:
    return np.full((rows, cols), rng.choice([0.0, 0.2, 0.498, 0.5, 0.502, 1.0]))


def noise(rng: np.random.Generator, rows: int, cols: int) -> Floats:
    return rng.random((rows, cols))


def gradient(rng: np.random.Generator, rows: int, cols: int) -> Floats:
    down, right = rng.random(2)
    row, col = np.indices((rows, cols))
    return np.asarray((down * row / rows + right * col / cols) / (down + right))


def stripes(rng: np.random.Generator, rows: int, cols: int) -> Floats:
    row, col = np.indices((rows, cols))
    along = (row, col, row + col)[rng.integers(3)]
    one, other = rng.random(2)
    return np.asarray(np.where(along // rng.integers(1, 20) % 2, one, other))


def checkers(rng: np.random.Generator, rows: int, cols: int) -> Floats:
    side = rng.choice([1, 2, 3, 8, 11, 16, 32, 37])
    row, col = np.indices((rows, cols)) // side
    one, other = rng.random(2)
    return np.asarray(np.where((row + col) % 2, one, other))


def patches(rng: np.random.Generator, rows: int, cols: int) -> Floats:
    """Rectangles on a uniform background, like buildings or occupied cells."""
    field = np.full((rows, cols), rng.choice([0.0, 0.3, 0.5]))
    for _ in range(rng.integers(1, 12)):
        row, col = rng.integers(rows), rng.integers(cols)
        height, width = rng.integers(1, 60, 2)
        field[row : row + height, col : col + width] = rng.choice([0.0, 0.498, 0.5, 0.503, 0.9, rng.random()])
    return field


def blobs(rng: np.random.Generator, rows: int, cols: int) -> Floats:
    """Smooth hills: noise on a coarse grid, interpolated linearly."""
    coarse = rng.random((rows // 16 + 2, cols // 16 + 2))
    row, col = (np.arange(size) / 16 for size in (rows, cols))
    r, c = row.astype(int), col.astype(int)
    down, right = (row - r)[:, None], (col - c)[None, :]
    top = coarse[np.ix_(r, c)] * (1 - right) + coarse[np.ix_(r, c + 1)] * right
    bottom = coarse[np.ix_(r + 1, c)] * (1 - right) + coarse[np.ix_(r + 1, c + 1)] * right
    return np.asarray(top * (1 - down) + bottom * down)


FIELDS = (blobs, patches, noise, stripes, checkers, gradient, constant)


def random_valid(rng: np.random.Generator, rows: int, cols: int) -> Bool:
    """A mask: all pixels, or all but a frame, a patch, speckle, half of them, or nearly everything."""
    valid = np.ones((rows, cols), bool)
    pattern = rng.integers(9)
    if pattern == 1:
        width = rng.integers(1, 30)
        valid[:width] = valid[:, :width] = False
    elif pattern == 2:
        row, col = rng.integers(rows), rng.integers(cols)
        valid[row : row + 50, col : col + 40] = False
    elif pattern in (3, 4):
        valid = rng.random((rows, cols)) > rng.choice([0.001, 0.02, 0.3, 0.99])
    elif pattern == 5:
        valid = np.subtract(*np.indices((rows, cols))) > rng.integers(-100, 100)
    elif pattern == 6:
        valid = blobs(rng, rows, cols) > 0.4
    return valid


def quantised(rng: np.random.Generator, field: Floats) -> NDArray[np.generic]:
    """A field in 0..1 converted to one of the dtypes of rasters."""
    kind = rng.integers(6)
    if kind <= 1:
        return np.round(field * 255).astype(np.uint8)
    if kind == 2:
        return np.round(field * 65535).astype(np.uint16)
    if kind == 3:
        return np.round(field * 3000 - 500).astype(np.int16)
    return (field * 40 - 7).astype(np.float32) if kind == 4 else field.copy()


def random_stretch(rng: np.random.Generator, values: NDArray[np.generic], valid: Bool) -> tuple[float, float]:
    """The range of the dtype, or one that clips a little; low < high."""
    some = values[valid].astype(np.float64)
    if values.dtype.kind == "u" and rng.random() < 0.7:
        return 0.0, 256.0**values.itemsize - 1
    if some.size and some.max() > some.min():
        low, high = np.percentile(some, rng.choice([0, 2, 10]) * np.array([1, -1]) + np.array([0, 100]))
        if low < high:
            return float(low), float(high)
    return 0.0, 1.0
