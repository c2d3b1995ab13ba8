"""Margins hold in the air: simulated vehicles leave their legs by less than the bound, in wind too."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from benchmarks.flight import arducopter, log, px4
from benchmarks.flight.route import Stop, route
from tests.flight.small_regions import box, planned
from uavseg.errors import MissionError
from uavseg.flight.mission.track import Plane
from uavseg.flight.mission.vehicle import default_vehicle
from uavseg.flight.params.plan import SafetyParams

SIMULATED = {"ardupilot": arducopter.fly, "px4": px4.fly}
PLANE = Plane(47.0, 8.0)


@pytest.fixture(autouse=True)
def every_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(log, "EVERY", 1)


@pytest.mark.slow
@pytest.mark.parametrize("autopilot", SIMULATED)
@pytest.mark.parametrize("wind_m_s", [0.0, 8.0])
@pytest.mark.parametrize("speed_m_s", [2.0, 5.0, 14.0, 20.0])
def test_a_vehicle_leaves_its_legs_by_less_than_the_bound(
    autopilot: str, wind_m_s: float, speed_m_s: float
) -> None:
    bound = default_vehicle(autopilot).deviation_m(speed_m_s)
    for seed in range(4):
        rng = np.random.default_rng(seed)
        turn = np.cumsum(rng.uniform(-np.pi, np.pi, 6) * rng.choice([1, 0.3]))
        length = np.exp(rng.uniform(np.log(3), np.log(150), 6))
        xy = np.cumsum(np.column_stack([length * np.cos(turn), length * np.sin(turn)]), axis=0)
        towards = rng.uniform(0, 2 * np.pi)
        wind = (wind_m_s * np.cos(towards), wind_m_s * np.sin(towards), 0.0)
        stops = [Stop((x, y, 40.0), speed_m_s, float(rng.choice([0, 0, 1]))) for x, y in xy.tolist()]
        flown = SIMULATED[autopilot](40.0, stops, False, wind)
        track = np.array(flown.track)[flown.begin :, :2]
        legs = shapely.LineString(np.vstack([[0, 0], xy]))
        assert shapely.distance(legs, shapely.points(track)).max() < bound


@pytest.mark.slow
@given(
    st.sampled_from(list(SIMULATED)),
    st.sampled_from([0.0, 8.0]),
    st.sampled_from([5.0, 14.0]),
    st.sampled_from([0.0, 1.0, 3.0]),
    st.integers(0, 10**6),
)
@settings(max_examples=6, deadline=None)
def test_a_planned_flight_keeps_its_margin_in_the_air(
    autopilot: str, wind_m_s: float, speed_m_s: float, margin_m: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    zones = [
        box(*rng.uniform([20, -150], [200, 150]).tolist(), *rng.uniform(2, 40, 2).tolist()) for _ in range(4)
    ]
    regions = [box(60, -60, 60, 50), box(150, 0, 40, 90)]
    how = {"pattern": "survey", "spacing_m": 15.0} if seed % 2 else {"pattern": "perimeter"}
    try:
        mission = planned(
            regions,
            zones=zones,
            safety=SafetyParams(margin_m),
            speed_m_s=speed_m_s,
            autopilot=autopilot,
            **how,
        )
    except MissionError:
        return
    towards = rng.uniform(0, 2 * np.pi)
    wind = (wind_m_s * np.cos(towards), wind_m_s * np.sin(towards), 0.0)
    flown = SIMULATED[autopilot](*route(mission), wind)
    track = np.array(flown.track)[flown.begin : flown.end, :2]
    kept = shapely.union_all(PLANE.project_polygons(zones))
    assert shapely.distance(kept, shapely.points(track)).min() >= margin_m
