"""Boundaries to the pixel by total variation: pixels that their block leaves open are decided denoised.

v is denoised as Rudin, Osher and Fatemi do (Physica D 60, 1992): u minimises sum (u - v)^2 / 2 + w |grad u|.
What lies above a threshold of u is then the set that balances its distance from v with the length of its
boundary (Chambolle, J. Math. Imaging Vis. 20, 2004). The dual problem is solved by a fixed number of steps of
Beck and Teboulle's fast gradient projection (IEEE Trans. Image Process. 18, 2009), each of which looks one
pixel farther; so what happens to a pixel depends on its neighbourhood alone. The weight w follows the noise
around, by Immerkaer's estimate (Comput. Vis. Image Underst. 64, 1996).
"""

import math

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.segmentation.blockmap import BlockMap, mean_of

STEPS = 25  # of the descent: each looks one pixel farther
SPECK = 9  # pixels: smaller pieces and holes are nobody's
_POOL = 2  # cells on every side over which noise is averaged
_WEIGHT = 0.9  # w over the standard deviation of the noise
_STEP = 0.125  # 1 over the largest eigenvalue of the problem
_MARGIN = 2.0  # how much farther the mean of a part of a cell may lie away than those of cells do
_EDGE = 8  # columns on both sides of a line that hold nothing


def unsettled(blocks: BlockMap, inside: NDArray[np.uint8], low: float, high: float) -> NDArray[np.uint8]:
    """Cells whose pixels may lie on both sides of an end of the range.

    A cell is settled where its leaf and the leaves of the eight cells around are on the same side, and the
    means of these nine cells lie on that side too, farther from the end than `_MARGIN` times what they lie
    apart: a road of 3 pixels moves the mean of a cell by a third of how far it stands out.

    Parameters
    ----------
    blocks : BlockMap
    inside : (8 B, 8 C) uint8 array
        1 where a cell's leaf is in range.
    low, high : float
        The range of v.

    Returns
    -------
    unsettled : (8 B, 8 C) uint8 array
    """
    found = np.zeros_like(inside)
    ends = np.array([end for end in (low, high) if 0 < end < 1])  # nothing lies beyond 0 and 1
    _unsettled(blocks.sums, blocks.counts, inside, low, high, ends, _MARGIN, found)
    return found


def denoised(
    inside: NDArray[np.uint8],
    unsettled: NDArray[np.uint8],
    valid: NDArray[np.uint8],
    grey: NDArray[np.uint16],
    low: float,
    high: float,
) -> NDArray[np.uint8]:
    """Decide the pixels of unsettled cells again, and of the cells around them, by v without its noise.

    Parameters
    ----------
    inside : (M, N) uint8 array
        1 where a pixel belongs to a region; it is refined in place. M and N are multiples of 8.
    unsettled : (M / 8, N / 8) uint8 array
        Not 0 where a cell's pixels are to be decided one by one.
    valid : (M, N) uint8 array
    grey : (M, N) uint16 array, 0 where not valid
    low, high : float
        The range of v.

    Returns
    -------
    inside : (M, N) uint8 array, the same array
    """
    active = _grown((unsettled > 0).view(np.uint8), 1)
    if not active.any():
        return inside
    runs, first = _runs(active)
    lines = np.zeros((6, STEPS + 2, inside.shape[1] + 2 * _EDGE), np.float32)
    primal = np.empty((STEPS + 1, 2, lines.shape[2]), np.float32)
    weights = _weights(grey, valid, active)
    _descend(grey, valid, weights, runs, first, _momenta(), lines, primal, low, high, inside)
    _drop_specks(inside.copy(), valid, runs, first, np.empty((SPECK, 2), np.int64), inside)
    return inside


def _grown(cells: NDArray[np.uint8], by: int) -> NDArray[np.uint8]:
    """The largest value within `by` cells, in a square."""
    for axis in (0, 1):
        around = np.pad(cells, [(by, by) if k == axis else (0, 0) for k in (0, 1)])
        cells = np.max(
            [around.take(range(k, k + cells.shape[axis]), axis) for k in range(2 * by + 1)], axis=0
        )
    return cells


def _runs(active: NDArray[np.uint8]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First and last pixel column, (k, 2), of runs of active cells; and where each row of cells begins."""
    edges = np.diff(np.pad(active, [(0, 0), (1, 1)]).astype(np.int8), axis=1)
    rows, begins = np.nonzero(edges == 1)
    ends = np.nonzero(edges == -1)[1]
    first = np.searchsorted(rows, np.arange(len(active) + 1))
    return np.stack([begins, ends], axis=1) * 8, first


def _momenta() -> NDArray[np.float32]:
    """How far each step goes on in the direction of the one before."""
    t, momenta = 1.0, []
    for _ in range(STEPS):
        following = (1 + math.sqrt(1 + 4 * t * t)) / 2
        momenta.append((t - 1) / following)
        t = following
    return np.array(momenta, np.float32)


def _weights(
    grey: NDArray[np.uint16], valid: NDArray[np.uint8], active: NDArray[np.uint8]
) -> NDArray[np.float32]:
    """w of each active cell, in grey; 0 elsewhere.

    The noise of pixels and that of means of 4 x 4 pixels, as it would be in pixels that know nothing of each
    other: the larger counts, for grain and crowns of trees are seen in the second alone.
    """
    wanted = _grown(active, _POOL)
    noise = np.full((2, *active.shape), -1.0)
    _respond(grey, valid, wanted, noise[0])
    means, known = np.zeros((2, grey.shape[0] // 4, grey.shape[1] // 4), np.uint16)
    whole = known.astype(np.uint8)
    _mean_of_fours(grey, valid, means, whole)
    _respond(means, whole, wanted, noise[1])
    noise[1] *= 4
    weights = np.zeros(active.shape, np.float32)
    _weigh(noise, active, _WEIGHT * math.sqrt(math.pi / 2) / 6, np.empty((2 * _POOL + 1) ** 2), weights)
    return weights


@kernel("void(u2[:,::1], u1[:,::1], u2[:,::1], u1[:,::1])")
def _mean_of_fours(grey, valid, means, whole):  # type: ignore[no-untyped-def]
    for row in range(means.shape[0]):
        for col in range(means.shape[1]):
            total = np.uint32(8)
            every = np.uint8(1)
            for r in range(4 * row, 4 * row + 4):
                for c in range(4 * col, 4 * col + 4):
                    total += np.uint32(grey[r, c])
                    every &= valid[r, c]
            means[row, col] = total // np.uint32(16)
            whole[row, col] = every


@inlined
def response(grey, r, c):  # type: ignore[no-untyped-def]
    """Of Immerkaer's operator: second differences across of second differences down."""
    left = np.int64(grey[r - 1, c - 1]) - 2 * np.int64(grey[r, c - 1]) + np.int64(grey[r + 1, c - 1])
    here = np.int64(grey[r - 1, c]) - 2 * np.int64(grey[r, c]) + np.int64(grey[r + 1, c])
    right = np.int64(grey[r - 1, c + 1]) - 2 * np.int64(grey[r, c + 1]) + np.int64(grey[r + 1, c + 1])
    return left - 2 * here + right


@inlined
def is_whole(valid, r, c):  # type: ignore[no-untyped-def]
    """1 where a pixel and all eight around it are valid."""
    whole = np.uint8(1)
    for down in range(r - 1, r + 2):
        whole &= valid[down, c - 1] & valid[down, c] & valid[down, c + 1]
    return whole


@kernel("void(u2[:,::1], u1[:,::1], u1[:,::1], f8[:,::1])")
def _respond(grey, valid, wanted, mean):  # type: ignore[no-untyped-def]
    """The mean |response| over each wanted cell, where all that it looks at is valid."""
    side = grey.shape[0] // wanted.shape[0]
    for row in range(wanted.shape[0]):
        for col in range(wanted.shape[1]):
            total = np.int64(0)
            number = np.int64(0)
            if wanted[row, col]:
                for r in range(max(side * row, 1), min(side * row + side, grey.shape[0] - 1)):
                    for c in range(max(side * col, 1), min(side * col + side, grey.shape[1] - 1)):
                        whole = np.int64(is_whole(valid, r, c))
                        total += abs(response(grey, r, c)) * whole
                        number += whole
            if number > 0:
                mean[row, col] = total / number


@inlined
def median_around(values, row, col, some):  # type: ignore[no-untyped-def]
    """The upper median of what is known of the cells around; 0 if nothing is."""
    many = 0
    for r in range(max(row - _POOL, 0), min(row + _POOL + 1, values.shape[0])):
        for c in range(max(col - _POOL, 0), min(col + _POOL + 1, values.shape[1])):
            value = values[r, c]
            if value >= 0.0:
                k = many
                while k > 0 and some[k - 1] > value:
                    some[k] = some[k - 1]
                    k -= 1
                some[k] = value
                many += 1
    return some[many // 2] if many else 0.0


@kernel("void(f8[:,:,::1], u1[:,::1], f8, f8[::1], f4[:,::1])")
def _weigh(noise, active, factor, some, weights):  # type: ignore[no-untyped-def]
    for row in range(active.shape[0]):
        for col in range(active.shape[1]):
            if active[row, col]:
                fine = median_around(noise[0], row, col, some)
                coarse = median_around(noise[1], row, col, some)
                weights[row, col] = max(factor * max(fine, coarse), 1.0)


@inlined
def entered(grey, valid, weights, row, begin, end, image, limit):  # type: ignore[no-untyped-def]
    """Take the pixels begin..end of a row into a line."""
    for c in range(np.uintp(begin), np.uintp(end)):
        image[c + np.uintp(_EDGE)] = np.float32(grey[row, c])
        limit[c + np.uintp(_EDGE)] = weights[row // 8, c // np.uintp(8)] * np.float32(valid[row, c])


@inlined
def divergence(qx, qx_before, qy, qy_above, image, u):  # type: ignore[no-untyped-def]
    """u = image + div q."""
    for c in range(np.uintp(u.shape[0])):
        u[c] = image[c] + (((qx[c] - qx_before[c]) + qy[c]) - qy_above[c])


@inlined
def ascended(u, u_next, u_below, limit, limit_next, limit_below, momentum, px, py, qx, qy):  # type: ignore[no-untyped-def]
    """One step of the dual along a line: p is projected to |p| <= limit, and q goes on beyond it."""
    nothing = np.float32(0)
    for c in range(np.uintp(u.shape[0])):
        right = u_next[c] - u[c] if limit_next[c] > nothing else nothing
        down = u_below[c] - u[c] if limit_below[c] > nothing else nothing
        x = qx[c] + np.float32(_STEP) * right
        y = qy[c] + np.float32(_STEP) * down
        norm = np.float32(math.sqrt(x * x + y * y))
        scale = limit[c] / max(max(norm, limit[c]), np.float32(1))
        x *= scale
        y *= scale
        qx[c] = x + momentum * (x - px[c])
        qy[c] = y + momentum * (y - py[c])
        px[c] = x
        py[c] = y


@inlined
def decided(u, valid, row, begin, low, high, inside):  # type: ignore[no-untyped-def]
    """Whether v without its noise lies in the range."""
    for c in range(u.shape[0]):
        v = np.float64(u[c]) / 65535.0
        inside[row, begin + c] = np.uint8(low <= v) & np.uint8(v <= high) & valid[row, begin + c]


@kernel(
    "void(u2[:,::1], u1[:,::1], f4[:,::1], i8[:,::1], i8[::1], f4[::1], f4[:,:,::1], f4[:,:,::1],"
    " f8, f8, u1[:,::1])"
)
def _descend(grey, valid, weights, runs, first, momenta, lines, primal, low, high, inside):  # type: ignore[no-untyped-def]
    # All steps go over the image at once, each a line behind the one before: so a few lines are held of what
    # each pixel has. A line comes in, takes one step after the other, is decided and makes room for another.
    rows = grey.shape[0]
    steps = momenta.shape[0]
    room = lines.shape[1]
    image, limit, px, py, qx, qy = lines[0], lines[1], lines[2], lines[3], lines[4], lines[5]
    for time in range(rows + steps):
        if time < rows:
            here = time % room
            for k in range(first[time // 8], first[time // 8 + 1]):
                entered(grey, valid, weights, time, runs[k, 0], runs[k, 1], image[here], limit[here])
        for step in range(steps):
            row = time - 1 - step
            if row < -1 or row >= rows:
                continue
            here = row % room
            below = (row + 1) % room
            if row + 1 < rows:
                for k in range(first[(row + 1) // 8], first[(row + 1) // 8 + 1]):
                    b = runs[k, 0] + _EDGE
                    e = runs[k, 1] + _EDGE
                    divergence(
                        qx[below, b:e],
                        qx[below, b - 1 : e - 1],
                        qy[below, b:e],
                        qy[here, b:e],
                        image[below, b:e],
                        primal[step, (row + 1) % 2, b:e],
                    )
            if row >= 0:
                for k in range(first[row // 8], first[row // 8 + 1]):
                    b = runs[k, 0] + _EDGE
                    e = runs[k, 1] + _EDGE
                    u = primal[step, row % 2]
                    ascended(
                        u[b:e],
                        u[b + 1 : e + 1],
                        primal[step, (row + 1) % 2, b:e],
                        limit[here, b:e],
                        limit[here, b + 1 : e + 1],
                        limit[below, b:e],
                        momenta[step],
                        px[here, b:e],
                        py[here, b:e],
                        qx[here, b:e],
                        qy[here, b:e],
                    )
        row = time - steps
        if row < 0:
            continue
        here = row % room
        above = (row + room - 1) % room
        u = primal[steps, 0]
        for k in range(first[row // 8], first[row // 8 + 1]):
            b = runs[k, 0] + _EDGE
            e = runs[k, 1] + _EDGE
            divergence(
                px[here, b:e],
                px[here, b - 1 : e - 1],
                py[here, b:e],
                py[above, b:e],
                image[here, b:e],
                u[b:e],
            )
            decided(u[b:e], valid, row, runs[k, 0], low, high, inside)
        if row > 0:  # nobody looks at the line above any more
            for k in range(first[(row - 1) // 8], first[(row - 1) // 8 + 1]):
                lines[:, above, runs[k, 0] + _EDGE : runs[k, 1] + _EDGE] = 0


@inlined
def is_even(inside, valid, r, c):  # type: ignore[no-untyped-def]
    """Whether the nine pixels around one are valid and on one side: then its piece is no speck."""
    rows, cols = inside.shape
    if r == 0 or c == 0 or r == rows - 1 or c == cols - 1:
        return False
    same = True
    for down in range(r - 1, r + 2):
        for right in range(c - 1, c + 2):
            same &= valid[down, right] != 0 and inside[down, right] == inside[r, c]
    return same


@inlined
def is_listed(listed, many, r, c):  # type: ignore[no-untyped-def]
    """Whether a pixel is among the first `many`."""
    found = False
    for k in range(many):
        found |= listed[k, 0] == r and listed[k, 1] == c
    return found


@inlined
def is_speck(inside, valid, r, c, listed):  # type: ignore[no-untyped-def]
    """Whether a pixel's piece is smaller than the list is long, and touches the other side."""
    rows, cols = inside.shape
    own = inside[r, c]
    listed[0, 0] = r
    listed[0, 1] = c
    many = 1
    touches = False
    k = 0
    while k < many:
        for down in range(-1, 2):
            for right in range(-1, 2):
                y = listed[k, 0] + down
                x = listed[k, 1] + right
                if y < 0 or x < 0 or y >= rows or x >= cols or not valid[y, x]:
                    continue
                if inside[y, x] != own:
                    touches = True
                elif (own == 0 or down == 0 or right == 0) and not is_listed(listed, many, y, x):
                    if many == listed.shape[0] - 1:
                        return False
                    listed[many, 0] = y
                    listed[many, 1] = x
                    many += 1
        k += 1
    return touches


@kernel("void(u1[:,::1], u1[:,::1], i8[:,::1], i8[::1], i8[:,::1], u1[:,::1])")
def _drop_specks(before, valid, runs, first, listed, inside):  # type: ignore[no-untyped-def]
    for r in range(before.shape[0]):
        for k in range(first[r // 8], first[r // 8 + 1]):
            for c in range(runs[k, 0], runs[k, 1]):
                if valid[r, c] and not is_even(before, valid, r, c) and is_speck(before, valid, r, c, listed):
                    inside[r, c] = np.uint8(1) - before[r, c]


@kernel("void(u4[:,::1], u1[:,::1], u1[:,::1], f8, f8, f8[::1], f8, u1[:,::1])")
def _unsettled(sums, counts, inside, low, high, ends, margin, found):  # type: ignore[no-untyped-def]
    rows, cols = counts.shape
    for row in range(rows):
        for col in range(cols):
            own = mean_of(sums, counts, row, col, 1)
            if own < 0.0:
                continue
            differs = (low <= own and own <= high) != (inside[row, col] != 0)
            least = own
            most = own
            for r in range(max(row - 1, 0), min(row + 2, rows)):
                for c in range(max(col - 1, 0), min(col + 2, cols)):
                    mean = mean_of(sums, counts, r, c, 1)
                    if mean >= 0.0:
                        least = min(least, mean)
                        most = max(most, mean)
                        differs |= inside[r, c] != inside[row, col]
            spread = margin * (most - least)
            for k in range(ends.shape[0]):
                differs |= least - spread <= ends[k] and ends[k] <= most + spread
            found[row, col] = differs
