"""Sleeve fitting (Zhao and Saalfeld 1997): arcs replaced by few straight segments through portals.

The portal of a unit edge lies on the line between the centres of the two pixels that the edge separates, a
little shorter at both ends. A line through the portals of an arc, one after the other (as in the funnel
algorithm), separates the same pixels and stays within half a pixel of their edges; the portals of different
arcs have no point in common. Coordinates are integers, 256 to a pixel, relative to the first corner of the
arc.

Zhao, Z.; Saalfeld, A. (1997): Linear-time sleeve-fitting polyline simplification algorithms. AutoCarto 13,
214-223.
"""

from uavseg._jit import inlined

STEPS_PER_PIXEL = 256
MAX_OFFSET = 112  # steps from the middle of a portal to its ends: `MAX_SHIFT` of smooth_outlines
SLEEVE_WIDTH = 8  # steps along a portal by which a segment may miss the arc's point
_MAX_EDGES = 4096  # edges that one segment may replace


@inlined
def portal_offsets(base_x, base_y, n, x, y, offsets):  # type: ignore[no-untyped-def]
    """Compute where a line crosses the portals of an arc: steps to the left of the middle of each."""
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
        offsets[e] = STEPS_PER_PIXEL * (across_x * dy - across_y * dx)


@inlined
def place_points(base_x, base_y, n, cyclic, offsets, px, py, steps):  # type: ignore[no-untyped-def]
    """Round the points on the portals to steps; returns the index of the last point.

    An open arc begins and ends with its two corners; the last point of a cyclic one equals its first.
    """
    lead = 0 if cyclic else 1
    for e in range(n):
        step = min(max(int((offsets[e] + MAX_OFFSET) + 0.5) - MAX_OFFSET, -MAX_OFFSET), MAX_OFFSET)
        steps[e + lead] = step
        px[e + lead] = int(STEPS_PER_PIXEL // 2 * (base_x[e] + base_x[e + 1])) + step * int(
            base_y[e + 1] - base_y[e]
        )
        py[e + lead] = int(STEPS_PER_PIXEL // 2 * (base_y[e] + base_y[e + 1])) - step * int(
            base_x[e + 1] - base_x[e]
        )
    if cyclic:
        px[n] = px[0]
        py[n] = py[0]
        return n
    px[0] = py[0] = 0
    px[n + 1] = int(STEPS_PER_PIXEL * base_x[n])
    py[n + 1] = int(STEPS_PER_PIXEL * base_y[n])
    return n + 1


@inlined
def cross_product(ax, ay, bx, by):  # type: ignore[no-untyped-def]
    """Return the cross product of a and b: above 0 where b points to the right of a in the image."""
    return ax * by - ay * bx


@inlined
def straighten(base_x, base_y, cyclic, px, py, steps, last, kept):  # type: ignore[no-untyped-def]
    """Fit a sleeve greedily: from each point a segment to the furthest point that it reaches.

    A segment passes through all portals between, within SLEEVE_WIDTH of the point on each. Returns the number
    of points that are kept; their indices are written to `kept`, 0 and the last among them.
    """
    lead = 0 if cyclic else 1
    kept[0] = 0
    count = 1
    here = 0
    while here < last:
        best = here + 1
        at = here + 1
        left_x = left_y = right_x = right_y = 0
        while at < last and at - here < _MAX_EDGES:
            dx = int(base_x[at - lead + 1] - base_x[at - lead])
            dy = int(base_y[at - lead + 1] - base_y[at - lead])
            out = min(steps[at] + SLEEVE_WIDTH, MAX_OFFSET) - steps[at]
            back = max(steps[at] - SLEEVE_WIDTH, -MAX_OFFSET) - steps[at]
            lx = px[at] - px[here] + out * dy
            ly = py[at] - py[here] - out * dx
            rx = px[at] - px[here] + back * dy
            ry = py[at] - py[here] - back * dx
            if cross_product(lx, ly, rx, ry) <= 0:
                break  # the segment would pass the portal backwards
            if at == here + 1 or cross_product(left_x, left_y, lx, ly) > 0:
                left_x = lx
                left_y = ly
            if at == here + 1 or cross_product(rx, ry, right_x, right_y) > 0:
                right_x = rx
                right_y = ry
            if cross_product(left_x, left_y, right_x, right_y) < 0:
                break
            at += 1
            x = px[at] - px[here]
            y = py[at] - py[here]
            if cross_product(left_x, left_y, x, y) >= 0 and cross_product(x, y, right_x, right_y) >= 0:
                best = at
        kept[count] = best
        count += 1
        here = best
    return count


@inlined
def doubled_steps(px, py, kept, count):  # type: ignore[no-untyped-def]
    """Return twice the signed area between the kept points and the line from the last to the first."""
    before = kept[count - 1]
    doubled = 0
    for k in range(count):
        doubled += px[before] * py[kept[k]] - py[before] * px[kept[k]]
        before = kept[k]
    return doubled


@inlined
def area_slope(base_x, base_y, n, cyclic, px, py, last):  # type: ignore[no-untyped-def]
    """Return the growth of twice the area if all points move one step to the left on their portals."""
    lead = 0 if cyclic else 1
    slope = 0
    for e in range(n):
        at = e + lead
        before = at - 1 if at > 0 else last - 1
        along_x = px[at + 1] - px[before]
        along_y = py[at + 1] - py[before]
        slope += along_y * int(base_y[e + 1] - base_y[e]) + along_x * int(base_x[e + 1] - base_x[e])
    return slope
