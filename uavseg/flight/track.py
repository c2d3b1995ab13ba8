"""Tracks: paths over one region, with the distance between the photographs on each of their legs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.flight.camera.photos import Photos
from uavseg.flight.cover.survey import Survey

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A path over a region.

    Parameters
    ----------
    xy : (n, 2) float64 array
        Its corners, in metres.
    trigger_m : (n - 1,) float64 array
        Distance between photographs on the leg to the next corner; 0 where none are taken.
    """

    xy: Floats
    trigger_m: Floats

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
        return cls(np.concatenate(corners), np.array(triggers))

    @property
    def length_m(self) -> float:
        """Length in metres."""
        return float(np.hypot(*np.diff(self.xy, axis=0).T).sum())

    def reversed(self) -> "Track":
        """The same track from its end to its start."""
        return Track(self.xy[::-1], self.trigger_m[::-1])
