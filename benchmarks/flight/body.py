"""A multirotor as a point mass: it follows a moving target with limited lean angle, lag and drag, in wind.

The position controller is the usual cascade (position P, velocity PI, acceleration fed forward) with the
gains of ArduCopter (PSC_POSXY_P 1, PSC_VELXY_P 2, PSC_VELXY_I 1); thrust follows with a lag of 0.15 s, and
lean angles are at most 30 degrees. Drag is linear in the speed through the air.
"""

import math
from dataclasses import dataclass, field

Vector = tuple[float, float, float]

DT = 0.02  # seconds
_POSITION_P, _SPEED_P, _SPEED_I = 1.0, 2.0, 1.0
_LAG_S = 0.15
_LEAN_M_S2 = 9.81 * math.tan(math.radians(30))
_DRAG = 0.15  # of the speed through the air, 1/s
_MOST_INTEGRAL = 4.0  # m/s2


@dataclass(slots=True)
class Body:
    """State of the vehicle: metres and metres per second; east, north and up."""

    position: Vector = (0.0, 0.0, 0.0)
    velocity: Vector = (0.0, 0.0, 0.0)
    thrust: Vector = (0.0, 0.0, 0.0)
    integral: Vector = (0.0, 0.0, 0.0)
    wind: Vector = field(default=(0.0, 0.0, 0.0))

    def step(self, target: Vector, velocity: Vector, acceleration: Vector) -> None:
        """Follow a target for one time step."""
        wanted, sums = [], []
        for k in range(3):
            aim = velocity[k] + _POSITION_P * (target[k] - self.position[k])
            error = aim - self.velocity[k]
            total = self.integral[k] + _SPEED_I * error * DT
            sums.append(min(max(total, -_MOST_INTEGRAL), _MOST_INTEGRAL))
            wanted.append(acceleration[k] + _SPEED_P * error + sums[k])
        self.integral = (sums[0], sums[1], sums[2])
        lean = math.hypot(wanted[0], wanted[1])
        scale = min(1.0, _LEAN_M_S2 / lean) if lean else 1.0
        commanded = (wanted[0] * scale, wanted[1] * scale, min(max(wanted[2], -5.0), 5.0))
        share = DT / _LAG_S
        place, speed, thrust = [], [], []
        for k in range(3):
            thrust.append(self.thrust[k] + share * (commanded[k] - self.thrust[k]))
            force = thrust[k] - _DRAG * (self.velocity[k] - self.wind[k])
            speed.append(self.velocity[k] + DT * force)
            place.append(self.position[k] + DT * (self.velocity[k] + speed[k]) / 2)
        self.thrust = (thrust[0], thrust[1], thrust[2])
        self.velocity = (speed[0], speed[1], speed[2])
        self.position = (place[0], place[1], place[2])
