"""Routes: tracks over all regions in a short order, and the paths between them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError
from uavseg.flight.avoid.free_space import FreeSpace
from uavseg.flight.mission.track import Track, leg_lengths
from uavseg.flight.order.tour import Stops, short_tour

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
