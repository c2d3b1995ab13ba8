"""Coverage: gaps are what no footprint shows, and what the next flight photographs makes the area whole."""

import math
from collections.abc import Sequence
from dataclasses import replace
from random import Random
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st
from matplotlib.path import Path as Outline

from tests.flight.small_regions import box, degrees, inside
from uavseg.errors import MissionError, PhotographError
from uavseg.flight.camera.camera import Camera, Overlap, Photos, camera_named
from uavseg.flight.mission.items import CAMERA_DISTANCE, ROI_LOCATION, MissionItem
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.track import Plane
from uavseg.flight.params.plan import PlanParams, SurveyParams
from uavseg.flight.planning.planner import plan_missions
from uavseg.jobs.flights.check import gap_regions
from uavseg.photographs.coverage import COVERED, LOST, Coverage, Planned, coverage, planned_photographs
from uavseg.photographs.ground import Ground
from uavseg.photographs.read import Photograph

CAMERA = camera_named("DJI Phantom 4 Pro")
HOME = (47.0, 8.0, 430.0)
FIELD = box(50, 50, 300, 200)
FLAT = Ground(home=HOME)


def survey(
    regions: Sequence[Any] = (FIELD,),
    altitude_m: float = 60.0,
    overlap: tuple[float, float] = (75, 70),
    trigger: str = "distance",
    home: tuple[float, ...] = HOME,
    angle_deg: float | None = 0.0,
    autopilot: str = "ardupilot",
    **how: Any,
) -> Mission:
    photos = Photos(CAMERA, Overlap(*overlap), trigger=trigger)
    params = PlanParams(
        altitude_m=altitude_m,
        pattern="survey",
        spacing_m=photos.spacing_m(altitude_m),
        angle_deg=angle_deg,
        photos=photos,
        autopilot=autopilot,
        how=SurveyParams(**how),
    )
    (mission,) = plan_missions(list(regions), inside(regions), params, home)
    return mission


def lens(camera: Camera = CAMERA) -> tuple[tuple[int, int], float]:
    return camera.image_px, camera.focal_mm / camera.sensor_mm[0] * camera.image_px[0]


def planned(mission: Mission) -> Planned:
    return planned_photographs(mission, lens())


def corners(photograph: Photograph, plane: Plane) -> Any:
    """What a photograph straight down shows of flat ground, from its height and its lens alone."""
    x, y = plane.xy_from_lonlat(photograph.lon, photograph.lat)
    half = np.array(photograph.image_px) / 2 / photograph.focal_px * photograph.relative_m
    yaw = math.radians(photograph.yaw_deg)
    right, ahead = np.array([math.cos(yaw), -math.sin(yaw)]), np.array([math.sin(yaw), math.cos(yaw)])
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    return np.array([np.array([x, y]) + a * half[0] * right + b * half[1] * ahead for a, b in signs])


def cells_seen(polygon: Any, photographs: Sequence[Photograph], plane: Plane, side_m: float) -> Any:
    """Middles of cells in a polygon (degrees), and how many photographs show each: a slow reference."""
    (area,) = plane.project_polygons([polygon])
    west, south, east, north = area.bounds
    x, y = np.meshgrid(np.arange(west, east, side_m), np.arange(south, north, side_m))
    places = np.column_stack([x.ravel(), y.ravel()]) + side_m / 2
    places = places[shapely.contains_xy(area, places)]
    counts = np.zeros(len(places), int)
    for one in photographs:
        counts += Outline(corners(one, plane)).contains_points(places)
    return places, counts


def in_metres(found: Coverage, plane: Plane) -> Any:
    return shapely.union_all(plane.project_polygons(found.gaps)) if found.gaps else shapely.Polygon()


def seen(found: Coverage) -> tuple[float, float, float]:
    return found.covered, found.seen_twice, found.seen_three_times


def cut(polygon: Any, plane: Plane) -> Any:
    """A polygon in metres that crosses the antimeridian, in degrees, cut there."""
    turned = shapely.transform(degrees(polygon, plane), lambda lonlat: lonlat + [360, 0] * (lonlat < 0))
    parts = [turned & shapely.box(179, -90, 180, 0), turned & shapely.box(180, -90, 181, 0)]
    return shapely.MultiPolygon([parts[0], shapely.transform(parts[1], lambda lonlat: lonlat - [360, 0])])


ACROSS = cut(shapely.box(-90, 30, 160, 190), Plane(-16.8, 179.9995))
SOUTH = degrees(shapely.box(20, 30, 190, 160), Plane(-33.9, 151.2))
SURVEYS: list[dict[str, Any]] = [
    {},
    {"trigger": "interval"},
    {"trigger": "hover", "altitude_m": 40.0, "overlap": (60, 60)},
    {"angle_deg": 33.0, "overlap": (80, 40)},
    {"regions": [FIELD, box(450, 100, 90, 130)], "autopilot": "px4"},
    {"home": (-33.9, 151.2, 12.0), "regions": [SOUTH]},
    {"home": (-16.8, 179.9995, 3.0), "regions": [ACROSS]},
]


@pytest.mark.slow
@pytest.mark.parametrize("how", SURVEYS)
def test_all_planned_photographs_are_whole(how: dict[str, Any]) -> None:
    mission = survey(**how)
    plan = planned(mission)
    assert len(plan.photographs) == mission.estimate.photographs
    for area in ((), tuple(how.get("regions", [FIELD]))):
        found = coverage(mission, plan.photographs, Ground(home=mission_home(mission)), area=area)
        assert found.covered == pytest.approx(1, abs=1e-9) and found.is_whole and not found.gaps
        assert (found.missing, found.others, found.planned) == ((), 0, found.taken)
        assert found.overlap == found.planned_overlap


def mission_home(mission: Mission) -> tuple[float, ...]:
    return mission.home.lat, mission.home.lon, mission.home.altitude_m


@pytest.mark.slow
def test_overlaps_are_those_that_were_asked_for() -> None:
    for front, side in ((75, 70), (60, 40), (85, 20)):
        found = coverage(
            survey(overlap=(front, side)), planned(survey(overlap=(front, side))).photographs, FLAT
        )
        along, beside = found.overlap["along"], found.overlap["beside"]
        assert along is not None and beside is not None
        assert front / 100 - 1e-3 < along["least"] <= along["median"] < front / 100 + 0.05
        assert side / 100 - 1e-3 < beside["least"] <= beside["median"] < side / 100 + 0.1


@pytest.mark.slow
def test_a_line_that_is_left_out_leaves_exactly_its_strip() -> None:
    mission = survey(overlap=(75, 40))
    plan, plane = planned(mission), Plane(*HOME[:2])
    left = 2
    taken = [one for one, line in zip(plan.photographs, plan.line, strict=True) if line != left]
    found = coverage(mission, taken, FLAT, area=[FIELD])
    shown = shapely.union_all([shapely.Polygon(corners(one, plane)) for one in taken])
    (field,) = plane.project_polygons([FIELD])
    assert in_metres(found, plane).symmetric_difference(field - shown).area < 1e-3 * (field - shown).area
    assert [one.number - 1 for one in found.missing] == np.flatnonzero(plan.line == left).tolist()
    assert len({one.item for one in found.missing}) == 1
    assert found.overlap["beside"] is not None and found.overlap["beside"]["least"] == 0
    beside = found.planned_overlap["beside"]
    assert beside is not None  # neither neighbour shows the rest of 90 m, over 200 m
    assert sum(found.gap_areas_m2) == pytest.approx(90 * (1 - 2 * beside["median"]) * 200, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("how", SURVEYS)
def test_gaps_are_the_cells_that_no_footprint_covers(how: dict[str, Any]) -> None:
    mission, rng = survey(**how), Random(3)
    plane = Plane(mission.home.lat, mission.home.lon)
    everything = planned(mission).photographs
    cut = everything[: int(0.8 * len(everything))]
    taken = [one for one in cut if rng.random() < 0.6]
    regions = how.get("regions", [FIELD])
    found = coverage(mission, taken, Ground(home=mission_home(mission)), area=regions)
    gaps = in_metres(found, plane)
    everywhere, wrong, counted = 0, 0, np.zeros(4)
    for region in regions:
        places, counts = cells_seen(region, taken, plane, 0.5)
        edge = shapely.distance(shapely.points(places), gaps.boundary) < 0.01
        wrong += ((shapely.contains_xy(gaps, places) != (counts == 0)) & ~edge).sum()
        everywhere += len(places)
        counted += [(counts >= least).sum() for least in range(4)]
    assert wrong * 0.25 <= found.slivers_m2 + 1 and found.slivers_m2 <= LOST * found.area_m2
    assert found.area_m2 == pytest.approx(everywhere * 0.25, rel=0.01)
    assert seen(found) == pytest.approx(tuple(counted[1:] / everywhere), abs=2e-3)
    assert not found.is_whole
    matched = {one.number - 1 for one in found.missing}
    assert matched == {k for k, one in enumerate(everything) if one not in taken}


MISSION = survey(overlap=(60, 40))
PLAN = planned(MISSION)
SUBSETS = st.sets(st.integers(0, len(PLAN.photographs) - 1), min_size=1)


@pytest.mark.slow
@settings(max_examples=10, deadline=None)
@given(SUBSETS, SUBSETS, st.randoms())
def test_more_photographs_never_leave_more_gaps_and_their_order_does_not_matter(
    few: set[int], more: set[int], rng: Any
) -> None:
    def of(which: set[int]) -> Coverage:
        order = sorted(which)
        rng.shuffle(order)
        return coverage(MISSION, [PLAN.photographs[k] for k in order], FLAT, area=[FIELD])

    one, both, again = of(few), of(few | more), of(few | more)
    assert all(a <= b + 1e-9 for a, b in zip(seen(one), seen(both), strict=True))
    assert sum(both.gap_areas_m2) + both.slivers_m2 <= sum(one.gap_areas_m2) + one.slivers_m2 + 1e-3
    assert {m.number for m in both.missing} == set(range(1, len(PLAN.photographs) + 1)) - {
        k + 1 for k in few | more
    }
    assert seen(both) == pytest.approx(seen(again), abs=1e-9)
    assert both.missing == again.missing and both.overlap == again.overlap


@pytest.mark.slow
@pytest.mark.parametrize("how", SURVEYS)
def test_the_next_flight_over_the_gaps_makes_the_area_whole(how: dict[str, Any]) -> None:
    mission, regions = survey(**how), how.get("regions", [FIELD])
    ground = Ground(home=mission_home(mission))
    everything = planned(mission).photographs
    taken = [one for k, one in enumerate(everything) if k % 9 and not 20 < k < 31][: 3 * len(everything) // 5]
    for area in ([], regions):
        first = coverage(mission, taken, ground, area=area)
        assert not first.is_whole
        second = planned(survey(**how | {"regions": list(gap_regions(first).polygons)}))
        whole = coverage(mission, [*taken, *second.photographs], ground, area=area)
        assert whole.covered >= COVERED and whole.is_whole


def test_shares_of_fields_far_apart_are_those_of_each() -> None:
    """Half is seen of one whole field and one that nothing shows, 50 km away; and half of what is twice."""
    far = box(50_000, 50, 300, 200)
    near, both = (coverage(MISSION, PLAN.photographs, FLAT, area=area) for area in ([FIELD], [FIELD, far]))
    assert near.seen_twice > near.seen_three_times > 0.3
    halves = [share / 2 for share in seen(near)]
    assert list(seen(both)) == pytest.approx(halves, abs=2e-3)


@pytest.mark.slow
def test_a_tilted_camera_sees_ahead() -> None:
    photos = Photos(CAMERA, Overlap(70, 60), pitch_deg=-60)
    params = PlanParams(
        altitude_m=60.0, pattern="survey", spacing_m=photos.spacing_m(60), photos=photos, how=SurveyParams()
    )
    (mission,) = plan_missions([FIELD], inside([FIELD]), params, HOME)
    plan = planned(mission)
    assert {one.pitch_deg for one in plan.photographs} == {-60}
    found = coverage(mission, plan.photographs, FLAT, area=[FIELD])
    assert found.is_whole and found.overlap["along"] is not None


def moved(photographs: Sequence[Photograph], ahead_m: float, aside_m: float = 0.0) -> list[Photograph]:
    plane, result = Plane(*HOME[:2]), []
    for one in photographs:
        x, y = plane.xy_from_lonlat(one.lon, one.lat)
        yaw = math.radians(one.yaw_deg)
        lon, lat = plane.lonlat_from_xy(
            x + ahead_m * math.sin(yaw) + aside_m * math.cos(yaw),
            y + ahead_m * math.cos(yaw) - aside_m * math.sin(yaw),
        )
        result.append(replace(one, lon=float(lon), lat=float(lat)))
    return result


@pytest.mark.slow
def test_photographs_are_those_of_triggers_within_half_their_distance() -> None:
    step = PLAN.spacing_m[5]
    assert not coverage(MISSION, moved(PLAN.photographs, 0.45 * step), FLAT).missing
    late = coverage(MISSION, moved(PLAN.photographs, 0.55 * step), FLAT)
    lines = int(PLAN.line[-1]) + 1
    assert len(late.missing) == lines  # the first of each line
    assert not coverage(MISSION, moved(PLAN.photographs, 0, 0.2 * math.sqrt(90 * 60)), FLAT).missing
    away = moved(PLAN.photographs, 0, 10_000.0)
    with pytest.raises(PhotographError, match="another flight"):
        coverage(MISSION, away, FLAT)
    with_others = coverage(MISSION, [*PLAN.photographs, *away[:7]], FLAT)
    assert with_others.others == 7 and not with_others.missing
    assert with_others.overlap == coverage(MISSION, PLAN.photographs, FLAT).overlap


@pytest.mark.slow
def test_one_photograph_is_that_of_one_trigger() -> None:
    mission = survey(crosshatch=True)
    plan = planned(mission)
    half = [one for one, line in zip(plan.photographs, plan.line, strict=True) if line != plan.line[-1]]
    found = coverage(mission, half, FLAT)
    assert {one.number - 1 for one in found.missing} == set(np.flatnonzero(plan.line == plan.line[-1]))


@pytest.mark.slow
def test_motion_blur_is_exposure_times_speed() -> None:
    gsd_m = CAMERA.gsd_m(60)
    sharp = [replace(one, speed_m_s=5.0, exposure_s=0.99 * gsd_m / 5) for one in PLAN.photographs]
    assert coverage(MISSION, sharp, FLAT).blurred == ()
    blurred = [*sharp[:3], replace(sharp[3], exposure_s=1.01 * gsd_m / 5), *sharp[4:]]
    found = coverage(MISSION, blurred, FLAT)
    assert (found.blurred, found.blur_not_known) == (("number 4",), 0)
    assert coverage(MISSION, PLAN.photographs, FLAT).blur_not_known == len(PLAN.photographs)


@pytest.mark.slow
def test_speeds_that_are_not_told_follow_from_places_and_times() -> None:
    gsd_m, at_s, taken = CAMERA.gsd_m(60), 0.0, []
    for k, one in enumerate(PLAN.photographs):
        at_s += 600.0 if k == 4 else PLAN.spacing_m[k] / 8.0  # a pause in a line
        taken.append(replace(one, taken_s=at_s, exposure_s=gsd_m / 8.2))
    assert coverage(MISSION, taken, FLAT).blurred == ()
    slower = [replace(one, exposure_s=gsd_m / 7.8) for one in taken]
    assert len(coverage(MISSION, slower, FLAT).blurred) == len(taken)
    hovering = survey(trigger="hover")
    stops = [
        replace(one, taken_s=float(k), exposure_s=0.1) for k, one in enumerate(planned(hovering).photographs)
    ]
    assert coverage(hovering, stops, FLAT).blurred == ()


@pytest.mark.slow
def test_what_cannot_be_answered_is_refused() -> None:
    without = replace(MISSION, items=tuple(i for i in MISSION.items if i.command != CAMERA_DISTANCE))
    with pytest.raises(MissionError, match="--regions"):
        coverage(without, PLAN.photographs, FLAT)
    found = coverage(without, PLAN.photographs, FLAT, area=[FIELD])
    assert (found.planned, found.others, found.is_whole) == (0, 0, True)
    look = MissionItem(ROI_LOCATION, 3, lat=47.001, lon=8.001)
    with pytest.raises(MissionError, match="looks at places"):
        coverage(replace(MISSION, items=(look, *MISSION.items)), PLAN.photographs, FLAT)
    sky = [replace(one, pitch_deg=0.0) for one in PLAN.photographs]
    with pytest.raises(PhotographError, match="horizon"):
        coverage(MISSION, sky, FLAT)
    some = coverage(MISSION, [*PLAN.photographs, sky[0]], FLAT)
    assert some.is_whole and "horizon" in some.notes[0]
    with pytest.raises(PhotographError, match="no photograph"):
        coverage(MISSION, [], FLAT)
