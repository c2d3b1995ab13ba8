"""Vehicles as their heartbeats describe them."""

from dataclasses import dataclass
from typing import Any

from uavseg.flight.mission.items import AUTOPILOTS

INVALID_AUTOPILOT = 8  # MAV_AUTOPILOT of what is not a vehicle
ARMED = 128  # MAV_MODE_FLAG_SAFETY_ARMED
# MAV_TYPE of what has a heartbeat but flies no mission
TRACKER, GROUND_STATION, COMPANION, GIMBAL, ADSB, CAMERA = 5, 6, 18, 26, 27, 30
NOT_VEHICLES = frozenset({TRACKER, GROUND_STATION, COMPANION, GIMBAL, ADSB, CAMERA})
AUTOPILOT_NAMES = {"ardupilot": "ArduPilot", "px4": "PX4"}  # for people


@dataclass(frozen=True, slots=True)
class Vehicle:
    """The vehicle at the other end of a link.

    Parameters
    ----------
    system, component : int
        Its MAVLink ids.
    mav_autopilot : int
        MAV_AUTOPILOT.
    is_armed : bool
        Whether its motors are armed, by its last heartbeat.
    source : object
        Where its messages come from, see `transport.Source`.
    """

    system: int
    component: int
    mav_autopilot: int
    is_armed: bool = False
    source: Any = None

    @property
    def autopilot(self) -> str:
        """ "ardupilot", "px4", or "generic" for any other."""
        return next((name for name, number in AUTOPILOTS.items() if number == self.mav_autopilot), "generic")

    @property
    def has_home_row(self) -> bool:
        """Whether its missions begin with home as item 0."""
        return self.autopilot == "ardupilot"

    def __str__(self) -> str:
        name = AUTOPILOT_NAMES.get(self.autopilot, f"autopilot {self.mav_autopilot}")
        return f"{name}, system {self.system}"


def is_vehicle(heartbeat: Any) -> bool:
    """Whether a HEARTBEAT is that of an autopilot: not of a ground station, a camera, a companion."""
    return heartbeat.autopilot != INVALID_AUTOPILOT and heartbeat.type not in NOT_VEHICLES
