"""Routes over all regions, split into flights from home that fit their limits (vehicle routing).

The order of the route is kept, and the places where it is split are the best ones: a shortest path over the
flights that fit (the split of C. Prins, A simple and effective evolutionary algorithm for the vehicle routing
problem, Computers and Operations Research 31, 2004).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError
from uavseg.flight.avoid.free_space import FreeSpace
from uavseg.flight.mission.track import Track, leg_lengths
from uavseg.flight.order.tour import Stops, short_tour

Seconds = Callable[[Floats], Floats]
Costs = Callable[[Track], tuple[Floats, Floats]]

MAX_PIECES = 50_000
STRAIGHT_LENGTHS = 64
ROUNDING_S = 10.0  # a piece that is flown alone starts and ends at rest
MAX_REGIONS = 4000  # far more than any vehicle stores


@dataclass(frozen=True, slots=True, eq=False)
class RegionRoute:
    """Runs of lines, or single points, in the order of flight, and the transits between them."""

    home: Floats  # (2,)
    pieces: tuple[Track, ...]  # n runs of lines
    transits: tuple[Track, ...]  # n - 1, from the end of each piece to the start of the next
    space: FreeSpace  # of transits

    def flight(self, first: int, last: int) -> Track:
        """Return the track over pieces first to last, from home, and back home where not straight."""
        inner = [track for k in range(first, last) for track in (self.pieces[k], self.transits[k])]
        back = self._transit(self.pieces[last].xy[-1], self.home)
        tracks = [self._transit(self.home, self.pieces[first].xy[0]), *inner, self.pieces[last]]
        if len(back.xy) > 2:
            tracks.append(back)
        return without_short_legs(Track.joined(tracks).part_from(1), self.space)

    def home_lengths(self) -> tuple[Floats, Floats]:
        """Return the lengths in metres from home to the start of each piece, and from its end home."""
        starts = np.array([piece.xy[0] for piece in self.pieces])
        ends = np.array([piece.xy[-1] for piece in self.pieces])
        lengths = self.space.lengths_from(self.home, np.concatenate([starts, ends]))
        return lengths[: len(starts)], lengths[len(starts) :]

    def _transit(self, start: Floats, end: Floats) -> Track:
        return Track.transit(self.space.path(start.tolist(), end.tolist()))


def short_route(candidates: Sequence[Sequence[Track]], home: Floats, space: FreeSpace) -> RegionRoute:
    """Return a short route from home over one track of each region, in either direction, and home again.

    A MissionError says that there are too many regions, or that one cannot be reached.
    """
    tracks = _ordered(candidates, home, space)
    runs = [track.line_runs() for track in tracks]
    starts = np.array([track.xy[parts[0][0]] for track, parts in zip(tracks, runs, strict=True)])
    ends = np.array([track.xy[parts[-1][1]] for track, parts in zip(tracks, runs, strict=True)])
    paths = space.each_path(ends[:-1], starts[1:])
    pieces: list[Track] = []
    transits: list[Track] = []
    for number, track in enumerate(tracks):
        if number:
            transits.append(Track.transit(paths[number - 1]))
        for k, (first, last) in enumerate(runs[number]):
            if k:
                transits.append(track.part(runs[number][k - 1][1], first))
            pieces.append(track.part(first, last))
    return RegionRoute(home=home, pieces=tuple(pieces), transits=tuple(transits), space=space)


def fastest(tracks: Sequence[Track], home: Floats, space: FreeSpace, limits: "FlightLimits") -> RegionRoute:
    """Return the route over one region, on the track and in the direction of the least time, with the return.

    The vehicle stops where the return begins.
    """
    both = [direction for track in tracks for direction in (track, track.reversed())]
    routes = [short_route([[track]], home, space) for track in both]
    flights = [route.flight(0, len(route.pieces) - 1) for route in routes]
    outward = [Track.transit(np.array([home, flight.xy[0]])) for flight in flights]
    seconds = [limits.of(Track.joined(pair))[0].sum() for pair in zip(outward, flights, strict=True)]
    back_m = np.hypot(*(np.array([flight.xy[-1] for flight in flights]) - home).T)
    return routes[int(np.argmin(seconds + _return_seconds(back_m, limits)))]


def check_order(count: int) -> None:
    """Refuse more regions than can be ordered (MissionError)."""
    if count > MAX_REGIONS:
        raise MissionError(
            f"there are {count:,} regions, and at most {MAX_REGIONS:,} are ordered; choose fewer"
        )


def _ordered(candidates: Sequence[Sequence[Track]], home: Floats, space: FreeSpace) -> list[Track]:
    """Choose one track for each region, in an order that makes a short tour from home and back."""
    check_order(len(candidates))
    ends = np.concatenate([[track.xy[[0, -1]] for track in tracks] for tracks in candidates])
    points, index = np.unique(np.concatenate([home[None], ends.reshape(-1, 2)]), axis=0, return_inverse=True)
    pairs = index.ravel()[1:].reshape(-1, 2)
    options, costs = [], []
    first = 0
    for tracks in candidates:
        forward = pairs[first : first + len(tracks)]
        first += len(tracks)
        options.append(np.concatenate([forward, forward[:, ::-1]]))
        costs.append(np.array([track.length_m for track in tracks] * 2))
    start = int(index.ravel()[0])
    lengths = space.paths(points).lengths
    tour = short_tour(Stops.of(options, costs), lengths, start, start)
    chosen = [(candidates[region], option) for region, option in tour]
    return [
        tracks[option] if option < len(tracks) else tracks[option - len(tracks)].reversed()
        for tracks, option in chosen
    ]


MIN_LEG_M = 0.7
"""A little more than the shortest leg that Litchi flies, 0.6 m."""


def without_short_legs(track: Track, space: FreeSpace) -> Track:
    """Return a track whose transits have no leg shorter than 0.7 m, where free space allows that.

    A corner of a transit too near to another one is left out if the leg past it is free. Else the line that
    ends beside it ends that much earlier.
    """
    track, k = replace(track, xy=track.xy.copy()), 1
    while k < len(track.xy) - 1:
        if not _is_of_transit(track, k) or leg_lengths(track.xy[k - 1 : k + 2]).min() >= MIN_LEG_M:
            k += 1
        elif space.sees(track.xy[k - 1, None], track.xy[k + 1, None])[0]:
            straight = Track.transit(track.xy[[k - 1, k + 1]])
            track = Track.joined([track.part(0, k - 1), straight, track.part_from(k + 1)])
            k = max(k - 1, 1)  # the corner before has another leg now
        else:
            _shorten_line(track, k, space)
            k += 1
    return track


def _is_of_transit(track: Track, k: int) -> bool:
    """Return whether a corner lies between legs of transits, without hold or photograph."""
    return not (track.is_line[k - 1 : k + 1].any() or track.shots[k] or track.hold_s[k])


def _shorten_line(track: Track, k: int, space: FreeSpace) -> None:
    """Move the ends of lines that are too near to a corner back along them, in place, where that is free."""
    for end, inward in ((k - 1, -1), (k + 1, 1)):
        leg, other = (end - 1 if inward < 0 else end), end + inward
        if not 0 <= other < len(track.xy) or not track.is_line[leg]:
            continue
        corner, along = track.xy[end].copy(), track.xy[other] - track.xy[end]
        length_m = float(np.hypot(*along))
        if leg_lengths(track.xy[[end, k]])[0] >= MIN_LEG_M or length_m < 2 * MIN_LEG_M:
            continue
        track.xy[end] += along * (MIN_LEG_M / length_m)
        short = leg_lengths(track.xy[[end, k]])[0] < MIN_LEG_M
        if short or not space.sees(track.xy[end, None], track.xy[k, None])[0]:
            track.xy[end] = corner


@dataclass(frozen=True, slots=True)
class FlightLimits:
    """Limits of one flight, and the costs that count against them."""

    seconds: float  # in the air; infinite without a limit
    items: float  # mission items
    fixed_s: float  # of these, for takeoff, landing and settings of each flight
    fixed_items: float
    leg_seconds: Seconds  # time of each leg of a path (n, 2) in metres, level and of one speed: (n - 1,)
    # time of each leg of a track, and its items besides corners; by default `leg_seconds` and 0
    costs: Costs | None = None
    # time of the autopilot's return over a length in metres, where that is more
    return_seconds: Callable[[float], float] | None = None

    def of(self, track: Track) -> tuple[Floats, Floats]:
        """Return the time and further items of each leg of a track."""
        if self.costs is not None:
            return self.costs(track)
        seconds = self.leg_seconds(track.xy)
        return seconds, np.zeros(len(seconds))

    def tighter(self, seconds: float, items: float) -> "FlightLimits":
        """Return limits of shares of the time and of the items."""
        return replace(self, seconds=self.seconds * seconds, items=math.floor(self.items * items))


def split_route(route: RegionRoute, limits: FlightLimits) -> list[Track]:
    """Split a route into flights, each from the first corner after home to the last before it.

    A MissionError says that a part of the route cannot be flown within the limits even alone.
    """
    whole = route.flight(0, len(route.pieces) - 1)
    if _fits(route, whole, limits):
        return [whole]
    route = _divided(route, limits)
    return [route.flight(first, last) for first, last in _cheapest_split(_costs(route, limits), limits)]


def _fits(route: RegionRoute, flight: Track, limits: FlightLimits) -> bool:
    out, back = (Track.transit(np.array([route.home, flight.xy[end]])) for end in (0, -1))
    seconds, items = limits.of(Track.joined([out, flight, back.reversed()]))
    max_items = limits.items - limits.fixed_items
    spent_s = float(seconds.sum()) + limits.fixed_s
    if limits.return_seconds is not None:
        spent_s += max(limits.return_seconds(back.length_m) - float(seconds[-1]), 0.0)
    return spent_s <= limits.seconds and _items(flight) + items[:-1].sum() <= max_items


def _items(track: Track) -> int:
    """Return the maximum number of items of a track: waypoints, photographs, turns of the camera."""
    triggers = np.count_nonzero(np.diff(track.trigger_m, prepend=0.0, append=0.0))
    turned = np.count_nonzero(np.diff(np.isfinite(track.look_at[:, 0]), prepend=False, append=False))
    hovering = np.count_nonzero(track.shots & (track.hold_s > 0))  # one item each, others have two
    return int(len(track.xy) + triggers + 2 * np.count_nonzero(track.shots) - hovering + turned)


@dataclass(frozen=True, slots=True)
class _Costs:
    """Time and items of each piece, of the transit to the next, and of those from and to home."""

    piece_s: Floats
    piece_items: Floats
    transit_s: Floats
    transit_items: Floats
    out_s: Floats
    back_s: Floats
    out_items: Floats
    back_items: Floats


def _costs(route: RegionRoute, limits: FlightLimits) -> _Costs:
    seconds, items = _joined_costs(route, limits)
    out_m, back_m = route.home_lengths()
    held_s = np.array([piece.hold_s[0] for piece in route.pieces])  # else a part of the transit before
    items_per_m = _items_per_m(route, items)
    corners = np.array([max(len(transit.xy) - 2, 0) for transit in route.transits], np.float64)
    return _Costs(
        piece_s=seconds[::2],
        piece_items=np.array([_items(piece) for piece in route.pieces], np.float64) + items[::2],
        transit_s=seconds[1::2],
        transit_items=corners + items[1::2],
        out_s=_straight_seconds(out_m, limits) + held_s,
        back_s=_return_seconds(back_m, limits),
        out_items=items_per_m * out_m,
        back_items=items_per_m * back_m,
    )


def _items_per_m(route: RegionRoute, items: Floats) -> float:
    """Return further items by length; their number on transits from and to home is estimated from it."""
    length_m = sum(track.length_m for track in (*route.pieces, *route.transits))
    return float(items.sum()) / length_m if length_m > 0 else 0.0


def _joined_costs(route: RegionRoute, limits: FlightLimits) -> tuple[Floats, Floats]:
    """Return time and further items of pieces and transits in turns, flown one after another."""
    tracks = [track for pair in zip(route.pieces, route.transits, strict=False) for track in pair]
    tracks.append(route.pieces[-1])
    ends = np.cumsum([0, *(len(track.is_line) for track in tracks)])
    sums = [np.concatenate([[0.0], np.cumsum(one)]) for one in limits.of(Track.joined(tracks))]
    seconds, items = (spent[ends[1:]] - spent[ends[:-1]] for spent in sums)
    return seconds, items


def _straight_seconds(length_m: Floats, limits: FlightLimits) -> Floats:
    """Return the time of straight legs of some lengths that start and end at rest, interpolated."""
    known = np.concatenate([[0.0], np.geomspace(0.1, max(float(length_m.max()), 1.0), STRAIGHT_LENGTHS)])
    seconds = [limits.leg_seconds(np.array([[0.0, 0.0], [length, 0.0]])).sum() for length in known.tolist()]
    interpolated: Floats = np.interp(length_m, known, seconds)
    return interpolated


def _return_seconds(length_m: Floats, limits: FlightLimits) -> Floats:
    """Return the time home over some lengths, by waypoints or by a return, whichever is longer."""
    straight = _straight_seconds(length_m, limits)
    if limits.return_seconds is None:
        return straight
    known = np.linspace(0, max(float(length_m.max()), 1.0), STRAIGHT_LENGTHS)
    seconds = [limits.return_seconds(length) for length in known.tolist()]
    return np.maximum(straight, np.interp(length_m, known, seconds))


def _divided(route: RegionRoute, limits: FlightLimits) -> RegionRoute:
    """Return the route with pieces divided that take longer than a flight, or have more items."""
    reach_m = route.space.lengths_from(route.home, np.concatenate([piece.xy for piece in route.pieces]))
    first = np.cumsum([0, *(len(piece.xy) for piece in route.pieces[:-1])])
    away_m = np.maximum.reduceat(reach_m, first)
    home_s = _straight_seconds(away_m, limits) + _return_seconds(away_m, limits)
    left_s = limits.seconds - limits.fixed_s - home_s
    seconds, items = _joined_costs(route, limits)
    home_items = 2 * _items_per_m(route, items) * away_m
    max_items = limits.items - limits.fixed_items - home_items
    seconds, items = seconds[::2], items[::2]
    fits = seconds <= left_s - ROUNDING_S
    pieces: list[Track] = []
    transits: list[Track] = []
    for k, piece in enumerate(route.pieces):
        small = fits[k] and _items(piece) + items[k] <= max_items[k]
        parts = [piece] if small else _parts(piece, float(left_s[k]), float(max_items[k]), limits)
        if pieces:
            transits.append(route.transits[k - 1])
        transits += [Track.transit(part.xy[:1]) for part in parts[1:]]
        pieces += parts
        if len(pieces) > MAX_PIECES:
            raise MissionError("the mission would have to be cut into too many flights; choose fewer regions")
    return replace(route, pieces=tuple(pieces), transits=tuple(transits))


def _parts(piece: Track, max_s: float, max_items: float, limits: FlightLimits) -> list[Track]:
    """Divide a run of lines at corners and within long lines into runs within a time and items."""
    seconds, items = limits.of(piece)
    if seconds.sum() <= max_s and _items(piece) + items.sum() <= max_items:
        return [piece]
    if max_s <= 0 or max_items < 4:
        _refuse(limits, limits.seconds - max_s)
    lines = [
        line for k in range(len(seconds)) for line in _divided_line(piece.part(k, k + 1), seconds[k], max_s)
    ]
    parts = [lines[0]]
    for line in lines[1:]:
        longer = Track.joined([parts[-1], line])
        seconds, items = limits.of(longer)
        if seconds.sum() <= max_s and _items(longer) + items.sum() <= max_items:
            parts[-1] = longer
        else:
            parts.append(line)
    return parts


def _divided_line(line: Track, seconds: float, max_s: float) -> list[Track]:
    """Divide a line into equal parts that each take no longer than a time."""
    count = max(math.ceil(1.3 * seconds / max_s), 1) if seconds > max_s else 1
    if count > MAX_PIECES:
        raise MissionError("the mission would have to be cut into too many flights; choose fewer regions")
    xy = line.xy[0] + np.linspace(0, 1, count + 1)[:, None] * (line.xy[1] - line.xy[0])
    return [line.leg(0, xy[k : k + 2]) for k in range(count)]


def _cheapest_split(costs: _Costs, limits: FlightLimits) -> list[tuple[int, int]]:
    """Return the first and last piece of each flight for the minimum sum of times (dynamic programming)."""
    count = len(costs.piece_s)
    spent = np.concatenate([[0.0], np.cumsum(costs.piece_s + np.append(costs.transit_s, 0.0))])
    items = np.concatenate([[0.0], np.cumsum(costs.piece_items + np.append(costs.transit_items, 0.0))])
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
        carried = end_items - items[first] + costs.out_items[first] + costs.back_items[last]
        fits = (seconds <= limits.seconds) & (carried + limits.fixed_items <= limits.items)
        total = np.where(fits, best[first] + seconds, np.inf)
        choice = int(total.argmin())
        if not fits[-1]:  # else every piece fits into a flight alone, and so there is a split
            _refuse(limits, float(seconds[-1]))
        best[last + 1], start[last + 1] = total[choice], first[choice]
    flights = []
    stop = count
    while stop:
        flights.append((int(start[stop]), stop - 1))
        stop = int(start[stop])
    return flights[::-1]


def _refuse(limits: FlightLimits, needed_s: float) -> None:
    raise MissionError(
        f"a part of the mission needs more than {needed_s / 60:.1f} min, with takeoff, the way there and "
        "back, and landing, and a flight has "
        f"{limits.seconds / 60:.1f} min and {limits.items:.0f} items; give more --endurance or --max-items, "
        "less --reserve, or a home that is nearer"
    )
