"""Photographs of a survey: spacing, trigger distance and speed from a camera, a height and overlaps."""

import math
from dataclasses import dataclass

from uavseg.flight.camera.camera import NADIR_DEG, Camera, Overlap, check_pitch

SHUTTER_S = 1 / 1000
"""Exposure time in daylight, by which motion blur is estimated."""
BLUR_PX = 1.0
"""Pixels by which the ground may move during the exposure."""
LAST_PHOTO_M = 5.0
"""The last photograph of a line is planned so far before its end.

The vehicle leaves a line up to 2 m before its end (the radius of waypoints), its first photograph is taken up
to 2 m after the start, and each one some centimetres late: with less, simulated flights lost the last one.
"""


@dataclass(frozen=True, slots=True)
class Photos:
    """How a survey is photographed.

    Parameters
    ----------
    camera : Camera
    overlap : Overlap
    pitch_deg : float
        Gimbal pitch: -90 is straight down.

    Raises
    ------
    ParameterError
        If the pitch is out of bounds.
    """

    camera: Camera
    overlap: Overlap = Overlap(75, 70)
    pitch_deg: float = NADIR_DEG

    def __post_init__(self) -> None:
        check_pitch(self.pitch_deg)

    def spacing_m(self, height_m: float) -> float:
        """Distance between lines at a height above the ground."""
        return self.overlap.spacing_m(self.camera.footprint_m(height_m, self.pitch_deg))[0]

    def trigger_m(self, height_m: float) -> float:
        """Distance between photographs along a line, at most."""
        return self.overlap.spacing_m(self.camera.footprint_m(height_m, self.pitch_deg))[1]

    def reach_m(self, height_m: float) -> float:
        """How far a photograph at the end of a line shows ground beyond it, in either direction of flight."""
        near, far = self.camera.ground_reach_m(height_m, self.pitch_deg)
        return max(min(-near, far), 0.0)

    def max_speed_m_s(self, height_m: float, trigger_m: float) -> float:
        """Highest speed at which the camera keeps up with this distance, and photographs are sharp."""
        return self.camera.max_speed_m_s(height_m, trigger_m, SHUTTER_S, BLUR_PX)

    def line_trigger_m(self, length_m: float, height_m: float) -> float:
        """Distance between the photographs of one line: the first at its start, the last near its end.

        So both ends of a line are photographed whatever its length is, and the overlap is never less than
        asked for. A line that is shorter than the distance, and shown by its first photograph, has only that.
        """
        trigger = self.trigger_m(height_m)
        flown = max(length_m - LAST_PHOTO_M, length_m / 2)
        if flown <= trigger and length_m <= self.reach_m(height_m):
            return trigger
        return flown / math.ceil(flown / trigger - 1e-9)
