"""Routes over all regions, split into flights from home that fit their limits: the fewest, of like length."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from uavseg.arrays import Floats, Integers
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError
from uavseg.flight.avoid.free_space import FreeSpace
from uavseg.flight.mission.track import Track, leg_lengths
from uavseg.flight.order.division import MAX_REGIONS as MAX_REORDERED, Pieces, order_of_regions
from uavseg.flight.order.tour import Stops, short_tour

Costs = Callable[[Track], tuple[Floats, Floats]]
Ways = Callable[[Floats, Floats, Floats], tuple[Floats, Floats]]

MAX_PIECES = 50_000
ATTEMPTS = 4  # at an order whose flights are more alike
ALIKE = 0.9  # of the longest flight, where the shortest is not made longer
SECONDS_DECIMALS = 6  # so that rounding errors choose nothing
FINENESS = 10  # pieces of each of a number of flights, at least
ROUNDING_S = 10.0  # a piece that is flown alone starts and ends at rest
MAX_REGIONS = 4000  # far more than any vehicle stores


@dataclass(frozen=True, slots=True, eq=False)
class RegionRoute:
    """Runs of lines, or single points, in the order of flight, and the transits between them."""

    home: Floats  # (2,)
    pieces: tuple[Track, ...]  # n runs of lines
    transits: tuple[Track, ...]  # n - 1, from the end of each piece to the start of the next
    space: FreeSpace  # of transits
    region: Integers  # (n,), that of each piece, counted in the order of flight

    def flight(self, first: int, last: int) -> Track:
        """Return the track over pieces first to last, from home, and back home where not straight."""
        inner = [track for k in range(first, last) for track in (self.pieces[k], self.transits[k])]
        back = self._transit(self.pieces[last].xy[-1], self.home)
        tracks = [self._transit(self.home, self.pieces[first].xy[0]), *inner, self.pieces[last]]
        if len(back.xy) > 2:
            tracks.append(back)
        return with_pitch_points(without_short_legs(Track.joined(tracks).part_from(1), self.space))

    def reversed(self) -> "RegionRoute":
        """Return the route from its end to its start."""
        regions = np.arange(int(self.region[-1]) + 1)
        return self.reordered(regions[::-1], np.ones(len(regions), np.int64))

    def reordered(self, order: Integers, turned: Integers) -> "RegionRoute":
        """Return the route over regions in another order, some of them from their end to their start."""
        pieces: list[Track] = []
        transits: list[Track] = []
        for region in order.tolist():
            numbers = np.flatnonzero(self.region == region).tolist()
            inner = [self.pieces[k] for k in numbers]
            between = [self.transits[k] for k in numbers[:-1]]
            if turned[region]:
                inner = [piece.reversed() for piece in inner[::-1]]
                between = [transit.reversed() for transit in between[::-1]]
            if pieces:
                transits.append(self._transit(pieces[-1].xy[-1], inner[0].xy[0]))
            pieces, transits = pieces + inner, transits + between
        counts = np.bincount(self.region)[order]
        region = np.repeat(np.arange(len(order)), counts)
        return replace(self, pieces=tuple(pieces), transits=tuple(transits), region=region)

    def _transit(self, start: Floats, end: Floats) -> Track:
        return Track.transit(self.space.path(start.tolist(), end.tolist()))


def short_route(
    candidates: Sequence[Sequence[Track]],
    home: Floats,
    space: FreeSpace,
    limits: "Sequence[FlightLimits]",
    speed_m_s: float,
) -> RegionRoute:
    """Return a route from home over one track of each region, in either direction, and home again.

    It takes a short time, of which that in the worst wind counts: there are limits for each direction that
    the wind may have. Transits are flown at the speed. A MissionError says that there are too many regions,
    or that one cannot be reached.
    """
    tracks = _ordered(candidates, home, space, limits, speed_m_s)
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
    return RegionRoute(
        home=home,
        pieces=tuple(pieces),
        transits=tuple(transits),
        space=space,
        region=np.repeat(np.arange(len(tracks)), [len(one) for one in runs]),
    )


def fastest(routes: Sequence[RegionRoute], limits: "Sequence[FlightLimits]") -> RegionRoute:
    """Return the route of the least time, with the return, of some that are flown in either direction.

    There are limits for each direction that the wind may have; the longest time of them counts. The vehicle
    stops where the return begins.
    """
    both = [direction for route in routes for direction in (route, route.reversed())]
    flights = [route.flight(0, len(route.pieces) - 1) for route in both]
    home = routes[0].home
    outward = [Track.transit(np.array([home, flight.xy[0]])) for flight in flights]
    whole = [Track.joined(pair) for pair in zip(outward, flights, strict=True)]
    ends = np.array([flight.xy[-1] for flight in flights])
    away_m = np.hypot(*(ends - home).T)
    seconds = [
        [one.costs(track)[0].sum() for track in whole] + one.ways(home, ends, away_m)[1] for one in limits
    ]
    return both[int(np.max(seconds, axis=0).round(SECONDS_DECIMALS).argmin())]


def check_order(count: int) -> None:
    """Refuse more regions than can be ordered (MissionError)."""
    if count > MAX_REGIONS:
        raise MissionError(
            f"there are {count:,} regions, and at most {MAX_REGIONS:,} are ordered; choose fewer"
        )


def _ordered(
    candidates: Sequence[Sequence[Track]],
    home: Floats,
    space: FreeSpace,
    limits: "Sequence[FlightLimits]",
    speed_m_s: float,
) -> list[Track]:
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
        costs.append(np.max([[one.costs(track)[0].sum() for one in limits] for track in tracks] * 2, axis=1))
    start = int(index.ravel()[0])
    lengths = space.paths(points).lengths
    apart_s = lengths / speed_m_s
    ways_s = [np.mean(one.ways(home, points, lengths[start]), axis=0) for one in limits]
    apart_s[start] = apart_s[:, start] = np.max(ways_s, axis=0)  # a tour is flown in either direction
    tour = short_tour(Stops.of(options, costs), apart_s, start, start)
    chosen = [(candidates[region], option) for region, option in tour]
    return [
        tracks[option] if option < len(tracks) else tracks[option - len(tracks)].reversed()
        for tracks, option in chosen
    ]


MIN_LEG_M = 0.7  # a little more than the shortest leg that Litchi flies, 0.6 m


def without_short_legs(track: Track, space: FreeSpace) -> Track:
    """Return a track whose transits have no leg shorter than 0.7 m, where free space allows that.

    A corner of a transit too near to another one is left out if the leg past it is free. Else the line that
    ends beside it ends that much earlier.
    """
    track, k = replace(track, xy=track.xy.copy()), 1
    while k < len(track.xy) - 1:
        on_line_or_stop = track.is_line[k - 1 : k + 1].any() or track.shots[k] or track.hold_s[k]
        if on_line_or_stop or leg_lengths(track.xy[k - 1 : k + 2]).min() >= MIN_LEG_M:
            k += 1
        elif space.sees(track.xy[k - 1, None], track.xy[k + 1, None])[0]:
            straight = Track.transit(track.xy[[k - 1, k + 1]])
            track = Track.joined([track.part(0, k - 1), straight, track.part_from(k + 1)])
            k = max(k - 1, 1)  # the corner before has another leg now
        else:
            _shorten_line(track, k, space)
            k += 1
    return track


PITCH_POINT_M = 5.0


def with_pitch_points(track: Track) -> Track:
    """Add a corner past the last line of each gimbal pitch, where the gimbal turns before the next line.

    A MissionError says that there is no leg between the lines on which it could turn.
    """
    for last, line in reversed(track.pitch_changes):
        start, end = track.xy[[last + 1, min(last + 2, line)]]
        length_m = math.dist(start, end)
        if length_m < 2 * MIN_LEG_M:
            raise MissionError(
                "lines of two gimbal pitches meet, and the gimbal cannot turn there; choose another --angle"
            )
        place = start + (end - start) * min(PITCH_POINT_M / length_m, 0.5)
        turn = Track.transit(np.array([start, place, end]))
        turn.pitch_deg[1] = track.pitch_deg[line]
        track = Track.joined([track.part(0, last + 1), turn, track.part_from(last + 2)])
    return track


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
    items: float  # mission items, or waypoints where these are counted
    fixed_s: float  # of these, for takeoff, landing and settings of each flight
    fixed_items: float
    count: Callable[[Track], int]  # maximum number of items of a track
    costs: Costs  # time of each leg of a track, and its items besides corners
    # time from home (2,) to places (n, 2) and back, from rest to rest, on ways of some lengths (n,)
    ways: Ways
    flights: int | None = None  # so many; by default the fewest

    @property
    def flown_s(self) -> float:
        """Time that is left for the pieces of a flight and the ways."""
        return self.seconds - self.fixed_s

    @property
    def flown_items(self) -> float:
        """Items that are left for them."""
        return self.items - self.fixed_items


def split_route(route: RegionRoute, limits: FlightLimits) -> list[Track]:
    """Split a route into flights, each from the first corner after home to the last before it.

    They are the fewest that are found, or as many as requested, and of those the ones whose longest is
    shortest, to 2 per cent. Where regions in another order need fewer flights, they are flown in it. A
    MissionError says that a part of the route cannot be flown within the limits even alone, or that there
    are more flights than requested.
    """
    whole = route.flight(0, len(route.pieces) - 1)
    if limits.flights in (None, 1) and _fits(route, whole, limits):
        return [whole]
    route = _divided(route, limits)
    route, pieces, count = _with_fewest_flights(route, limits)
    if limits.flights is not None and count > limits.flights:
        raise MissionError(
            f"{limits.flights} flights of {limits.seconds / 60:.1f} min and {limits.items:.0f} items are too "
            f"few; {count} are enough: give --flights {count}, or more --endurance"
        )
    route, cuts = _with_flights_alike(route, pieces, limits, limits.flights or count)
    return [route.flight(first, last) for first, last in cuts]


def _with_fewest_flights(route: RegionRoute, limits: FlightLimits) -> tuple[RegionRoute, Pieces, int]:
    """Return the route in an order that needs few flights, its pieces, and the number of flights."""
    pieces = _pieces(route, limits)
    count = pieces.fewest(limits.flown_s, limits.flown_items)
    if not count:
        _refuse(limits, float((pieces.seconds + pieces.ways_s[0] + pieces.ways_s[3]).max()) + limits.fixed_s)
    while count > (limits.flights or pieces.least_flights(limits.flown_s, limits.flown_items)):
        found = _in_another_order(route, pieces, limits, count - 1, limits.flown_s)
        if found is None:
            break
        route, pieces = found
        count = pieces.fewest(limits.flown_s, limits.flown_items)
    return route, pieces, count


def _with_flights_alike(
    route: RegionRoute, pieces: Pieces, limits: FlightLimits, count: int
) -> tuple[RegionRoute, list[tuple[int, int]]]:
    """Return the route in an order in which so many flights take about as long, and where it is cut."""
    cuts = pieces.alike(count, limits.flown_s, limits.flown_items)
    if len(cuts) < count:
        raise MissionError(f"the mission has too few parts for {count} flights; give --flights {len(cuts)}")
    for _ in range(ATTEMPTS):
        times = pieces.times(cuts)
        if times.min() >= ALIKE * times.max():
            break
        found = _in_another_order(route, pieces, limits, count, float(times.mean() + times.max()) / 2)
        if found is None:
            break
        route, pieces = found
        cuts = pieces.alike(count, limits.flown_s, limits.flown_items)
    return route, cuts


def _in_another_order(
    route: RegionRoute, pieces: Pieces, limits: FlightLimits, count: int, longest_s: float
) -> tuple[RegionRoute, Pieces] | None:
    """Return a route over the regions in an order that so many flights fly within a time, if one is found."""
    if not 0 < route.region[-1] < MAX_REORDERED:
        return None
    first = np.flatnonzero(np.diff(route.region, prepend=-1))
    last = np.append(first[1:], len(route.region)) - 1
    ends = np.array(
        [(route.pieces[a].xy[0], route.pieces[b].xy[-1]) for a, b in zip(first, last, strict=True)]
    )
    away_m = np.hypot(*(np.array([piece.xy[0] for piece in route.pieces]) - route.home).T)
    per_m = float(pieces.ways_s[0].sum()) / max(float(away_m.sum()), 1.0)
    # Between starts (even) and ends (odd) of regions, at the mean speed of ways from home.
    between_s: Floats = route.space.paths(ends.reshape(-1, 2)).lengths * per_m
    found = order_of_regions(pieces, route.region, between_s, count, longest_s, limits.flown_items)
    if found is None:
        return None
    other = route.reordered(*found)
    other_pieces = _pieces(other, limits)
    fits = 0 < other_pieces.fewest(longest_s, limits.flown_items) <= count
    return (other, other_pieces) if fits else None


def _fits(route: RegionRoute, flight: Track, limits: FlightLimits) -> bool:
    out, back = (Track.transit(np.array([route.home, flight.xy[end]])) for end in (0, -1))
    seconds, items = limits.costs(Track.joined([out, flight, back.reversed()]))
    _, back_s = limits.ways(route.home, flight.xy[-1:], np.array([back.length_m]))
    spent_s = float(seconds[:-1].sum() + back_s[0])
    return spent_s <= limits.flown_s and limits.count(flight) + items[:-1].sum() <= limits.flown_items


def items_of(track: Track) -> int:
    """Return the maximum number of items of a track: waypoints, photographs, turns of the camera."""
    triggers = np.count_nonzero(np.diff(track.trigger_m, prepend=0.0, append=0.0))
    turned = np.count_nonzero(np.diff(np.isfinite(track.look_at[:, 0]), prepend=False, append=False))
    hovering = np.count_nonzero(track.shots & (track.hold_s > 0))  # one item each, others have two
    turned += len(track.pitch_changes)
    return int(len(track.xy) + triggers + 2 * np.count_nonzero(track.shots) - hovering + turned)


def _pieces(route: RegionRoute, limits: FlightLimits) -> Pieces:
    """Return time and items of the pieces of a route, of its transits, and of the ways from and to home."""
    tracks = [track for pair in zip(route.pieces, route.transits, strict=False) for track in pair]
    tracks.append(route.pieces[-1])
    last = np.cumsum([0, *(len(track.is_line) for track in tracks)])
    sums = [np.concatenate([[0.0], np.cumsum(one)]) for one in limits.costs(Track.joined(tracks))]
    seconds, items = (spent[last[1:]] - spent[last[:-1]] for spent in sums)
    corners = np.array([max(len(transit.xy) - 2, 0) for transit in route.transits], np.float64)
    ends = np.array([(piece.xy[0], piece.xy[-1]) for piece in route.pieces])
    lengths = route.space.lengths_from(route.home, ends.reshape(-1, 2))
    out_s, back_s = (one.reshape(-1, 2) for one in limits.ways(route.home, ends.reshape(-1, 2), lengths))
    held_s = np.array([(piece.hold_s[0], piece.hold_s[-1]) for piece in route.pieces])
    out_s = out_s + held_s * (1, 0)  # else a part of the transit before
    length_m = sum(track.length_m for track in tracks)
    per_m = float(items.sum()) / length_m if length_m > 0 else 0.0  # items of ways are estimated by length
    ways_items = per_m * lengths.reshape(-1, 2).T
    return Pieces(
        seconds=seconds[::2],
        items=np.array([limits.count(piece) for piece in route.pieces], np.float64) + items[::2],
        transit_s=np.append(seconds[1::2], 0.0),
        transit_items=np.append(corners + items[1::2], 0.0),
        ways_s=np.array([out_s[:, 0], back_s[:, 0], out_s[:, 1], back_s[:, 1]]),
        ways_items=ways_items[[0, 0, 1, 1]],
    )


def _divided(route: RegionRoute, limits: FlightLimits) -> RegionRoute:
    """Return the route with pieces divided that take longer than a flight, or have more items."""
    all_pieces = _pieces(route, limits)
    finest_s = math.inf
    if limits.flights is not None:  # small pieces make flights of like length
        finest_s = float(all_pieces.seconds.sum()) / (FINENESS * limits.flights)
    corners = np.concatenate([piece.xy for piece in route.pieces])
    out_s, back_s = limits.ways(route.home, corners, route.space.lengths_from(route.home, corners))
    first = np.cumsum([0, *(len(piece.xy) for piece in route.pieces[:-1])])
    ways_s = np.maximum.reduceat(out_s, first) + np.maximum.reduceat(back_s, first)
    left_s = limits.flown_s - ways_s
    left_s = np.minimum(left_s - np.minimum(ROUNDING_S, left_s / 2), finest_s)
    max_items = limits.flown_items - all_pieces.ways_items[::2].sum(axis=0)
    fits = (all_pieces.seconds <= left_s) & (all_pieces.items <= max_items)
    fits |= np.array([len(piece.xy) == 1 for piece in route.pieces])
    pieces: list[Track] = []
    transits: list[Track] = []
    counts = []
    for k, piece in enumerate(route.pieces):
        parts = [piece] if fits[k] else _parts(piece, float(left_s[k]), float(max_items[k]), limits)
        if pieces:
            transits.append(route.transits[k - 1])
        transits += [Track.transit(part.xy[:1]) for part in parts[1:]]
        pieces += parts
        counts.append(len(parts))
        if len(pieces) > MAX_PIECES:
            raise MissionError("the mission would have to be cut into too many flights; choose fewer regions")
    region = np.repeat(route.region, counts)
    return replace(route, pieces=tuple(pieces), transits=tuple(transits), region=region)


def _parts(piece: Track, max_s: float, max_items: float, limits: FlightLimits) -> list[Track]:
    """Divide a run of lines at corners and within long lines into runs within a time and items."""
    seconds, items = limits.costs(piece)
    if seconds.sum() <= max_s and limits.count(piece) + items.sum() <= max_items:
        return [piece]
    if max_s <= 0 or max_items < 4:
        _refuse(limits, limits.seconds - max_s)
    lines = [
        line for k in range(len(seconds)) for line in _divided_line(piece.part(k, k + 1), seconds[k], max_s)
    ]
    parts = [lines[0]]
    for line in lines[1:]:
        longer = Track.joined([parts[-1], line])
        seconds, items = limits.costs(longer)
        if seconds.sum() <= max_s and limits.count(longer) + items.sum() <= max_items:
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


def _refuse(limits: FlightLimits, needed_s: float) -> None:
    raise MissionError(
        f"a part of the mission needs more than {needed_s / 60:.1f} min, with takeoff, the way there and "
        "back, and landing, and a flight has "
        f"{limits.seconds / 60:.1f} min and {limits.items:.0f} items; give more --endurance or --max-items, "
        "less --reserve, or a home that is nearer"
    )
