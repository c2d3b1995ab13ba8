"""Times of legs: laws of motion, and comparison with an integration in small steps."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import arrays

from uavseg.flight.mission.duration import STEP_S, leg_seconds, ramp_seconds, ramp_start
from uavseg.flight.mission.vehicle import ARDUCOPTER, PX4, Vehicle

VEHICLES = pytest.mark.parametrize("vehicle", [ARDUCOPTER, PX4], ids=lambda vehicle: vehicle.turns)
PATHS = arrays(
    np.float64,
    st.tuples(st.integers(2, 12), st.just(3)),
    elements=st.floats(-200, 200).map(lambda value: round(value, 2)),
)


def level(*corners: tuple[float, float]) -> np.ndarray:
    return np.array([(x, y, 40.0) for x, y in corners])


def turning(angle_deg: float) -> np.ndarray:
    """Two legs of 100 m with an angle between their directions."""
    angle = np.radians(angle_deg)
    return level((0, 0), (100, 0), (100 + 100 * np.cos(angle), 100 * np.sin(angle)))


@VEHICLES
@given(path=PATHS, speed=st.floats(0.5, 20))
@settings(max_examples=60)
def test_no_leg_is_faster_than_its_limits_allow(vehicle: Vehicle, path: np.ndarray, speed: float) -> None:
    seconds = leg_seconds(path, speed, vehicle)
    assert np.isfinite(seconds).all() and (seconds >= 0).all()
    legs = np.diff(path, axis=0)
    flat, up = np.hypot(legs[:, 0], legs[:, 1]), legs[:, 2]
    vertical = np.where(up > 0, up / vehicle.climb_m_s, -up / vehicle.descent_m_s)
    # each corner may be cut by the radius, on either side
    cut = 2 * vehicle.radius_m
    assert (seconds >= np.maximum((flat - cut) / speed, (vertical - cut / vehicle.descent_m_s)) - 1e-6).all()


@VEHICLES
@pytest.mark.parametrize("speed", [3.0, 5.0, 12.0])
def test_a_point_on_a_straight_line_costs_nothing(vehicle: Vehicle, speed: float) -> None:
    whole = leg_seconds(level((0, 0), (400, 0)), speed, vehicle).sum()
    parts = leg_seconds(level((0, 0), (130, 0), (400, 0)), speed, vehicle).sum()
    assert parts == pytest.approx(whole, rel=0.01)


@VEHICLES
def test_sharper_turns_and_stops_take_longer(vehicle: Vehicle) -> None:
    times = [leg_seconds(turning(angle), 8.0, vehicle).sum() for angle in range(0, 181, 20)]
    # PX4 turns within its radius: where the next leg leads back, a part of it need not be flown
    assert (np.diff(times) >= (-1e-9 if vehicle.turns == "blend" else -0.2)).all()
    assert times[-1] > times[0] + 2
    stopped = leg_seconds(turning(0), 8.0, vehicle, np.array([False, True, False])).sum()
    assert stopped > times[0] + 2


@VEHICLES
@given(path=PATHS, turn_deg=st.floats(0, 360), shift=st.floats(-1e4, 1e4))
@settings(max_examples=30)
def test_a_path_takes_as_long_wherever_it_points(
    vehicle: Vehicle, path: np.ndarray, turn_deg: float, shift: float
) -> None:
    sine, cosine = np.sin(np.radians(turn_deg)), np.cos(np.radians(turn_deg))
    turned = path @ np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]]) + shift
    here, there = leg_seconds(path, 6.0, vehicle), leg_seconds(turned, 6.0, vehicle)
    # an integration ends each leg with a whole step: its two ends may each be one step away
    assert there == pytest.approx(here, rel=1e-3, abs=2.01 * STEP_S)


def test_legs_of_arducopter_take_as_long_backwards() -> None:
    path = np.random.default_rng(1).uniform(0, 120, (30, 2))
    flat = np.column_stack([path, np.full(30, 40.0)])
    forth, back = leg_seconds(flat, 7.0, ARDUCOPTER), leg_seconds(flat[::-1], 7.0, ARDUCOPTER)
    assert forth == pytest.approx(back[::-1])


@VEHICLES
def test_equal_points_are_not_flown_to_and_keep_their_stop(vehicle: Vehicle) -> None:
    path = level((0, 0), (100, 0), (100, 0), (200, 0))
    free = leg_seconds(path, 5.0, vehicle)
    held = leg_seconds(path, 5.0, vehicle, np.array([False, False, True, False]))
    assert free[1] == held[1] == 0
    assert held.sum() > free.sum() + 1
    assert leg_seconds(level((3, 4)), 5.0, vehicle).shape == (0,)
    assert leg_seconds(level((3, 4), (3, 4)), 5.0, vehicle).tolist() == [0]


@VEHICLES
def test_each_leg_has_its_own_speed(vehicle: Vehicle) -> None:
    path = level((0, 0), (300, 0), (600, 0))
    slow = leg_seconds(path, np.array([10.0, 2.0]), vehicle)
    assert slow[0] < 300 / 10 + 12 and slow[1] > 300 / 2 - 8  # PX4 enters the slow leg fast, and brakes then


@pytest.mark.parametrize("change", [0.3, 2.0, 6.0, 9.0, 25.0])
@pytest.mark.parametrize("rise", [0.0, 0.3])
def test_a_ramp_ends_at_its_speed(change: float, rise: float) -> None:
    """The acceleration is integrated in small steps: it rises with the jerk, stays, and falls."""
    whole = ramp_seconds(change, 2.5, 1.0, rise)
    peak = min(2.5, np.sqrt(rise * rise / 4 + change) - rise / 2)  # u (u + r) = dv / j, where no limit holds
    t = np.linspace(0, whole, 200_001)
    grows = peak / 1.0 + rise
    acceleration = np.minimum(np.minimum(t, whole - t) / grows, 1) * peak
    speed = np.concatenate([[0], np.cumsum((acceleration[1:] + acceleration[:-1]) / 2 * np.diff(t))])
    assert speed[-1] == pytest.approx(change, rel=1e-3)
    way = np.concatenate([[0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(t))])
    assert way[-1] == pytest.approx(change * whole / 2, rel=1e-3)  # the mean speed is half of the change
    early = np.searchsorted(t, whole * np.array([0.1, 0.3, 0.5]))
    for k in early.tolist():
        found_way, found_speed, _ = ramp_start(float(t[k]), change, 2.5, 1.0, rise)
        assert found_way == pytest.approx(way[k], rel=5e-3)
        assert found_speed == pytest.approx(speed[k], rel=5e-3)


def test_more_agile_vehicles_are_faster() -> None:
    path = np.column_stack([np.random.default_rng(2).uniform(0, 200, (20, 2)), np.full(20, 30.0)])
    for vehicle in (ARDUCOPTER, PX4):
        usual = leg_seconds(path, 9.0, vehicle).sum()
        for change in ({"acceleration_m_s2": 5.0, "jerk_m_s3": 20.0}, {"jerk_m_s3": 20.0}, {"radius_m": 6.0}):
            assert leg_seconds(path, 9.0, replace(vehicle, **change)).sum() < usual
