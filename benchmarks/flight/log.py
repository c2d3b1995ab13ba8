"""What a simulated flight leaves: its time, where photographs were taken, and where it has been."""

import math
from dataclasses import dataclass, field

from benchmarks.flight.body import DT, Body, Vector

EVERY = 10  # steps between two points of the track


@dataclass(slots=True)
class Log:
    """Record of a flight, written step by step.

    Parameters
    ----------
    track : list of (x, y, z)
    photographs : list of (x, y, z, heading)
        Heading in radians, clockwise from north: the direction of the leg.
    """

    steps: int = 0
    track: list[Vector] = field(default_factory=list)
    photographs: list[tuple[float, float, float, float]] = field(default_factory=list)
    every_m: float = 0.0
    last: tuple[float, float] = (math.inf, math.inf)

    @property
    def seconds(self) -> float:
        """Time since takeoff."""
        return self.steps * DT

    def trigger(self, every_m: float, at_once: bool, body: Body, heading: float) -> None:
        """Start or stop photographs by distance, as DO_SET_CAM_TRIGG_DIST does."""
        self.every_m = every_m
        self.last = body.position[:2]
        if at_once and every_m > 0:
            self.photographs.append((*body.position, heading))

    def note(self, body: Body, heading: float) -> None:
        """Record a time step; a photograph is taken where the last is so far away."""
        if self.steps % EVERY == 0:
            self.track.append(body.position)
        self.steps += 1
        x, y, _ = body.position
        if self.every_m > 0 and math.hypot(x - self.last[0], y - self.last[1]) >= self.every_m:
            self.photographs.append((*body.position, heading))
            self.last = (x, y)
