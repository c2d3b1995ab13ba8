"""What legs take before a route is divided: as much as the flights that are made of it."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import shapely

from tests.flight.terrain.dems import HOME, draw, hills
from uavseg.flight.camera.camera import Camera, Photos
from uavseg.flight.mission.duration import leg_seconds
from uavseg.flight.mission.track import Plane, Track
from uavseg.flight.mission.vehicle import PX4
from uavseg.flight.params.plan import LimitParams, PlanParams, SafetyParams, TerrainParams
from uavseg.flight.planning import flights
from uavseg.flight.planning.flights import LegCosts
from uavseg.flight.planning.planner import plan_missions
from uavseg.flight.terrain.altitude_profile import points_of_leg
from uavseg.raster.elevation.dem import Dem

PLANE = Plane(*HOME)
FIELDS = [
    shapely.transform(shapely.box(*bounds), lambda xy: np.column_stack(PLANE.lonlat_from_xy(*xy.T)))
    for bounds in ((-350, -250, -150, -100), (50, 50, 350, 280), (100, -280, 300, -120))
]
CAMERA = Camera("slow", (13.2, 8.8), (5472, 3648), 8.8, 2.5)


def test_level_legs_of_one_speed_take_their_time_and_no_items() -> None:
    track = Track.of_path(np.array([[0.0, 0.0], [200.0, 0.0], [200.0, 90.0], [200.0, 100.0]]))
    seconds, items = LegCosts(PLANE, PlanParams(40, autopilot="px4")).of(track)
    xyz = np.column_stack([track.xy, np.full(4, 40.0)])
    assert seconds == pytest.approx(leg_seconds(xyz, 5.0, PX4)) and not items.any()
    assert [len(part) for part in LegCosts(PLANE, PlanParams(40)).of(Track.of_path(track.xy[:1]))] == [0, 0]


def test_a_height_in_whole_metres_takes_as_long_as_one_with_decimals() -> None:
    home, places = np.array([0.4, 0.3]), np.array([[18.7, -4.2], [0.9, 30.8]])
    length = np.hypot(*(places - home).T)
    whole, exact = (LegCosts(PLANE, PlanParams(height)) for height in (50, 50.0))
    assert np.array_equal(whole.ways(home, places, length), exact.ways(home, places, length))
    track = Track.of_path(places)
    assert np.array_equal(whole.of(track)[0], exact.of(track)[0])


def test_legs_over_hills_take_the_time_of_their_points_one_by_one(tmp_path: Path) -> None:
    dem = Dem.open(draw(tmp_path / "a.tif", hills(120)))
    params = PlanParams(60, autopilot="px4", terrain=TerrainParams(dem))
    track = Track.of_path(np.array([[-300.0, -200.0], [400.0, 100.0], [450.0, 100.0], [0.0, 350.0]]))
    path, speeds, ends = [], [], [0]
    for start, end in pairwise(track.xy):
        (west, east), (south, north) = PLANE.lonlat_from_xy(*np.stack([start, end], axis=1))
        points = points_of_leg(dem, (west, south, east, north, 5.0), params)
        if not path:
            path.append([*start, points.height_m[0]])
        for share, height in zip(points.share, points.height_m[1:], strict=True):
            path.append([*(start + share * (end - start)), height])
        speeds.extend(points.speed_m_s)
        ends.append(len(path) - 1)
    expected = leg_seconds(np.array(path), np.array(speeds), PX4)
    seconds, items = LegCosts(PLANE, params).of(track)
    assert seconds == pytest.approx([expected[a:b].sum() for a, b in pairwise(ends)])
    assert (items >= np.diff(ends) - 1).all() and len(path) > len(track.xy)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "autopilot"),
    [
        *(("hover", "px4"), ("slow", "ardupilot"), ("hills", "px4")),
        *(
            pytest.param(*case, marks=pytest.mark.thorough)
            for case in (("hover", "ardupilot"), ("slow", "px4"), ("hills", "ardupilot"))
        ),
    ],
)
def test_a_division_is_right_the_first_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, autopilot: str, kind: str
) -> None:
    how = {
        "hover": {"photos": Photos(CAMERA, trigger="hover"), "limits": LimitParams(endurance_min=16.0)},
        "slow": {"photos": Photos(CAMERA), "limits": LimitParams(max_items=60), "speed_m_s": 12.0},
        "hills": {
            "terrain": TerrainParams(Dem.open(draw(tmp_path / "a.tif", hills(120)))),
            "limits": LimitParams(max_items=70),
            "safety": SafetyParams(max_altitude_m=200),
        },
    }[kind]
    params = PlanParams(60, "survey", 30.0, autopilot=autopilot, **how)
    divisions = []
    split = flights.split_route

    def counted(*given: object) -> list[Track]:
        divisions.append(split(*given))  # type: ignore[arg-type]
        return divisions[-1]

    monkeypatch.setattr(flights, "split_route", counted)
    points = [tuple(field.centroid.coords[0]) for field in FIELDS]
    missions = plan_missions(FIELDS, points, params, (*HOME, 600.0) if kind != "hills" else HOME)
    assert len(missions) > 1 and len(divisions) == 1
    # and it wastes little: all but one flight are more than half full
    most = params.limits
    if most.max_items:
        full = [len(mission.items) / most.max_items for mission in missions]
    else:
        full = [mission.duration_s / most.seconds for mission in missions]
    assert sorted(full)[1] > 0.5
