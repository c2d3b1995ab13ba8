"""Simulated flight as PX4 flies missions: it brakes for each corner and turns at the acceptance radius.

Transcribed from the behaviour of PX4's motion_planning/PositionSmoothing.cpp, flight_mode_manager and
navigator, with default parameters of multirotors. It shares nothing with the estimates of the package: the
velocity is asked for anew in each time step, and followed with limited acceleration and jerk.
"""

import math
from dataclasses import dataclass

from benchmarks.flight.body import DT, Body, Vector
from benchmarks.flight.log import Log
from benchmarks.flight.route import Stop

ACC_HOR, JERK_AUTO, TRAJ_P, ERR_MAX = (
    3.0,
    4.0,
    0.5,
    2.0,
)  # MPC_ACC_HOR, MPC_JERK_AUTO, MPC_XY_TRAJ_P, ..._ERR_MAX
ACC_UP, ACC_DOWN, V_UP, V_DOWN = 4.0, 3.0, 3.0, 1.5  # MPC_ACC_UP_MAX, ..._DOWN_MAX, MPC_Z_V_AUTO_UP, ..._DN
RADIUS, ALT_RADIUS, CRUISE = 2.0, 0.8, 5.0  # NAV_ACC_RAD, NAV_MC_ALT_RAD, MPC_XY_CRUISE
TAKEOFF_SPEED, LAND_SPEED, LAND_1, LAND_2 = (
    1.5,
    0.7,
    10.0,
    5.0,
)  # MPC_TKO_SPEED, MPC_LAND_SPEED, ..._ALT1, ..._ALT2
SPOOL_S, RAMP_S, DISARM_S = 1.0, 3.0, 2.0  # COM_SPOOLUP_TIME, MPC_TKO_RAMP_T, COM_DISARM_LAND
RETURN_HEIGHT, DESCEND_HEIGHT = 60.0, 30.0  # RTL_RETURN_ALT, RTL_DESCEND_ALT; the cone is 45 degrees
_LONGEST_S = 4 * 3600.0


@dataclass(slots=True)
class Trajectory:
    """The smooth setpoint that the vehicle follows, over ground and in height."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    vx: float = 0.0
    vy: float = 0.0
    vz: float = 0.0
    ax: float = 0.0
    ay: float = 0.0
    az: float = 0.0

    def step(self, vx: float, vy: float, vz: float, stretch: float) -> None:
        """Go on towards a velocity, with limited acceleration and jerk."""
        ex, ey = vx - self.vx, vy - self.vy
        error = math.hypot(ex, ey)
        # the most acceleration that can still be taken back until the velocity is reached
        most = min(ACC_HOR, math.sqrt(2 * JERK_AUTO * error))
        wx, wy = (ex / error * most, ey / error * most) if error > 1e-9 else (0.0, 0.0)
        dx, dy = wx - self.ax, wy - self.ay
        change, limit = math.hypot(dx, dy), JERK_AUTO * DT
        share = min(1.0, limit / change) if change else 0.0
        self.ax, self.ay = self.ax + share * dx, self.ay + share * dy
        up = vz - self.vz
        wz = math.copysign(min(ACC_UP if up > 0 else ACC_DOWN, math.sqrt(2 * JERK_AUTO * abs(up))), up)
        self.az += min(max(wz - self.az, -limit), limit)
        self.vx, self.vy, self.vz = self.vx + self.ax * DT, self.vy + self.ay * DT, self.vz + self.az * DT
        self.x += self.vx * DT * stretch
        self.y += self.vy * DT * stretch
        self.z += self.vz * DT


class Px4:
    """The vehicle, its log and its trajectory."""

    def __init__(self, wind: Vector) -> None:
        self.log, self.body, self.smooth = Log(), Body(wind=wind), Trajectory()
        self.heading = 0.0
        self.before_turn = math.inf

    def step(self, vx: float, vy: float, vz: float) -> None:
        """One time step towards a velocity; the trajectory waits while the vehicle is behind it."""
        smooth, (px, py, _) = self.smooth, self.body.position
        ahead = (smooth.x - px, smooth.y - py)
        stretch = 1.0
        if ahead[0] * smooth.vx + ahead[1] * smooth.vy >= 0:
            stretch = 1.0 - min(math.hypot(*ahead) / ERR_MAX, 1.0)
        smooth.step(vx, vy, vz, stretch)
        self.body.step(
            (smooth.x, smooth.y, smooth.z),
            (smooth.vx, smooth.vy, smooth.vz),
            (smooth.ax, smooth.ay, smooth.az),
        )
        self.log.note(self.body, self.heading)

    def towards(
        self, start: Vector, target: Vector, following: Vector, cruise: float, up: float = V_UP
    ) -> None:
        """One time step on the way from a start to a target and on to the next one."""
        smooth = self.smooth
        to_x, to_y = target[0] - smooth.x, target[1] - smooth.y
        away = math.hypot(to_x, to_y)
        speed = _fastest((smooth.x, smooth.y), target, following, cruise)
        moving = math.hypot(smooth.vx, smooth.vy)
        aligned = (smooth.vx * to_x + smooth.vy * to_y) / (moving * away) if moving and away else 1.0
        aim_x, aim_y = to_x, to_y
        if moving > 0.2 and aligned < 0.98 and away > RADIUS:  # turning: join the line further ahead
            speed = min(self.before_turn, speed)
            is_behind = (target[0] - start[0]) * to_x + (target[1] - start[1]) * to_y < 0
            aim_x, aim_y = (to_x, to_y) if is_behind else _ahead(start, target, (smooth.x, smooth.y))
        else:
            self.before_turn = speed
        aim = math.hypot(aim_x, aim_y)
        vx, vy = (aim_x / aim * speed, aim_y / aim * speed) if aim > 1e-6 else (0.0, 0.0)
        rise = target[2] - smooth.z
        limit, most = (up, ACC_UP) if rise > 0 else (V_DOWN, ACC_DOWN)
        vz = math.copysign(min(limit, _from_distance(abs(rise), 0.0, most)), rise)
        self.step(vx, vy, vz)

    def go(self, start: Vector, target: Vector, following: Vector, cruise: float) -> None:
        """Fly until a target is reached within the acceptance radii."""
        while self.log.seconds < _LONGEST_S:
            x, y, z = self.body.position
            if math.hypot(target[0] - x, target[1] - y) < RADIUS and abs(target[2] - z) < ALT_RADIUS:
                return
            self.towards(start, target, following, cruise)


def fly(height: float, stops: list[Stop], returns: bool, wind: Vector = (0.0, 0.0, 0.0)) -> Log:
    """Fly a route from home and back, as `benchmarks.flight.route` gives it."""
    px4 = Px4(wind)
    px4.log.stand(px4.body, SPOOL_S + RAMP_S / 2)  # the speed of the climb rises evenly
    place: Vector = (0.0, 0.0, height)
    while abs(px4.body.position[2] - height) > ALT_RADIUS:
        slow = TAKEOFF_SPEED if px4.body.position[2] < LAND_1 else V_UP
        px4.towards(place, place, place, CRUISE, slow)
    px4.log.begin = len(px4.log.track)
    for k, stop in enumerate(stops):
        last = stop.hold_s > 0 or k + 1 == len(stops)
        px4.heading = _heading(place, stop.place, px4.heading)
        px4.go(place, stop.place, stop.place if last else stops[k + 1].place, stop.speed)
        for _ in range(round(stop.hold_s / DT)):
            px4.towards(place, stop.place, stop.place, stop.speed)
        place = stop.place
        if k + 1 < len(stops):
            px4.heading = _heading(place, stops[k + 1].place, px4.heading)
        for action in stop.actions:
            px4.log.act(action, px4.body)
    if returns:
        _return(px4)
    return px4.log


def _return(px4: Px4) -> None:
    """Up within the cone, home, down to the height where it lands, land."""
    x, y, z = px4.body.position
    above = max(min(RETURN_HEIGHT, math.hypot(x, y)), z)
    px4.go((x, y, z), (x, y, above), (x, y, above), CRUISE)
    px4.go((x, y, above), (0.0, 0.0, above), (0.0, 0.0, above), CRUISE)
    px4.log.end = len(px4.log.track)
    low = (0.0, 0.0, min(DESCEND_HEIGHT, above))
    px4.go((0.0, 0.0, above), low, low, CRUISE)
    while px4.body.position[2] > 0.05 and px4.log.seconds < _LONGEST_S:
        share = min(max((px4.body.position[2] - LAND_2) / (LAND_1 - LAND_2), 0.0), 1.0)
        smooth = px4.smooth
        away = math.hypot(smooth.x, smooth.y)
        speed = _from_distance(away, 0.0, ACC_HOR) / away if away > 1e-3 else 0.0
        px4.step(-smooth.x * speed, -smooth.y * speed, -(LAND_SPEED + share * (V_DOWN - LAND_SPEED)))
    px4.log.stand(px4.body, DISARM_S)


def _from_distance(distance: float, final: float, acceleration: float) -> float:
    """Speed from which it brakes to a final speed; it is as if acceleration had to be turned round first."""
    b = 4 * acceleration * acceleration / JERK_AUTO
    c = -2 * acceleration * distance - final * final
    return max((-b + math.sqrt(b * b - 4 * c)) / 2, final)


def _fastest(here: tuple[float, float], target: Vector, following: Vector, cruise: float) -> float:
    """Speed over ground that lets it take the corner at the target."""
    to_next = math.hypot(following[0] - target[0], following[1] - target[1])
    corner = 0.0
    if to_next > 0.001 and to_next >= RADIUS:
        ix, iy = target[0] - here[0], target[1] - here[1]
        ox, oy = target[0] - following[0], target[1] - following[1]
        size = math.hypot(ix, iy) * to_next
        angle = math.acos(min(max((ix * ox + iy * oy) / size, -1.0), 1.0)) if size else math.pi / 2
        circle = math.sqrt(TRAJ_P * ACC_HOR * RADIUS * math.tan(min(angle, math.pi - 1e-6) / 2))
        corner = min(circle, min(cruise, _from_distance(to_next, 0.0, ACC_HOR)), cruise)
    away = math.hypot(target[0] - here[0], target[1] - here[1])
    return min(cruise, _from_distance(away, corner, ACC_HOR))


def _ahead(start: Vector, target: Vector, here: tuple[float, float]) -> tuple[float, float]:
    """From here to the point of the line that is 5 m away (L1 guidance)."""
    lx, ly = target[0] - start[0], target[1] - start[1]
    length = math.hypot(lx, ly)
    if length < 1e-6:
        return target[0] - here[0], target[1] - here[1]
    ux, uy = lx / length, ly / length
    along = (here[0] - start[0]) * ux + (here[1] - start[1]) * uy
    nearest = (start[0] + along * ux, start[1] + along * uy)
    aside = math.dist(nearest, here)
    forward = math.sqrt(25 - aside * aside) if aside < 5 else 0.0
    return nearest[0] + forward * ux - here[0], nearest[1] + forward * uy - here[1]


def _heading(start: Vector, end: Vector, otherwise: float) -> float:
    if math.dist(start[:2], end[:2]) < 1e-3:
        return otherwise
    return math.atan2(end[0] - start[0], end[1] - start[1])
