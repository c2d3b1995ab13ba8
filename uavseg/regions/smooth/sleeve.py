"""Portals: between the two pixels of every unit edge of a boundary, and the straight pieces through them.

A portal is a little less than the line between the centres of the two pixels that a unit edge parts. A line
that goes through the portals of a stretch of boundary one after the other parts the same pixels, and stays
within half a pixel of their edges; the portals of different stretches have no point in common. Places
are whole numbers here, 256 to a pixel, relative to the first corner of the chain.
"""

from uavseg._jit import inlined

UNIT = 256  # steps to a pixel
HALF = 112  # steps from the middle of a portal to its ends: `elastic.REACH`
SLACK = 8  # steps that a straight piece may pass beside the chain, along a portal
_FURTHEST = 4096  # edges that are looked at for the end of a straight piece


@inlined
def crossings(base_x, base_y, n, x, y, offsets):  # type: ignore[no-untyped-def]
    """Where a chain crosses the portals of its n edges: steps to the left of the middle of each."""
    for e in range(n):
        dx = base_x[e + 1] - base_x[e]
        dy = base_y[e + 1] - base_y[e]
        middle_x = 0.5 * (base_x[e] + base_x[e + 1])
        middle_y = 0.5 * (base_y[e] + base_y[e + 1])
        before = (x[e] - middle_x) * dx + (y[e] - middle_y) * dy
        after = (x[e + 1] - middle_x) * dx + (y[e + 1] - middle_y) * dy
        share = before / (before - after)
        across_x = x[e] + share * (x[e + 1] - x[e]) - middle_x
        across_y = y[e] + share * (y[e + 1] - y[e]) - middle_y
        offsets[e] = UNIT * (across_x * dy - across_y * dx)


@inlined
def place_points(base_x, base_y, n, cyclic, offsets, px, py, steps):  # type: ignore[no-untyped-def]
    """The points on the portals, to a step; gives the place of the last point.

    An open chain begins and ends with its two corners; the last point of a cyclic one is its first.
    """
    lead = 0 if cyclic else 1
    for e in range(n):
        step = min(max(int((offsets[e] + HALF) + 0.5) - HALF, -HALF), HALF)
        steps[e + lead] = step
        px[e + lead] = int(UNIT // 2 * (base_x[e] + base_x[e + 1])) + step * int(base_y[e + 1] - base_y[e])
        py[e + lead] = int(UNIT // 2 * (base_y[e] + base_y[e + 1])) - step * int(base_x[e + 1] - base_x[e])
    if cyclic:
        px[n] = px[0]
        py[n] = py[0]
        return n
    px[0] = py[0] = 0
    px[n + 1] = int(UNIT * base_x[n])
    py[n + 1] = int(UNIT * base_y[n])
    return n + 1


@inlined
def turn(ax, ay, bx, by):  # type: ignore[no-untyped-def]
    """Above 0 where b lies to the right of a, as one sees the picture."""
    return ax * by - ay * bx


@inlined
def straighten(base_x, base_y, cyclic, px, py, steps, last, kept):  # type: ignore[no-untyped-def]
    """Fewer points: from each the furthest that a straight piece through all portals between reaches.

    The piece passes no portal further than SLACK from the point on it (a sleeve, as of Zhao and Saalfeld
    1997). Gives how many points are kept; their places are in `kept`, 0 and the last among them.
    """
    lead = 0 if cyclic else 1
    kept[0] = 0
    many = 1
    here = 0
    while here < last:
        best = here + 1
        at = here + 1
        left_x = left_y = right_x = right_y = 0
        while at < last and at - here < _FURTHEST:
            dx = int(base_x[at - lead + 1] - base_x[at - lead])
            dy = int(base_y[at - lead + 1] - base_y[at - lead])
            out = min(steps[at] + SLACK, HALF) - steps[at]
            back = max(steps[at] - SLACK, -HALF) - steps[at]
            lx = px[at] - px[here] + out * dy
            ly = py[at] - py[here] - out * dx
            rx = px[at] - px[here] + back * dy
            ry = py[at] - py[here] - back * dx
            if turn(lx, ly, rx, ry) <= 0:
                break  # the portal is seen from behind
            if at == here + 1 or turn(left_x, left_y, lx, ly) > 0:
                left_x = lx
                left_y = ly
            if at == here + 1 or turn(rx, ry, right_x, right_y) > 0:
                right_x = rx
                right_y = ry
            if turn(left_x, left_y, right_x, right_y) < 0:
                break
            at += 1
            x = px[at] - px[here]
            y = py[at] - py[here]
            if turn(left_x, left_y, x, y) >= 0 and turn(x, y, right_x, right_y) >= 0:
                best = at
        kept[many] = best
        many += 1
        here = best
    return many


@inlined
def doubled_steps(px, py, kept, many):  # type: ignore[no-untyped-def]
    """Twice the signed area between the points that are kept and the line from the last to the first."""
    before = kept[many - 1]
    doubled = 0
    for k in range(many):
        doubled += px[before] * py[kept[k]] - py[before] * px[kept[k]]
        before = kept[k]
    return doubled


@inlined
def area_slope(base_x, base_y, n, cyclic, px, py, last):  # type: ignore[no-untyped-def]
    """By how much twice the area grows where all points move one step to the left on their portals."""
    lead = 0 if cyclic else 1
    slope = 0
    for e in range(n):
        at = e + lead
        before = at - 1 if at > 0 else last - 1
        along_x = px[at + 1] - px[before]
        along_y = py[at + 1] - py[before]
        slope += along_y * int(base_y[e + 1] - base_y[e]) + along_x * int(base_x[e + 1] - base_x[e])
    return slope
