"""Division of a route into flights that each start and end at home and fit their limits.

The order of the route is kept, and the places where it is cut are the best ones: a shortest path over the
flights that fit (the split of C. Prins, A simple and effective evolutionary algorithm for the vehicle routing
problem, Computers and Operations Research 31, 2004).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import MissionError
from uavseg.flight.route import Route
from uavseg.flight.track import Track

Floats = NDArray[np.float64]
Seconds = Callable[[Floats], Floats]

MAX_PIECES = 50_000
STRAIGHT_LENGTHS = 64
ROUNDING_S = 10.0  # a piece that is flown alone starts and ends at rest


@dataclass(frozen=True, slots=True)
class FlightLimits:
    """What one flight may take.

    Parameters
    ----------
    seconds : float
        In the air; infinite without a limit.
    items : float
        Mission items.
    fixed_s, fixed_items : float
        Of these, what each flight takes besides its way: takeoff, landing, settings.
    leg_seconds : function
        Time of each leg of a path (n, 2) in metres, (n - 1,).
    """

    seconds: float
    items: float
    fixed_s: float
    fixed_items: float
    leg_seconds: Seconds

    def tighter(self, seconds: float, items: float) -> "FlightLimits":
        """The same with shares of the time and of the items."""
        return replace(self, seconds=self.seconds * seconds, items=math.floor(self.items * items))


def split_route(route: Route, limits: FlightLimits) -> list[Track]:
    """The flights over a route, each from the first corner after home to the last before it.

    Parameters
    ----------
    route : Route
    limits : FlightLimits

    Raises
    ------
    MissionError
        If a part of the route cannot be flown within the limits even in a flight of its own.
    """
    whole = route.flight(0, len(route.pieces) - 1)
    if _fits(route, whole, limits):
        return [whole]
    route = _divided(route, limits)
    return [route.flight(first, last) for first, last in _cheapest_cuts(_costs(route, limits), limits)]


def _fits(route: Route, flight: Track, limits: FlightLimits) -> bool:
    path = np.concatenate([route.home[None], flight.xy, route.home[None]])
    seconds = float(limits.leg_seconds(path).sum()) + limits.fixed_s
    return seconds <= limits.seconds and _items(flight) + limits.fixed_items <= limits.items


def _items(track: Track) -> int:
    """Waypoints of a track, and the items that begin and end photographs or turn the camera, at most."""
    triggers = np.count_nonzero(np.diff(np.r_[0.0, track.trigger_m, 0.0]))
    turned = np.count_nonzero(np.diff(np.r_[False, np.isfinite(track.look_at[:, 0]), False].astype(np.int8)))
    return int(len(track.xy) + triggers + 2 * track.shots.sum() + turned)


@dataclass(frozen=True, slots=True)
class _Costs:
    """Time and items of each piece, of the way to the next, and time of the ways from and to home."""

    piece_s: Floats
    piece_items: Floats
    way_s: Floats
    way_items: Floats
    out_s: Floats
    back_s: Floats


def _costs(route: Route, limits: FlightLimits) -> _Costs:
    seconds = _joined_seconds(route, limits)
    out_m, back_m = route.home_lengths()
    return _Costs(
        seconds[::2],
        np.array([_items(piece) for piece in route.pieces], np.float64),
        seconds[1::2],
        np.array([max(len(way.xy) - 2, 0) for way in route.ways], np.float64),
        _straight_seconds(out_m, limits),
        _straight_seconds(back_m, limits),
    )


def _joined_seconds(route: Route, limits: FlightLimits) -> Floats:
    """Time of each piece and of each way, in turns, where all are flown one after another."""
    tracks = [track for pair in zip(route.pieces, route.ways, strict=False) for track in pair]
    tracks.append(route.pieces[-1])
    spent = np.concatenate([[0.0], np.cumsum(limits.leg_seconds(Track.joined(tracks).xy))])
    ends = np.cumsum([0, *(len(track.is_line) for track in tracks)])
    seconds: Floats = spent[ends[1:]] - spent[ends[:-1]]
    return seconds


def _straight_seconds(length_m: Floats, limits: FlightLimits) -> Floats:
    """Time of ways of some lengths that start and end at rest, interpolated."""
    known = np.concatenate([[0.0], np.geomspace(0.1, max(float(length_m.max()), 1.0), STRAIGHT_LENGTHS)])
    seconds = [limits.leg_seconds(np.array([[0.0, 0.0], [length, 0.0]])).sum() for length in known.tolist()]
    found: Floats = np.interp(length_m, known, seconds)
    return found


def _divided(route: Route, limits: FlightLimits) -> Route:
    """The route with pieces cut that take longer than a flight, or have more items."""
    reach_m = route.space.lengths_from(route.home, np.concatenate([piece.xy for piece in route.pieces]))
    first = np.cumsum([0, *(len(piece.xy) for piece in route.pieces[:-1])])
    left_s = (
        limits.seconds - limits.fixed_s - 2 * _straight_seconds(np.maximum.reduceat(reach_m, first), limits)
    )
    most_items = limits.items - limits.fixed_items
    fits = _joined_seconds(route, limits)[::2] <= left_s - ROUNDING_S
    pieces: list[Track] = []
    ways: list[Track] = []
    for k, piece in enumerate(route.pieces):
        small = fits[k] and _items(piece) <= most_items
        parts = [piece] if small else _parts(piece, float(left_s[k]), most_items, limits)
        if pieces:
            ways.append(route.ways[k - 1])
        ways += [Track.of_way(part.xy[:1]) for part in parts[1:]]
        pieces += parts
        if len(pieces) > MAX_PIECES:
            raise MissionError("the mission would have to be cut into too many flights; choose fewer regions")
    return replace(route, pieces=tuple(pieces), ways=tuple(ways))


def _parts(piece: Track, most_s: float, most_items: float, limits: FlightLimits) -> list[Track]:
    """A run of lines as runs that take no longer than a time, cut at corners and within long lines."""
    seconds = limits.leg_seconds(piece.xy)
    if seconds.sum() <= most_s and _items(piece) <= most_items:
        return [piece]
    if most_s <= 0 or most_items < 4:
        _refuse(limits, limits.seconds - most_s)
    lines = [line for k in range(len(seconds)) for line in _cut(piece.part(k, k + 1), seconds[k], most_s)]
    parts, spent = [lines[0]], float(limits.leg_seconds(lines[0].xy).sum())
    for line in lines[1:]:
        longer = Track.joined([parts[-1], line])
        spent = float(limits.leg_seconds(longer.xy).sum())
        if spent <= most_s and _items(longer) <= most_items:
            parts[-1] = longer
        else:
            parts.append(line)
    return parts


def _cut(line: Track, seconds: float, most_s: float) -> list[Track]:
    """A line in equal parts that each take no longer than a time."""
    count = max(math.ceil(1.3 * seconds / most_s), 1) if seconds > most_s else 1
    if count > MAX_PIECES:
        raise MissionError("the mission would have to be cut into too many flights; choose fewer regions")
    xy = line.xy[0] + np.linspace(0, 1, count + 1)[:, None] * (line.xy[1] - line.xy[0])
    return [line.leg(0, xy[k : k + 2]) for k in range(count)]


def _cheapest_cuts(costs: _Costs, limits: FlightLimits) -> list[tuple[int, int]]:
    """First and last piece of each flight, so that the sum of all times is least."""
    count = len(costs.piece_s)
    spent = np.concatenate([[0.0], np.cumsum(costs.piece_s + np.append(costs.way_s, 0.0))])
    items = np.concatenate([[0.0], np.cumsum(costs.piece_items + np.append(costs.way_items, 0.0))])
    best = np.full(count + 1, np.inf)
    best[0] = 0.0
    start = np.zeros(count + 1, np.int64)
    low = 0
    for last in range(count):
        end_s, end_items = spent[last] + costs.piece_s[last], items[last] + costs.piece_items[last]
        while low < last and end_s - spent[low] + limits.fixed_s > limits.seconds:
            low += 1
        first = np.arange(low, last + 1)
        seconds = costs.out_s[first] + end_s - spent[first] + costs.back_s[last] + limits.fixed_s
        fits = (seconds <= limits.seconds) & (end_items - items[first] + limits.fixed_items <= limits.items)
        total = np.where(fits, best[first] + seconds, np.inf)
        choice = int(total.argmin())
        if not fits[-1]:  # else every piece fits into a flight of its own, and so there is a way to cut
            _refuse(limits, float(seconds[-1]))
        best[last + 1], start[last + 1] = total[choice], first[choice]
    cuts = []
    stop = count
    while stop:
        cuts.append((int(start[stop]), stop - 1))
        stop = int(start[stop])
    return cuts[::-1]


def _refuse(limits: FlightLimits, needed_s: float) -> None:
    raise MissionError(
        f"a part of the mission needs more than {needed_s / 60:.1f} min, with takeoff, the way there and "
        "back, and landing, and a flight has "
        f"{limits.seconds / 60:.1f} min and {limits.items:.0f} items; give more --endurance or --max-items, "
        "less --reserve, or a home that is nearer"
    )
