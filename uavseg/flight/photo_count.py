"""Number of photographs that a mission takes."""

import math

import numpy as np

from uavseg.flight.items import (
    CAMERA_DISTANCE,
    CHANGE_SPEED,
    RETURN,
    START_CAPTURE,
    STOP_CAPTURE,
    distance_m,
)
from uavseg.flight.mission import Mission


def photo_count(mission: Mission) -> int:
    """Photographs of a mission, as its items ask for them.

    A trigger by distance takes one after each distance over ground, and one at once where its third parameter
    is 1; a series by time one at once and one after each interval at the speed that holds.
    """
    count, rest_m, rest_s = 0, 0.0, 0.0
    trigger_m, interval_s, speed = 0.0, 0.0, mission.speed_m_s
    place = (mission.home.lat, mission.home.lon)
    for item in mission.items:
        first, second, third, _ = (value or 0.0 for value in item.params)
        if item.command == CAMERA_DISTANCE:
            trigger_m, rest_m = max(first, 0.0), 0.0
            count += int(trigger_m > 0 and third == 1)
        elif item.command == START_CAPTURE:
            count += int(third) if third else 1
            interval_s, rest_s = (second, 0.0) if third == 0 else (interval_s, rest_s)
        elif item.command == STOP_CAPTURE:
            interval_s = 0.0
        elif item.command == CHANGE_SPEED:
            speed = second if second > 0 else speed
        elif (item.has_position and not item.is_at_vehicle) or item.command == RETURN:
            there = (mission.home.lat, mission.home.lon) if item.command == RETURN else (item.lat, item.lon)
            leg_m = distance_m(*place, *there)
            by_distance, rest_m = _steps(leg_m + rest_m, trigger_m)
            by_time, rest_s = _steps(leg_m / speed + rest_s, interval_s)
            count += by_distance + by_time
            place = there
    return count


def _steps(length: float, step: float) -> tuple[int, float]:
    """How often a step fits into a length, and what is left; within the rounding of positions."""
    if step <= 0:
        return 0, 0.0
    count = math.floor(length / step + 1e-3)
    return count, float(np.clip(length - count * step, 0.0, None))
