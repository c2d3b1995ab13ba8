"""Photographs of a flight: spacing, trigger distance and speed from a camera, a height and overlaps."""

import math

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.flight.camera.camera import NADIR_DEG, Camera, Overlap, check_pitch

TRIGGERS = ("distance", "interval", "hover", "none")
SHUTTER_S = 1 / 1000
"""Exposure time in daylight, by which motion blur is estimated."""
LONGEST_SHUTTER_S, SHORTEST_SHUTTER_S = 1.0, 1e-6
BLUR_PX = 1.0
"""Pixels by which the ground may move during the exposure."""
LAST_PHOTO_M = 5.0
"""The last photograph of a line is planned so far before its end.

The vehicle leaves a line up to 2 m before its end (the radius of waypoints), its first photograph is taken up
to 2 m after the start, and each one some centimetres late: with less, simulated flights lost the last one.
"""
ONE_PHOTO_M = 5.0
"""Lines that are no longer have one photograph, at their start."""
INTERVAL_STEP_S = 0.01


@dataclass(frozen=True, slots=True)
class Photos:
    """Photographs of a flight: camera, overlap, gimbal pitch, trigger, exposure time.

    A ParameterError says that the pitch or the exposure time is out of bounds, or the trigger is not known.

    With `trigger`, photographs are taken by metres, by seconds, in hover at a waypoint for each, or not by
    the mission.
    """

    camera: Camera
    overlap: Overlap = Overlap(75, 70)
    pitch_deg: float = NADIR_DEG  # gimbal pitch: -90 is straight down
    trigger: str = "distance"  # "distance", "interval", "hover" or "none"
    shutter_s: float = SHUTTER_S  # exposure time, by which motion blur is estimated

    def __post_init__(self) -> None:
        check_pitch(self.pitch_deg)
        if self.trigger not in TRIGGERS:
            raise ParameterError(f"a trigger is one of {', '.join(TRIGGERS)}, not {self.trigger!r}")
        if not SHORTEST_SHUTTER_S <= self.shutter_s <= LONGEST_SHUTTER_S:
            raise ParameterError(
                f"an exposure time is at most a second, such as 1/1000, not {self.shutter_s:g} s"
            )

    def spacing_m(self, height_m: float) -> float:
        """Return the distance between lines at a height above the ground."""
        return self.overlap.spacing_m(self.camera.footprint_m(height_m, self.pitch_deg))[0]

    def trigger_m(self, height_m: float) -> float:
        """Return the maximum distance between photographs along a line."""
        return self.overlap.spacing_m(self.camera.footprint_m(height_m, self.pitch_deg))[1]

    def reach_m(self, height_m: float) -> float:
        """Return the ground that a photograph shows past the end of a line, in either direction of flight."""
        near, far = self.camera.ground_reach_m(height_m, self.pitch_deg)
        return max(min(-near, far), 0.0)

    def line_reach_m(self, height_m: float) -> float:
        """Return the ground that photographs surely show past the ends of a line; 0 without a trigger.

        The last one may be taken before the end, by `LAST_PHOTO_M` or the distance of an interval.
        """
        if self.trigger == "none":
            return 0.0
        reach = self.reach_m(height_m)
        before_end = {"hover": 0.0, "distance": LAST_PHOTO_M, "interval": self.trigger_m(height_m)}
        return max(reach - before_end[self.trigger], 0.0)

    def min_line_m(self, height_m: float) -> float:
        """Return the length of the shortest line whose two photographs are not too close for a fair speed."""
        return max(min(self.trigger_m(height_m), self.reach_m(height_m)) / 2 + LAST_PHOTO_M, ONE_PHOTO_M)

    def max_speed_m_s(self, height_m: float, trigger_m: float) -> float:
        """Return the maximum speed for sharp photographs a distance apart; infinite in hover."""
        if self.trigger == "hover":
            return math.inf
        return self.camera.max_speed_m_s(height_m, trigger_m, self.shutter_s, BLUR_PX)

    def line_trigger_m(self, length_m: float, height_m: float) -> float:
        """Return the distance between photographs of a line: the first at its start, the last near its end.

        So both ends of a line are photographed whatever its length is, and the overlap is never less than
        requested. A line of 5 m or less has the first only. In hover the last photograph is taken at the end
        itself. By interval the place of the last one is not known: the distance is at most `reach_m`.
        """
        trigger, reach = self.trigger_m(height_m), self.reach_m(height_m)
        if self.trigger == "interval":
            return min(trigger, reach) if reach > 0 else trigger
        last_m = 0.0 if self.trigger == "hover" else LAST_PHOTO_M
        flown = max(length_m - last_m, length_m / 2)
        if length_m <= ONE_PHOTO_M + 1e-6:
            return trigger
        return flown / math.ceil(flown / trigger - 1e-9)

    def interval_s(self, trigger_m: float, speed_m_s: float) -> float:
        """Return the time between photographs a distance apart at a speed, at least that of the camera."""
        steps = math.floor(trigger_m / speed_m_s / INTERVAL_STEP_S + 1e-6)
        return max(steps * INTERVAL_STEP_S, self.camera.min_interval_s, INTERVAL_STEP_S)
