"""Wind: the triangle of velocities, estimates against a simulated body in wind and gusts, and reserves."""

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from benchmarks.flight.fields import drawn
from benchmarks.flight.measured import fly
from benchmarks.flight.plans import planned
from tests.flight.small_regions import box, flights
from uavseg.errors import MissionError, ParameterError
from uavseg.flight.mission.duration import leg_seconds
from uavseg.flight.mission.estimate import estimate
from uavseg.flight.mission.vehicle import ARDUCOPTER, DIRECTIONS, PX4, Wind
from uavseg.flight.params.plan import LimitParams, PlanParams


@pytest.mark.slow
@given(
    speed=st.floats(0.0, 9.0),
    towards=st.floats(0, 360),
    from_deg=st.floats(-360, 360),
    air=st.floats(10.5, 30),
)
@settings(max_examples=200)
def test_the_velocity_over_ground_is_that_through_the_air_and_the_wind(
    speed: float, towards: float, from_deg: float, air: float
) -> None:
    leg = 100 * np.array([[math.sin(math.radians(towards)), math.cos(math.radians(towards))]])
    [over_ground] = Wind(speed, from_deg).over_ground_m_s(leg, air)
    to = math.radians(from_deg + 180)
    through_air = over_ground * leg[0] / 100 - speed * np.array([math.sin(to), math.cos(to)])
    assert np.hypot(*through_air) == pytest.approx(air)
    assert air - speed - 1e-9 <= over_ground <= air + speed + 1e-9


@given(seed=st.integers(0, 10**6), speed=st.floats(1, 9), from_deg=st.floats(0, 360), turn=st.floats(0, 360))
@settings(max_examples=60, deadline=None)
def test_a_turned_flight_in_a_turned_wind_takes_as_long(
    seed: int, speed: float, from_deg: float, turn: float
) -> None:
    path = np.random.default_rng(seed).uniform(-300, 300, (6, 3))
    path[:, 2] = 40
    c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    turned = np.column_stack([path[:, :2] @ np.array([[c, -s], [s, c]]), path[:, 2]])
    for vehicle in (ARDUCOPTER, PX4):
        first = leg_seconds(path, 8.0, vehicle, wind=Wind(speed, from_deg)).sum()
        second = leg_seconds(turned, 8.0, vehicle, wind=Wind(speed, (from_deg + turn) % 360)).sum()
        assert first == pytest.approx(second, rel=0.02)
        assert first >= leg_seconds(path, 8.0, vehicle).sum() * (1 - 1e-9)


WINDS = [(0.0, 0.0), (6.0, 225.0), (8.0, 90.0), (8.0, 0.0), (10.0, 45.0)]


@pytest.mark.slow
@pytest.mark.parametrize(("speed_m_s", "from_deg"), WINDS)
@pytest.mark.parametrize(("pattern", "speed"), [("survey", 8.0), ("perimeter", 10.0), ("survey", 14.0)])
def test_estimates_agree_with_a_simulated_body_in_wind(
    speed_m_s: float, from_deg: float, pattern: str, speed: float
) -> None:
    [mission] = planned(
        drawn()[0],
        pattern=pattern,
        camera="DJI Mavic 3 Enterprise" if pattern == "survey" else None,
        height_m=50.0,
        speed=speed,
    )
    to = math.radians(from_deg + 180)
    blowing = (speed_m_s * math.sin(to), speed_m_s * math.cos(to), 0.0)
    flown_s = fly(mission, blowing).seconds
    off = estimate(mission, wind=Wind(speed_m_s, from_deg)).duration_s / flown_s - 1
    assert -0.01 < off < (0.07 if speed_m_s else 0.03)
    if speed_m_s:
        gusty_s = fly(mission, blowing, gust_m_s=1.0).seconds
        assert abs(estimate(mission, wind=Wind(speed_m_s, from_deg)).duration_s / gusty_s - 1) < 0.1


def test_a_wind_from_any_direction_is_the_worst_of_its_directions() -> None:
    [mission] = flights([box(100, 100, 300, 150)], pattern="survey", spacing_m=30.0, speed_m_s=8.0)
    of_each = [estimate(mission, wind=Wind(7.0, k * 360 / DIRECTIONS)).duration_s for k in range(DIRECTIONS)]
    worst = estimate(mission, wind=Wind(7.0))
    assert worst.duration_s == max(of_each) > min(of_each) > estimate(mission).duration_s
    assert worst.wind_m_s == 7.0 and estimate(mission).wind_m_s == 0.0


def test_what_cannot_be_flown_against_is_refused() -> None:
    with pytest.raises(MissionError, match=r"a leg towards 90 degrees .* wind of 11\.5 m/s from 90 degrees"):
        leg_seconds(np.array([[0, 0, 40.0], [100, 0, 40]]), 5.0, ARDUCOPTER, wind=Wind(11.5, 90.0))
    with pytest.raises(MissionError, match=r"wait for less wind.*--vehicle"):
        flights([box(100, 100, 300, 150)], wind=Wind(12.0))
    up = np.array([[0, 0, 0.0], [0, 0, 40]])
    assert (
        leg_seconds(up, 5.0, ARDUCOPTER, wind=Wind(20.0, 0.0)).sum() == leg_seconds(up, 5.0, ARDUCOPTER).sum()
    )
    for wrong in ((-1.0, 0.0), (51.0, 0.0), (math.nan, 0.0), (5.0, 361.0), (5.0, math.nan)):
        with pytest.raises(ParameterError):
            Wind(*wrong)


@pytest.mark.slow
@given(
    seed=st.integers(0, 10**6),
    wind=st.sampled_from([None, Wind(3.0), Wind(8.0), Wind(6.0, 200.0)]),
    minutes=st.floats(9, 20),
)
@settings(max_examples=6, deadline=None)
def test_flights_fit_in_the_wind_that_they_are_planned_for(
    seed: int, wind: Wind | None, minutes: float
) -> None:
    draw = np.random.default_rng(seed)
    regions = [box(*draw.uniform(-500, 500, 2), *draw.uniform(40, 160, 2)) for _ in range(3)]
    limits = LimitParams(endurance_min=minutes)
    plan = {"pattern": "survey", "spacing_m": 25.0, "speed_m_s": 8.0, "limits": limits, "wind": wind}
    found = flights(regions, **plan)
    assert all(estimate(one, wind=wind or Wind(0.0)).duration_s <= limits.seconds for one in found)
    assert all(one.wind == wind for one in found)
    if wind is None:
        [note] = [text for text in found[0].notes if "the reserve of" in text]
        holds = float(re.search(r"up to (\d+) m/s", note).group(1)) if "up to" in note else 0.0
        longest = [max(estimate(one, wind=Wind(w)).duration_s for one in found) for w in (holds, holds + 1)]
        assert longest[0] <= limits.seconds and (holds >= 10 or longest[1] > limits.seconds)


def test_a_speed_that_no_air_allows_is_said() -> None:
    [mission] = flights([box(100, 100, 300, 150)], speed_m_s=14.0)
    assert any("more than the 11.7 m/s" in note for note in mission.notes)
    assert PlanParams(50).wind is None


@pytest.mark.slow
@pytest.mark.parametrize("from_deg", [0.0, 50.0, 90.0, 240.0])
def test_the_angle_follows_the_wind(from_deg: float) -> None:
    wind = Wind(8.0, from_deg)
    survey = {"pattern": "survey", "spacing_m": 30.0, "speed_m_s": 10.0, "angle_deg": None}
    [calm] = flights([box(60, 40, 320, 290)], **survey)
    [windy] = flights([box(60, 40, 320, 290)], **survey, wind=wind)
    assert windy.duration_s <= estimate(calm, wind=wind).duration_s * 1.001
    assert windy.duration_s < max(
        flights([box(60, 40, 320, 290)], **survey | {"angle_deg": angle}, wind=wind)[0].duration_s
        for angle in (0.0, 90.0)
    )
