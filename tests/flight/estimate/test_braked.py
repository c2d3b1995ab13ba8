"""Time of legs as PX4 flies them: laws, and limits that no vehicle has."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from uavseg.flight.mission.duration import leg_seconds
from uavseg.flight.mission.vehicle import NUMBERS, PX4


def circle(sides: int, radius: float) -> np.ndarray:
    angle = np.linspace(0, 2 * np.pi, sides + 1)
    return np.column_stack([radius * np.sin(angle), -radius * np.cos(angle), np.full(sides + 1, 30.0)])


@given(sides=st.integers(3, 90), radius=st.floats(2, 150), speed=st.floats(0.5, 20))
@settings(max_examples=80)
def test_short_legs_are_not_flown_faster_than_the_speed(sides: int, radius: float, speed: float) -> None:
    path = circle(sides, radius)
    length = np.hypot(*np.diff(path[:, :2], axis=0).T)
    cut = 2 * PX4.radius_m + 0.05 * speed  # a corner is reached within the radius, and within a step
    assert (leg_seconds(path, speed, PX4) >= (length - cut) / speed - 1e-6).all()
    # the corners may be cut, but the path from the first to the last is no shorter than a circle inside
    inside = 2 * np.pi * (radius * np.cos(np.pi / sides) - PX4.radius_m)
    assert leg_seconds(path, speed, PX4).sum() >= inside / speed - 1


@pytest.mark.parametrize("speed", [0.001, 0.2, 5.0, 50.0])
@pytest.mark.parametrize("rise", [0.0, 60.0, -20.0])
def test_a_long_leg_takes_its_length_over_its_speed(speed: float, rise: float) -> None:
    path = np.array([(0, 0, 40.0), (20_000.0, 0, 40 + rise)])
    ramps_s = 2 * speed / PX4.acceleration_m_s2 + 6
    fast = replace(PX4, airspeed_m_s=60.0)
    assert 0 <= leg_seconds(path, speed, fast).sum() - (20_000 - 2) / speed <= ramps_s


@pytest.mark.parametrize("rise", [30.0, -30.0])
def test_a_steep_leg_takes_its_height_over_its_rate(rise: float) -> None:
    rate = PX4.climb_m_s if rise > 0 else PX4.descent_m_s
    seconds = leg_seconds(np.array([(0, 0, 60.0), (20.0, 0, 60 + rise)]), 5.0, PX4).sum()
    assert 0 <= seconds - (30 - 0.8) / rate <= 6


def test_a_brief_hold_leaves_more_way_than_a_long_one() -> None:
    path = np.array([(12.0 * k, 5.0 * (k % 2), 40.0) for k in range(6)])
    times = [
        leg_seconds(path, 5.0, PX4, np.full(6, True), np.full(6, hold)).sum() for hold in (0.2, 1, 30, 300)
    ]
    assert times[2] == pytest.approx(times[3], abs=0.1)
    assert times[0] != pytest.approx(times[3], abs=0.1)


@pytest.mark.slow
@given(
    key=st.sampled_from([key for key in NUMBERS if "_w" not in key and key != "battery_wh"]),
    factor=st.sampled_from([1e-6, 1e-3, 0.1, 10.0, 1e3, 1e6]),
    seed=st.integers(0, 99),
)
@settings(max_examples=60)
def test_vehicles_with_unusual_limits_arrive(key: str, factor: float, seed: int) -> None:
    path = np.random.default_rng(seed).uniform(-100, 100, (4, 3))
    vehicle = replace(PX4, **{key: getattr(PX4, key) * factor})
    seconds = leg_seconds(path, 5.0, vehicle)
    assert np.isfinite(seconds).all() and (seconds >= 0).all()
    flat = np.hypot(*np.diff(path[:, :2], axis=0).T)
    assert (seconds >= (flat - 2 * vehicle.radius_m) / 5.0 - 1e-6).all()
