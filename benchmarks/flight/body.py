"""A multirotor as a point mass: it follows a moving target with limited lean angle, lag and drag, in wind.

The position controller is the usual cascade (position P, velocity PI, acceleration fed forward) with the
gains of ArduCopter (PSC_POSXY_P 1, PSC_VELXY_P 2, PSC_VELXY_I 1); thrust follows with a lag of 0.15 s, and
lean angles are at most 30 degrees (ATC_ANGLE_MAX), first for what is across the track. The drag is that of
ArduPilot's simulated quadrotor (libraries/SITL/SIM_Frame.cpp) of 3 kg, which reaches 15.1 m/s at a lean of
45 degrees: in the frame of the vehicle 0.0358 / m of the square of the speed through the air, and 0.186 / s
of the speed, times the root of the thrust. At 30 degrees it flies 11.8 m/s. Gusts change with the time
constant of 2 s.
"""

import math
import random
from dataclasses import dataclass, field

Vector = tuple[float, float, float]

DT = 0.02  # seconds
_POSITION_P, _SPEED_P, _SPEED_I = 1.0, 2.0, 1.0
_LAG_S = 0.15
_G = 9.81
_LEAN_M_S2 = _G * math.tan(math.radians(30))
_DRAG_PER_M, _DRAG_PER_S = 0.0358, 0.186
_GUST_S = 2.0
_MOST_INTEGRAL = 10.0  # m/s2, PSC_VELXY_IMAX


@dataclass(slots=True)
class Body:
    """State of the vehicle: metres and metres per second; east, north and up."""

    position: Vector = (0.0, 0.0, 0.0)
    velocity: Vector = (0.0, 0.0, 0.0)
    thrust: Vector = (0.0, 0.0, 0.0)
    integral: Vector = (0.0, 0.0, 0.0)
    wind: Vector = field(default=(0.0, 0.0, 0.0))
    gust_m_s: float = 0.0  # standard deviation, in each direction
    gust: Vector = (0.0, 0.0, 0.0)
    draw: random.Random = field(default_factory=lambda: random.Random(1))

    def step(self, target: Vector, velocity: Vector, acceleration: Vector) -> None:
        """Follow a target for one time step."""
        wanted, sums = [], []
        for k in range(3):
            aim = velocity[k] + _POSITION_P * (target[k] - self.position[k])
            error = aim - self.velocity[k]
            total = self.integral[k] + _SPEED_I * error * DT
            sums.append(min(max(total, -_MOST_INTEGRAL), _MOST_INTEGRAL))
            wanted.append(acceleration[k] + _SPEED_P * error + sums[k])
        level = _limited((wanted[0], wanted[1]), velocity)
        if level != (wanted[0], wanted[1]):  # at the limit, integrals do not grow
            pairs = zip(sums, self.integral, strict=True)
            sums = [kept if abs(new) > abs(kept) else new for new, kept in pairs]
        self.integral = (sums[0], sums[1], sums[2])
        commanded = (*level, min(max(wanted[2], -5.0), 5.0))
        share = DT / _LAG_S
        if self.gust_m_s:
            self._change_gust()
        drag = self._drag()
        place, speed, thrust = [], [], []
        for k in range(3):
            thrust.append(self.thrust[k] + share * (commanded[k] - self.thrust[k]))
            speed.append(self.velocity[k] + DT * (thrust[k] - drag[k]))
            place.append(self.position[k] + DT * (self.velocity[k] + speed[k]) / 2)
        self.thrust = (thrust[0], thrust[1], thrust[2])
        self.velocity = (speed[0], speed[1], speed[2])
        self.position = (place[0], place[1], place[2])

    def _change_gust(self) -> None:
        """Continue gusts, a first-order process."""
        kept = math.exp(-DT / _GUST_S)
        spread = self.gust_m_s * math.sqrt(1 - kept * kept)
        x, y, z = (kept * one + self.draw.gauss(0.0, spread) for one in self.gust)
        self.gust = (x, y, z)

    def _drag(self) -> Vector:
        """Deceleration by the air; the vehicle leans into it."""
        x, y, z = (v - w - g for v, w, g in zip(self.velocity, self.wind, self.gust, strict=True))
        level, up = math.hypot(x, y), _G + self.thrust[2]
        push = math.hypot(self.thrust[0], self.thrust[1])
        whole = math.hypot(push, up)
        cosine, sine = up / whole, push / whole
        along, under = level * cosine, level * sine
        forward = _DRAG_PER_M * along * along + _DRAG_PER_S * along * math.sqrt(whole / _G)
        flat = cosine * forward + sine * _DRAG_PER_M * under * under
        share = flat / level if level else 0.0
        return x * share, y * share, _DRAG_PER_M * abs(z) * z


def _limited(wanted: tuple[float, float], velocity: Vector) -> tuple[float, float]:
    """The acceleration within the lean angle: what is across the track comes first (limit_accel_xy)."""
    if math.hypot(*wanted) <= _LEAN_M_S2:
        return wanted
    speed = math.hypot(velocity[0], velocity[1])
    if not speed:
        scale = _LEAN_M_S2 / math.hypot(*wanted)
        return wanted[0] * scale, wanted[1] * scale
    x, y = velocity[0] / speed, velocity[1] / speed
    along, across = wanted[0] * x + wanted[1] * y, wanted[1] * x - wanted[0] * y
    across = min(max(across, -_LEAN_M_S2), _LEAN_M_S2)
    along = math.copysign(min(abs(along), math.sqrt(_LEAN_M_S2**2 - across**2)), along)
    return along * x - across * y, along * y + across * x
