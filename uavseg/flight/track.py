"""Tracks: paths over one region, with the distance between the photographs on each of their legs."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.flight.camera.photos import Photos
from uavseg.flight.cover.survey import Survey

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class TrackPart:
    """A cell of a survey: its outline and the corners of its lines, (n, 2) in metres; their azimuth."""

    outline: Floats
    corners: Floats
    angle_deg: float


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A path over a region.

    Parameters
    ----------
    xy : (n, 2) float64 array
        Its corners, in metres.
    trigger_m : (n - 1,) float64 array
        Distance between photographs on the leg to the next corner; 0 where none are taken.
    is_line : (n - 1,) bool array
        Whether a leg is what the flight is for, such as a survey line; the others lead from line to line and
        may be replaced by any other way.
    parts : tuple of TrackPart
        The cells of a survey.
    """

    xy: Floats
    trigger_m: Floats
    is_line: Bools
    parts: tuple[TrackPart, ...] = ()

    @classmethod
    def of_path(cls, xy: Floats) -> "Track":
        """Lines without photographs."""
        return cls(xy, np.zeros(len(xy) - 1), np.ones(len(xy) - 1, bool))

    @classmethod
    def of_way(cls, xy: Floats) -> "Track":
        """Legs that lead from line to line."""
        return cls(xy, np.zeros(len(xy) - 1), np.zeros(len(xy) - 1, bool))

    @classmethod
    def of_survey(cls, flown: Survey, photos: Photos | None, height_m: float) -> "Track":
        """Lines with photographs, and legs without."""
        tracks = []
        for k, line in enumerate(flown.lines):
            if k:
                tracks.append(cls.of_way(flown.legs[k - 1]))
            length = float(np.hypot(*(line[1] - line[0])))
            trigger = 0.0 if photos is None else photos.line_trigger_m(length, height_m)
            tracks.append(cls(line, np.array([trigger]), np.ones(1, bool)))
        return replace(cls.joined(tracks), parts=_parts(flown))

    @classmethod
    def joined(cls, tracks: Sequence["Track"]) -> "Track":
        """Tracks of which each begins where the one before it ends."""
        xy = [tracks[0].xy[:1], *(track.xy[1:] for track in tracks)]
        trigger_m, is_line = ([getattr(track, name) for track in tracks] for name in ("trigger_m", "is_line"))
        return cls(np.concatenate(xy), np.concatenate(trigger_m), np.concatenate(is_line))

    @property
    def length_m(self) -> float:
        """Length in metres."""
        return float(np.hypot(*np.diff(self.xy, axis=0).T).sum())

    def reversed(self) -> "Track":
        """The same track from its end to its start."""
        return Track(self.xy[::-1], self.trigger_m[::-1], self.is_line[::-1], self.parts)

    def part(self, first: int, last: int) -> "Track":
        """The track from one corner to a later one, or the same."""
        return Track(self.xy[first : last + 1], self.trigger_m[first:last], self.is_line[first:last])

    def part_from(self, first: int) -> "Track":
        """The track from a corner to its end."""
        return self.part(first, len(self.xy) - 1)

    def stretches(self) -> list[tuple[int, int]]:
        """First and last corner of each run of lines; of the only corner, where there are no legs."""
        if not len(self.is_line):
            return [(0, 0)]
        edges = np.flatnonzero(np.diff(np.r_[False, self.is_line, False].astype(np.int8)))
        return [(int(first), int(last)) for first, last in edges.reshape(-1, 2)]


def _parts(flown: Survey) -> tuple[TrackPart, ...]:
    """The cells of a survey; without outline where they have holes, without corners where legs go around."""
    parts = []
    for cell in flown.parts:
        straight = all(len(leg) == 2 for leg in flown.legs[cell.first : cell.stop - 1])
        has_holes = shapely.get_num_interior_rings(cell.polygon) > 0
        outline = shapely.get_coordinates(shapely.get_exterior_ring(cell.polygon))[: 0 if has_holes else -1]
        corners = flown.lines[cell.first : cell.stop].reshape(-1, 2)[: None if straight else 0]
        parts.append(TrackPart(outline, corners, flown.angle_deg))
    return tuple(parts)
