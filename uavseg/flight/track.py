"""Tracks: paths over one region, with the distance between the photographs on each of their legs."""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.flight.camera.photos import Photos
from uavseg.flight.cover.survey import Survey

Floats = NDArray[np.float64]


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
    parts : tuple of TrackPart
        The cells of a survey.
    """

    xy: Floats
    trigger_m: Floats
    parts: tuple[TrackPart, ...] = ()

    @classmethod
    def of_path(cls, xy: Floats) -> "Track":
        """A path without photographs."""
        return cls(xy, np.zeros(len(xy) - 1))

    @classmethod
    def of_survey(cls, flown: Survey, photos: Photos | None, height_m: float) -> "Track":
        """Lines with photographs, and legs without."""
        corners: list[Floats] = []
        triggers: list[float] = []
        for k, line in enumerate(flown.lines):
            if k:
                inner = flown.legs[k - 1][1:-1]
                corners.append(inner)
                triggers += [0.0] * (len(inner) + 1)
            corners.append(line)
            length = float(np.hypot(*(line[1] - line[0])))
            triggers.append(0.0 if photos is None else photos.line_trigger_m(length, height_m))
        return cls(np.concatenate(corners), np.array(triggers), _parts(flown))

    @property
    def length_m(self) -> float:
        """Length in metres."""
        return float(np.hypot(*np.diff(self.xy, axis=0).T).sum())

    def reversed(self) -> "Track":
        """The same track from its end to its start."""
        return Track(self.xy[::-1], self.trigger_m[::-1], self.parts)


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
