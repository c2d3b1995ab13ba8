"""Vehicles: speeds, accelerations and turns of a multirotor under ArduCopter or PX4, and its power; wind.

The defaults, in vehicles.json, are those of the autopilots' own parameters, which operators rarely change:

- ArduCopter 4.5: WPNAV_ACCEL 2.5 m/s2, WPNAV_ACCEL_C 0 (twice that), WPNAV_JERK 1 m/s3, WPNAV_ACCEL_Z
  1 m/s2, WPNAV_SPEED 10, WPNAV_SPEED_UP 2.5, WPNAV_SPEED_DN 1.5 m/s, WPNAV_RADIUS 2 m, RTL_ALT 15 m,
  RTL_CONE_SLOPE 3, RTL_LOIT_TIME 5 s, LAND_SPEED 0.5 m/s below LAND_ALT_LOW 10 m (libraries/AC_WPNav,
  ArduCopter/config.h). The simulated quadrotor of ArduPilot flies 11.8 m/s at a lean of 30 degrees,
  ATC_ANGLE_MAX (libraries/SITL/SIM_Frame.cpp). Before the climb, rotors speed up (MOT_SPOOL_TIME 0.5 s) and
  thrust rises (TKOFF_SLEW_TIME 2 s); after touchdown, thrust falls, and a landing is detected in a second.
- PX4 1.15: MPC_ACC_HOR 3 m/s2, MPC_JERK_AUTO 4 m/s3, MPC_XY_TRAJ_P 0.5, MPC_ACC_UP_MAX 4 and MPC_ACC_DOWN_MAX
  3 m/s2, MPC_XY_CRUISE 5, MPC_Z_V_AUTO_UP 3, MPC_Z_V_AUTO_DN 1.5 m/s, NAV_ACC_RAD 2 m for multirotors,
  RTL_RETURN_ALT 60 m, RTL_CONE_ANG 45 degrees, MPC_LAND_SPEED 0.7 m/s, which the descent comes down to
  between MPC_LAND_ALT1 10 m and MPC_LAND_ALT2 5 m: as long as 7 m at that speed; MPC_TKO_SPEED 1.5 m/s up to
  MPC_LAND_ALT1; MPC_XY_VEL_MAX 12 m/s; COM_SPOOLUP_TIME 1 s and MPC_TKO_RAMP_T 3 s before the climb, and
  COM_DISARM_LAND 2 s after the landing (src/modules/mc_pos_control, src/modules/navigator, rc.mc_defaults).
"""

import json
import math
from dataclasses import fields, replace
from importlib import resources
from pathlib import Path

import numpy as np

from uavseg.arrays import Floats, Path_
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError, ParameterError
from uavseg.inputs import number_in, read_object, text_in
from uavseg.plain_text import shown

TURNS = ("blend", "slow")
CONTROL_LAG_S = 0.1  # of the position controller
_MINIMUM, _MAXIMUM = 1e-9, 1e9  # of any number but 0, so that no product or ratio of them overflows
_MAY_BE_ZERO = frozenset(
    {"jerk_rise_s", "return_height_m", "return_slope", "return_hold_s"}
    | {"takeoff_height_m", "landing_height_m", "start_s", "stop_s"}
)
_POWER = ("hover_w", "cruise_w", "battery_wh")
MAX_WIND_M_S = 50.0
DIRECTIONS = 12  # of a wind from anywhere
LEAST_WAY_M_S = 1.0  # a vehicle that makes less way over ground cannot fly a leg


@dataclass(frozen=True, slots=True)
class Vehicle:
    """Speeds, accelerations and power of a multirotor that flies a mission.

    A ParameterError says that a number is not positive (or 0 where that has a meaning), not 1e-9 to 1e9, or
    that power is given in part.
    """

    name: str
    turns: str  # at corners: "blend", both legs overlap in time (ArduCopter), or "slow", to a speed (PX4)
    acceleration_m_s2: float  # of the horizontal flight
    jerk_m_s3: float
    jerk_rise_s: float  # time in which the jerk builds up
    corner_acceleration_m_s2: float  # at most
    radius_m: float  # within which a waypoint is passed
    climb_m_s: float
    descent_m_s: float
    vertical_acceleration_m_s2: float
    return_speed_m_s: float  # over ground; the speed of the mission does not set it
    return_height_m: float  # above home, to which a return climbs
    return_slope: float  # times the length of the return: its height where that is lower
    return_hold_s: float  # above home, before the descent
    takeoff_m_s: float  # of the first metres of a climb
    takeoff_height_m: float  # their number
    landing_m_s: float  # of the last metres before the ground
    landing_height_m: float  # their number
    airspeed_m_s: float  # highest, through the air, at the largest lean
    start_s: float  # on the ground, until it climbs
    stop_s: float  # on the ground, until the motors stop
    hover_w: float | None = None
    cruise_w: float | None = None  # in forward flight
    battery_wh: float | None = None  # of a full one

    def __post_init__(self) -> None:
        if self.turns not in TURNS:
            raise ParameterError(f"turns of a vehicle are {' or '.join(TURNS)}, not {shown(self.turns)}")
        for key in NUMBERS:
            value = getattr(self, key)
            if value is None and key in _POWER:
                continue
            zero = key in _MAY_BE_ZERO
            if not (math.isfinite(value) and (value > 0 or (zero and value == 0))):
                expected = "0 or more" if zero else "above 0"
                raise ParameterError(f"{key} of the vehicle {self.name} is {expected}, not {value:g}")
            if value > _MAXIMUM or 0 < value < _MINIMUM:
                raise ParameterError(
                    f"{key} of the vehicle {self.name} is {_MINIMUM:g} to {_MAXIMUM:g}, not {value:g}"
                )
        given = [key for key in _POWER if getattr(self, key) is not None]
        if 0 < len(given) < len(_POWER):
            raise ParameterError(
                f"the power of the vehicle {self.name} is hover_w, cruise_w and battery_wh together; "
                f"only {' and '.join(given)} is given"
            )

    def deviation_m(self, speed_m_s: float) -> float:
        """Return a bound of how far it leaves its legs at a speed: corners are cut, the controller lags."""
        return self.radius_m + CONTROL_LAG_S * speed_m_s


NUMBERS = tuple(field.name for field in fields(Vehicle) if field.name not in {"name", "turns"})

_TABLE = resources.files("uavseg.flight.mission").joinpath("vehicles.json").read_text(encoding="utf-8")
_DEFAULTS = {autopilot: Vehicle(**values) for autopilot, values in json.loads(_TABLE).items()}
ARDUCOPTER, PX4 = _DEFAULTS["ardupilot"], _DEFAULTS["px4"]


def default_vehicle(autopilot: str) -> Vehicle:
    """Return the multirotor that an autopilot flies with its default parameters."""
    return PX4 if autopilot == "px4" else ARDUCOPTER


def returning_vehicles(vehicle: Vehicle | None, autopilot: str) -> tuple[Vehicle, ...]:
    """Return the vehicles whose returns are checked: those of both autopilots where a mission is for any."""
    if vehicle is not None:
        return (vehicle,)
    return (ARDUCOPTER, PX4) if autopilot == "generic" else (default_vehicle(autopilot),)


def read_vehicle(path: Path_, autopilot: str = "ardupilot") -> Vehicle:
    """Read a vehicle from a JSON file: an object with parameters of `Vehicle`.

    The default vehicle of `autopilot` has the parameters that are not in the file. A ParameterError says that
    the file cannot be read, a key is unknown, or a value is invalid.
    """
    keys = ("name", "turns", *NUMBERS)
    given = read_object(path, "vehicle", f"some of {', '.join(keys)}")
    if unknown := sorted(map(str, set(given) - set(keys))):
        raise ParameterError(f"{path} has {shown(unknown[0])}; a vehicle has only {', '.join(keys)}")
    default = default_vehicle(autopilot)
    values = {key: number_in(given, key, path, "vehicle") for key in NUMBERS if key in given}
    name = text_in(given, "name", Path(path).stem, path, "vehicle")
    turns = text_in(given, "turns", default.turns, path, "vehicle")
    return replace(default, name=name, turns=turns, **values)


@dataclass(frozen=True, slots=True)
class Wind:
    """A steady wind: metres per second, and the azimuth in degrees that it comes from; None for any.

    A ParameterError says that the speed is not 0 to 50 m/s, or the azimuth not -360 to 360 degrees.
    """

    speed_m_s: float
    from_deg: float | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.speed_m_s <= MAX_WIND_M_S:
            raise ParameterError(f"a wind is 0 to {MAX_WIND_M_S:g} m/s, not {self.speed_m_s:g}")
        if self.from_deg is not None and not -360 <= self.from_deg <= 360:
            raise ParameterError(
                f"the direction that a wind comes from is -360 to 360 degrees, clockwise from north, "
                f"not {self.from_deg:g}"
            )

    def __str__(self) -> str:
        where = "any direction" if self.from_deg is None else f"{self.from_deg:g} degrees"
        return f"{self.speed_m_s:g} m/s from {where}"

    def directions(self) -> "tuple[Wind, ...]":
        """Return winds of this speed from 12 directions if it may come from any, else the wind itself."""
        if self.from_deg is not None:
            return (self,)
        return tuple(Wind(self.speed_m_s, k * 360 / DIRECTIONS) for k in range(DIRECTIONS))

    def over_ground_m_s(self, legs: Floats, airspeed_m_s: float) -> Floats:
        """Return the highest speed over ground along legs, (n, 2) east and north; infinite without length.

        With the part a of the wind w along a leg and the speed v through the air, it is
        a + sqrt(v^2 - (w^2 - a^2)), by the triangle of velocities. The wind has a direction. A MissionError
        says that the vehicle makes less than 1 m/s along a leg.

        Examples
        --------
        >>> Wind(6.0, 0.0).over_ground_m_s(np.array([[0.0, 9.0], [0, -9], [9, 0]]), 10.0).tolist()
        [4.0, 16.0, 8.0]
        """
        length = np.hypot(legs[:, 0], legs[:, 1])
        towards = math.radians((self.from_deg or 0.0) + 180)
        blowing = self.speed_m_s * np.array([math.sin(towards), math.cos(towards)])
        is_leg = length > 0
        along = legs[is_leg] @ blowing / length[is_leg]
        left = airspeed_m_s**2 - self.speed_m_s**2 + along**2
        highest = np.full(len(legs), np.inf)
        highest[is_leg] = along + np.sqrt(np.maximum(left, 0.0))
        highest[is_leg] = np.where(left < 0, 0.0, highest[is_leg])
        if self.speed_m_s and highest.min(initial=np.inf) < LEAST_WAY_M_S:
            slowest = legs[int(highest.argmin())]
            azimuth = math.degrees(math.atan2(slowest[0], slowest[1])) % 360
            raise MissionError(
                f"a leg towards {azimuth:.0f} degrees cannot be flown in a wind of {self}: the vehicle flies "
                f"{airspeed_m_s:g} m/s through the air; wait for less wind, or describe one that is faster "
                "(airspeed_m_s of --vehicle)"
            )
        return highest
