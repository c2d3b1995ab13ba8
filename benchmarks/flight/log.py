"""What a simulated flight leaves: its time, where photographs were taken, and where it has been."""

import math
from dataclasses import dataclass, field

from benchmarks.flight.body import DT, Body, Vector
from benchmarks.flight.route import Look, Shutter

EVERY = 10  # steps between two points of the track
YAW_RAD_S = math.radians(60)  # ATC_SLEW_YAW of ArduCopter; MPC_YAWRAUTO_MAX of PX4 is 60 degrees a second too


@dataclass(slots=True)
class Log:
    """Record of a flight, written step by step.

    Parameters
    ----------
    track : list of (x, y, z)
        Metres east, north and above home.
    photographs : list of (x, y, z, yaw)
        The yaw in radians, clockwise from north: it follows the direction of legs, or a place to look at, as
        fast as an autopilot turns.
    begin, end : int
        The part of the track from the height of the takeoff to the beginning of the landing.
    """

    steps: int = 0
    track: list[Vector] = field(default_factory=list)
    photographs: list[tuple[float, float, float, float]] = field(default_factory=list)
    begin: int = 0
    end: int | None = None
    shutter: Shutter = field(default_factory=Shutter)
    since_s: float = 0.0
    last: tuple[float, float] = (math.inf, math.inf)
    look_at: tuple[float, float] | None = None
    yaw: float | None = None

    @property
    def seconds(self) -> float:
        """Time since takeoff."""
        return self.steps * DT

    def act(self, action: Shutter | Look, body: Body) -> None:
        """What the camera is commanded to do."""
        if isinstance(action, Look):
            self.look_at = action.at
            return
        if action.at_once:
            self._photograph(body)
        if not action.single:
            self.shutter, self.last, self.since_s = action, body.position[:2], 0.0

    def note(self, body: Body, heading: float) -> None:
        """Record a time step; a photograph is taken where the last is so far away, or so long ago."""
        if self.steps % EVERY == 0:
            self.track.append(body.position)
        self.steps += 1
        x, y, _ = body.position
        self._turn(math.atan2(self.look_at[0] - x, self.look_at[1] - y) if self.look_at else heading)
        self.since_s += DT
        far = 0 < self.shutter.every_m <= math.hypot(x - self.last[0], y - self.last[1])
        if far or 0 < self.shutter.every_s <= self.since_s + DT / 2:
            self._photograph(body)
            self.last, self.since_s = (x, y), 0.0

    def stand(self, body: Body, seconds: float) -> None:
        """Record time on the ground."""
        for _ in range(round(seconds / DT)):
            self.note(body, self.yaw or 0.0)

    def _turn(self, heading: float) -> None:
        """Yaw towards a direction."""
        if self.yaw is None:
            self.yaw = heading
        error = math.remainder(heading - self.yaw, math.tau)
        self.yaw += min(max(error, -YAW_RAD_S * DT), YAW_RAD_S * DT)

    def _photograph(self, body: Body) -> None:
        self.photographs.append((*body.position, self.yaw or 0.0))
