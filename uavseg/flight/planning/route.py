"""Routes: tracks over all regions in a short order, and the ways between them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import MissionError
from uavseg.flight.avoid.free_space import FreeSpace
from uavseg.flight.mission.track import Track
from uavseg.flight.order.stops import Stops
from uavseg.flight.order.tour import short_tour
from uavseg.flight.planning.short_legs import without_short_legs

Floats = NDArray[np.float64]

MAX_REGIONS = 4000  # far more than any vehicle stores


@dataclass(frozen=True, slots=True, eq=False)
class Route:
    """What is flown, in order: runs of lines or single points, and the ways between them.

    Parameters
    ----------
    home : (2,) float64 array
    pieces : tuple of Track
        n runs of lines.
    ways : tuple of Track
        n - 1 ways, from the end of each piece to the start of the next.
    space : FreeSpace
        Where ways may lead.
    """

    home: Floats
    pieces: tuple[Track, ...]
    ways: tuple[Track, ...]
    space: FreeSpace

    def flight(self, first: int, last: int) -> Track:
        """From home over pieces, the last one included, and home again where that way is not straight."""
        inner = [track for k in range(first, last) for track in (self.pieces[k], self.ways[k])]
        back = self._way(self.pieces[last].xy[-1], self.home)
        tracks = [self._way(self.home, self.pieces[first].xy[0]), *inner, self.pieces[last]]
        if len(back.xy) > 2:
            tracks.append(back)
        return without_short_legs(Track.joined(tracks).part_from(1), self.space)

    def home_lengths(self) -> tuple[Floats, Floats]:
        """Lengths of the ways from home to the start of each piece, and from its end home, in metres."""
        starts = np.array([piece.xy[0] for piece in self.pieces])
        ends = np.array([piece.xy[-1] for piece in self.pieces])
        lengths = self.space.lengths_from(self.home, np.concatenate([starts, ends]))
        return lengths[: len(starts)], lengths[len(starts) :]

    def _way(self, start: Floats, end: Floats) -> Track:
        return Track.of_way(self.space.path(start.tolist(), end.tolist()))


def short_route(candidates: Sequence[Sequence[Track]], home: Floats, space: FreeSpace) -> Route:
    """A short route from home over one track of each region, in either direction, and home again.

    Parameters
    ----------
    candidates : sequence of sequences of Track
        For each region; each may be flown in either direction.
    home : (2,) float64 array
    space : FreeSpace

    Raises
    ------
    MissionError
        If there are too many regions, or a region cannot be reached.
    """
    tracks = _ordered(candidates, home, space)
    pieces: list[Track] = []
    ways: list[Track] = []
    for track in tracks:
        stretches = track.stretches()
        if pieces:
            path = space.path(pieces[-1].xy[-1].tolist(), track.xy[stretches[0][0]].tolist())
            ways.append(Track.of_way(path))
        for k, (first, last) in enumerate(stretches):
            if k:
                ways.append(track.part(stretches[k - 1][1], first))
            pieces.append(track.part(first, last))
    return Route(home, tuple(pieces), tuple(ways), space)


def check_order(count: int) -> None:
    """Check that so many regions can be ordered.

    Raises
    ------
    MissionError
        If not.
    """
    if count > MAX_REGIONS:
        raise MissionError(
            f"there are {count:,} regions, and at most {MAX_REGIONS:,} are ordered; choose fewer"
        )


def _ordered(candidates: Sequence[Sequence[Track]], home: Floats, space: FreeSpace) -> list[Track]:
    """One track for each region, in an order that makes a short tour from home and back."""
    check_order(len(candidates))
    ends = np.concatenate([[track.xy[[0, -1]] for track in tracks] for tracks in candidates])
    points, index = np.unique(np.concatenate([home[None], ends.reshape(-1, 2)]), axis=0, return_inverse=True)
    pairs = index.ravel()[1:].reshape(-1, 2)
    options, costs, flown = [], [], []
    first = 0
    for tracks in candidates:
        own = pairs[first : first + len(tracks)]
        first += len(tracks)
        flown.append([*tracks, *(track.reversed() for track in tracks)])
        options.append(np.concatenate([own, own[:, ::-1]]))
        costs.append(np.array([track.length_m for track in tracks] * 2))
    start = int(index.ravel()[0])
    lengths = space.paths(points).lengths
    tour = short_tour(Stops.of(options, costs), lengths, start, start)
    return [flown[region][option] for region, option in tour]
