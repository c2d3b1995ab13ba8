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
from uavseg.segmentation.noise import grown, noise_of_cells
from uavseg.segmentation.specks import drop_specks

STEPS = 16  # of the descent: each looks one pixel farther
_WEIGHT = 0.9  # w over the standard deviation of the noise
_STEP = 0.125  # 1 over the largest eigenvalue of the problem
_EDGE = 8  # columns on both sides of a line that hold nothing


def denoised(
    inside: NDArray[np.uint8],
    unsettled: NDArray[np.uint8],
    valid: NDArray[np.uint8],
    grey: NDArray[np.uint16],
    matching: NDArray[np.uint8],
    low: float,
    high: float,
) -> NDArray[np.uint8]:
    """Decide the pixels of unsettled cells again, and of the cells around them, by v without its noise.

    Where all pixels of a cell and of those around it are on one side, they stay there.

    Parameters
    ----------
    inside : (M, N) uint8 array
        1 where a pixel belongs to a region; it is refined in place. M and N are multiples of 8.
    unsettled : (M / 8, N / 8) uint8 array
        Not 0 where a cell's pixels are to be decided one by one.
    valid : (M, N) uint8 array
    grey : (M, N) uint16 array, 0 where not valid
    matching : (M, N) uint8 array
        1 where a valid pixel's own v lies in the range.
    low, high : float
        The range of v.

    Returns
    -------
    inside : (M, N) uint8 array, the same array
    """
    active = grown((unsettled > 0).view(np.uint8), 1)
    mixed = np.zeros_like(active)
    _follow(matching, valid, active, inside, mixed)
    active &= grown(mixed, 1)
    if not active.any():
        return inside
    runs, first = _runs(active)
    lines = np.zeros((6, STEPS + 2, inside.shape[1] + 2 * _EDGE), np.float32)
    primal = np.empty((STEPS + 1, 2, lines.shape[2]), np.float32)
    scratch = np.empty((3, lines.shape[2]), np.float32)
    noise = noise_of_cells(grey, valid, active)
    weights = (np.maximum(_WEIGHT * noise, 1) * active).astype(np.float32)
    _descend(grey, valid, weights, runs, first, _momenta(), lines, primal, scratch, low, high, inside)
    drop_specks(inside, valid, runs, first)
    return inside


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


@kernel("void(u1[:,::1], u1[:,::1], u1[:,::1], u1[:,::1], u1[:,::1])")
def _follow(matching, valid, active, inside, mixed):  # type: ignore[no-untyped-def]
    """Decide the pixels of active cells by their own v, and tell which cells have pixels on both sides."""
    for r in range(inside.shape[0]):
        for cell in range(active.shape[1]):
            if active[r // 8, cell]:
                some = np.uint8(0)
                others = np.uint8(0)
                for c in range(8 * cell, 8 * cell + 8):
                    inside[r, c] = matching[r, c]
                    some |= matching[r, c]
                    others |= valid[r, c] & (matching[r, c] ^ np.uint8(1))
                mixed[r // 8, cell] |= some | (others << np.uint8(1))
    for row in range(mixed.shape[0]):
        for cell in range(mixed.shape[1]):
            mixed[row, cell] = mixed[row, cell] == 3


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
def moved(q, u, u_next, limit_next, result):  # type: ignore[no-untyped-def]
    """q up the gradient of u; nothing flows where a pixel's limit is 0."""
    nothing = np.float32(0)
    for c in range(np.uintp(u.shape[0])):
        flow = u_next[c] - u[c] if limit_next[c] > nothing else nothing
        result[c] = q[c] + np.float32(_STEP) * flow


@inlined
def shortened(x, y, limit, result):  # type: ignore[no-untyped-def]
    """The factor that makes (x, y) no longer than its limit."""
    for c in range(np.uintp(x.shape[0])):
        norm = np.float32(math.sqrt(x[c] * x[c] + y[c] * y[c]))
        result[c] = limit[c] / max(max(norm, limit[c]), np.float32(1))


@inlined
def stepped(x, scale, momentum, p, q):  # type: ignore[no-untyped-def]
    """p = x scaled, and q on from there in the direction from the p before."""
    for c in range(np.uintp(x.shape[0])):
        value = x[c] * scale[c]
        q[c] = value + momentum * (value - p[c])
        p[c] = value


@inlined
def ascended(u, u_next, u_below, limit, limit_next, limit_below, momentum, px, py, qx, qy, x, y, scale):  # type: ignore[no-untyped-def]
    """One step of the dual along a line: p is projected to |p| <= limit, and q goes on beyond it.

    (Loops of few arrays are vectorised.)
    """
    moved(qx, u, u_next, limit_next, x)
    moved(qy, u, u_below, limit_below, y)
    shortened(x, y, limit, scale)
    stepped(x, scale, momentum, px, qx)
    stepped(y, scale, momentum, py, qy)


@inlined
def decided(u, valid, row, begin, low, high, inside):  # type: ignore[no-untyped-def]
    """Whether v without its noise lies in the range."""
    for c in range(u.shape[0]):
        v = np.float64(u[c]) / 65535.0
        inside[row, begin + c] = np.uint8(low <= v) & np.uint8(v <= high) & valid[row, begin + c]


@kernel(
    "void(u2[:,::1], u1[:,::1], f4[:,::1], i8[:,::1], i8[::1], f4[::1], f4[:,:,::1], f4[:,:,::1], f4[:,::1],"
    " f8, f8, u1[:,::1])"
)
def _descend(grey, valid, weights, runs, first, momenta, lines, primal, scratch, low, high, inside):  # type: ignore[no-untyped-def]
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
                        scratch[0, b:e],
                        scratch[1, b:e],
                        scratch[2, b:e],
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
