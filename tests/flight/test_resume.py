"""The rest of a flight that was cut: all of the ground is photographed, and one photograph at most twice."""

import json
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
import rasterio
import shapely
from rasterio.transform import from_origin

import uavseg
from uavseg.errors import MissionError, ParameterError
from uavseg.flight.mission.estimate import footprints
from uavseg.flight.mission.items import (
    CAMERA_DISTANCE,
    FRAME_AMSL,
    FRAME_MISSION,
    FRAME_RELATIVE,
    IMAGE_START,
    JUMP,
    RETURN,
    TAKEOFF,
    TAKEOFFS,
    WAYPOINT,
    FenceCircle,
    FencePolygon,
    HomePosition,
    MissionItem,
)
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.track import Plane
from uavseg.flight.planning.resume import path_of, stops_of
from uavseg.flight.safety.check import SafetyCheck, fence_problems

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")

L_SHAPE = [(0, 0), (260, 0), (260, 90), (120, 90), (120, 180), (0, 180)]  # metres
SURVEYS: dict[str, dict[str, Any]] = {
    "distance": {},
    "px4": {"autopilot": "px4"},
    "interval": {"trigger": "interval"},
    "px4 interval": {"trigger": "interval", "autopilot": "px4"},
    "hover": {"trigger": "hover"},
    "px4 hover": {"trigger": "hover", "autopilot": "px4"},
    "dem": {"dem": "dem.tif"},
    "px4 dem": {"dem": "dem.tif", "terrain": "relative", "autopilot": "px4"},
    "frame": {"terrain": "frame"},
    "angles": {"gimbal_pitch": (-90, -60)},
    "turnaround": {"turnaround": 20},
}


def area(lon: float, lat: float, corners: Any = L_SHAPE) -> bytes:
    """A region near a place, as GeoJSON."""
    x, y = np.array(corners, float).T
    lons, lats = Plane(lat, lon).lonlat_from_xy(x, y)
    ring = [*zip(lons.tolist(), lats.tolist(), strict=True)]
    shape = {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}
    feature = {"type": "Feature", "properties": {"id": 1}, "geometry": shape}
    return json.dumps({"type": "FeatureCollection", "features": [feature]}).encode()


@pytest.fixture(scope="module")
def ground(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A hill of 40 m around 47 N, 8 E."""
    path = tmp_path_factory.mktemp("ground") / "dem.tif"
    rows, cols = np.mgrid[0:160, 0:160]
    heights = 400 + 40 * np.exp(-((rows - 70) ** 2 + (cols - 85) ** 2) / 400)
    shape = {"width": 160, "height": 160, "count": 1, "dtype": "float32", "crs": "EPSG:4326"}
    with rasterio.open(
        path, "w", driver="GTiff", transform=from_origin(7.992, 47.008, 1e-4, 1e-4), **shape
    ) as f:
        f.write(heights.astype(np.float32), 1)
    return path


_PLANNED: dict[str, Mission] = {}


@pytest.fixture
def survey(request: pytest.FixtureRequest, ground: Path) -> Mission:
    """A survey by its name, as its file holds it: without the ground."""
    name = request.param
    if name not in _PLANNED:
        how = SURVEYS[name] | ({"dem": str(ground)} if "dem" in SURVEYS[name] else {})
        camera = {"camera": "mavic 3 enterprise", "gsd": 1.5, "angle": 0}
        corners = np.array(L_SHAPE) * (1.5 if "interval" in name else 1)
        planned = uavseg.plan(area(8.0, 47.0, corners), home=(46.9997, 8.0005, 400), **camera, **how)
        _PLANNED[name] = replace(planned.missions[0], ground=None)
    return _PLANNED[name]


def first_number(mission: Mission) -> int:
    return 0 if mission.autopilot == "px4" else 1


def shots(mission: Mission) -> tuple[list[tuple[int, float]], list[shapely.Polygon], np.ndarray[Any, Any]]:
    """Legs and shares of photographs, their footprints in metres around home, and their places there."""
    path = path_of(mission)
    places = [(run.leg, run.first + k * run.step) for run in path.shots for k in range(run.count)]
    seen = footprints(mission).lonlat
    assert len(seen) == len(places)
    plane = Plane(mission.home.lat, mission.home.lon)
    xy = np.stack(plane.xy_from_lonlat(seen[..., 0], seen[..., 1]), axis=-1)
    at = [path.xyz_m[k] + min(s, 1) * (path.xyz_m[k + 1] - path.xyz_m[k]) for k, s in places]
    return places, [shapely.Polygon(ring) for ring in xy], np.array(at).reshape(-1, 3)


def region_of(mission: Mission) -> shapely.Polygon:
    """The region that surveys of this file are over, in metres around home."""
    by_time = any(item.command == IMAGE_START and item.params[2] != 1 for item in mission.items)
    x, y = (np.array(L_SHAPE, float) * (1.5 if by_time else 1)).T
    plane = Plane(mission.home.lat, mission.home.lon)
    return shapely.Polygon(np.column_stack(plane.xy_from_lonlat(*Plane(47.0, 8.0).lonlat_from_xy(x, y))))


def check_rest(mission: Mission, number: float, leg: int, share: float) -> None:
    """Check what a flight photographs up to a cut, and its rest, against the whole."""
    places, prints, at = shots(mission)
    taken = [place <= (leg, share + 1e-6) for place in places]
    if all(taken):
        with pytest.raises(MissionError, match="nothing is left"):
            uavseg.resume(mission, start=number)
        return
    rest = uavseg.resume(mission, start=number).missions[0]
    SafetyCheck().check(replace(rest, ground=None))
    _, more, again = shots(rest)
    before = [one for one, was in zip(prints, taken, strict=True) if was]
    whole = shapely.union_all(prints)
    missing = whole.difference(shapely.union_all([*before, *more]))
    by_time = any(item.command == IMAGE_START and item.params[2] != 1 for item in mission.items)
    # by time, one more or less fits into the rest of a line whose speeds at its ends are others, so its last
    # photograph may lie a step before its end: what it shows beyond the region is less, the region is not
    assert missing.area <= (0.005 if by_time else 0.001) * whole.area, number
    assert missing.intersection(region_of(mission)).area <= 1e-6 * whole.area, number
    assert len(before) + len(more) <= len(prints) + 1 + by_time, number
    if before:

        def repeated(places: Any) -> int:
            """Photographs at a place of one before the cut; lines of other directions cross there too."""
            apart = np.linalg.norm(places[:, None] - at[np.array(taken)][None], axis=2)
            return int((apart.min(axis=1) < 1.0).sum())

        assert repeated(again) <= repeated(at[~np.array(taken)]) + 1, number


def check_cuts(survey: Mission, legs: Any) -> None:
    random, stops = Random(1), stops_of(survey)
    for leg in legs:
        number = stops[leg] + first_number(survey)
        check_rest(survey, number, leg, 0.0)
        share = round(random.random(), 3)
        check_rest(survey, number + share, leg, share)


@pytest.mark.slow
@pytest.mark.parametrize("survey", SURVEYS, indirect=True)
def test_all_is_photographed_and_one_photograph_at_most_twice(survey: Mission) -> None:
    check_cuts(survey, Random(2).sample(range(len(stops_of(survey))), 6))


LONG = ("angles", "hover", "px4 hover")  # surveys of many legs


@pytest.mark.slow
@pytest.mark.parametrize(
    "survey",
    [pytest.param(name, marks=[pytest.mark.thorough] * (name in LONG)) for name in SURVEYS],
    indirect=True,
)
def test_so_it_is_after_a_cut_on_any_leg(survey: Mission) -> None:
    check_cuts(survey, range(len(stops_of(survey))))


# What is set again, heights and ways


def by_hand(*items: MissionItem, autopilot: str = "ardupilot", **how: Any) -> Mission:
    """Takeoff to 30 m, two lines of 200 m to the north and back, and items after the first place."""
    places = [(47.001, 8.0), (47.0028, 8.0), (47.0028, 8.001), (47.001, 8.001)]
    wps = [MissionItem(WAYPOINT, FRAME_RELATIVE, (0.0, 0.0, 0.0, None), *place, 40.0) for place in places]
    up = MissionItem(TAKEOFF, FRAME_RELATIVE, (0.0, 0.0, 0.0, None), 47.0, 8.0, 30.0)
    back = MissionItem(RETURN, FRAME_MISSION)
    return Mission(HomePosition(47.0, 8.0, 400.0), (up, wps[0], *items, *wps[1:], back), autopilot, **how)


def setting(command: int, *params: float) -> MissionItem:
    return MissionItem(command, FRAME_MISSION, (*map(float, params), *[0.0] * (4 - len(params))))


def after_cut(*items: MissionItem, leg: int = 3, share: float = 0.5, **how: Any) -> tuple[MissionItem, ...]:
    mission = by_hand(*items, **how)
    number = stops_of(mission)[leg] + 1 + share
    return uavseg.resume(mission, start=number).missions[0].items


def commands(items: Any) -> list[int]:
    return [item.command for item in items]


def test_what_was_set_before_the_cut_is_set_again() -> None:
    given = [
        setting(178, 1, 7.0, -1),
        setting(205, -60.0),
        setting(183, 5, 1100),
        setting(183, 6, 1200),
        setting(183, 5, 1900),
        setting(206, 20.0, 0, 1),
    ]
    items = after_cut(*given, leg=2)
    assert commands(items)[:2] == [TAKEOFF, 205]  # the speed comes with the first waypoint, as in the mission
    kept = [item for item in items if item.command in (183, 178)]
    assert kept == [given[0], given[3], given[4]]
    last = max(k for k, item in enumerate(items) if item.command in (183, 178))
    assert items[last + 1] == given[-1]  # photographs begin when all is set


def test_photographs_that_were_stopped_stay_stopped() -> None:
    mission = by_hand()
    on, off = setting(CAMERA_DISTANCE, 20.0, 0, 1), setting(CAMERA_DISTANCE)
    up, *places, back = mission.items
    items = (up, places[0], on, places[1], off, places[2], on, places[3], off, back)
    rest = uavseg.resume(replace(mission, items=items), start=6.5).missions[0].items
    assert commands(rest) == [TAKEOFF, WAYPOINT, WAYPOINT, 206, WAYPOINT, 206, RETURN]
    assert [item.params[0] for item in rest if item.command == 206] == [20.0, 0.0]


def test_other_heights_than_home_keep_their_frame() -> None:
    mission = by_hand()
    items = [
        replace(item, frame=FRAME_AMSL, altitude_m=item.altitude_m + 400 + 5 * k)
        if item.command == 16
        else item
        for k, item in enumerate(mission.items)
    ]
    rest = uavseg.resume(replace(mission, items=tuple(items)), start=4.5).missions[0]
    places = [item for item in rest.items if item.command == 16]
    assert {item.frame for item in places} == {FRAME_AMSL}
    assert places[0].altitude_m == 400 + 40 + 5 * 3  # above home, up to the highest before the cut
    assert (places[0].lat, places[0].lon) == (47.0, 8.0)


@pytest.mark.parametrize("survey", SURVEYS, indirect=True)
def test_the_way_there_is_level_and_no_lower_than_the_flight_before(survey: Mission) -> None:
    stops = stops_of(survey)
    for leg in range(2, len(stops) - 1, max(len(stops) // 8, 1)):
        try:
            rest = uavseg.resume(survey, start=stops[leg] + first_number(survey) + 0.4).missions[0]
        except MissionError:
            continue
        if rest.items == survey.items:
            continue
        before = replace(survey, items=survey.items[: stops[leg] + 1]).path[2]
        assert survey.path[2].max() + 0.01 >= rest.path[2].max() >= before.max() - 0.01
        height = rest.path[2]
        assert height[2] == pytest.approx(max(before), abs=0.01)  # takeoff, and the first place after it
        frames = {item.frame for item in survey.items if item.has_position and item.command not in TAKEOFFS}
        assert {i.frame for i in rest.items if i.has_position and i.command not in TAKEOFFS} == frames


def test_the_way_there_leads_round_zones_of_the_fence() -> None:
    zone = FencePolygon(((47.0004, 7.9994), (47.0004, 8.0002), (47.0006, 8.0002), (47.0006, 7.9994)), False)
    outer = FenceCircle(47.0015, 8.0005, 400.0)
    mission = by_hand(fence=(outer, zone))
    assert fence_problems(mission)  # the mission itself is not the rest
    around = replace(
        mission, items=tuple(replace(i, lon=i.lon + 0.0004) if i.command == 16 else i for i in mission.items)
    )
    rest = uavseg.resume(around, start=4.5).missions[0]
    assert not fence_problems(rest)
    straight = uavseg.resume(replace(around, fence=(outer,)), start=4.5).missions[0]
    assert fence_problems(replace(straight, fence=(zone,))) and len(rest.items) > len(straight.items)


def test_no_way_within_the_fence_is_refused() -> None:
    ring = FencePolygon(((47.0016, 7.99), (47.0016, 8.02), (47.0018, 8.02), (47.0018, 7.99)), False)
    within = FencePolygon(((46.999, 7.995), (46.999, 8.006), (47.004, 8.006), (47.004, 7.995)))
    with pytest.raises(MissionError, match="no way round is 3 m from them"):
        uavseg.resume(by_hand(fence=(within, ring)), start=3.5)


# Places


@pytest.mark.slow
@pytest.mark.parametrize("place", [(47.0, 8.0), (-33.9, 18.4), (0.0, 179.9995), (64.1, -180.0)])
def test_a_place_on_the_path_is_the_share_of_its_leg(place: tuple[float, float]) -> None:
    lat, lon = place
    home = (lat - 4e-4, lon, 10)
    mission = uavseg.plan(area(lon, lat), home=home, camera="mavic 3 enterprise", gsd=1.5).missions[0]
    path, stops, plane = path_of(mission), stops_of(mission), Plane(mission.home.lat, mission.home.lon)
    compared = 0
    for leg in range(2, len(stops)):
        if path.length_m[leg] < 60:
            continue
        xy = path.xyz_m[leg, :2] + 0.37 * np.diff(path.xyz_m[leg : leg + 2, :2], axis=0)[0]
        (lat_,), (lon_,) = (one.tolist() for one in plane.lonlat_from_xy(*xy[:, None])[::-1])
        by_place = uavseg.resume(mission, start=(lat_, lon_)).missions[0]
        compared += by_place.items == uavseg.resume(mission, start=stops[leg] + 1.37).missions[0].items
    assert compared >= 2


def test_places_that_are_not_on_one_part_of_the_path_are_refused() -> None:
    mission = by_hand()
    with pytest.raises(MissionError, match=r"lies 10.* m from the path .* at most 100 m are taken"):
        uavseg.resume(mission, start=(47.1, 8.0))
    with pytest.raises(MissionError, match=r"from another part of it; name .* --from 3.50 or --from 5.50"):
        uavseg.resume(mission, start=(47.0019, 8.0005))
    with pytest.raises(MissionError, match="swapped"):
        uavseg.resume(mission, start=(147.0, 8.0))
    with pytest.raises(ParameterError, match="--from is LAT,LON"):
        uavseg.resume(mission, start=(47.0, 8.0, 3.0))


# What cannot be resumed


@pytest.mark.parametrize(
    ("item", "message"),
    [
        (MissionItem(JUMP, FRAME_MISSION, (2, 3, 0, 0)), r"item 3 \(command 177\) cannot be resumed: where"),
        (replace(by_hand().items[0], lat=47.001), "cannot be resumed: it takes off once more"),
        (setting(RETURN), "flies on after a return"),
        (setting(42600, 1), r"item 3 \(command 42600\) comes before the cut, and whether it has to be done"),
        (setting(115, 90, 10, 1, 1), r"command 115\) comes before the cut"),
    ],
)
def test_what_cannot_be_resumed_is_refused(item: MissionItem, message: str) -> None:
    with pytest.raises(MissionError, match=message):
        after_cut(item, leg=2)


@pytest.mark.parametrize(
    ("number", "error", "message"),
    [
        (0, MissionError, "there is no item 0: the vehicle counts items 1 to 6 in this mission"),
        (7, MissionError, "there is no item 7"),
        (-2, MissionError, "there is no item -2"),
        (6, MissionError, "nothing is left"),
        (float("nan"), ParameterError, "--from is the number of an item"),
        (float("inf"), ParameterError, "--from is the number of an item"),
        (1e300, ParameterError, "--from is the number of an item"),
    ],
)
def test_numbers_of_no_item_are_refused(number: float, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        uavseg.resume(by_hand(), start=number)


def test_items_are_counted_as_the_vehicle_does() -> None:
    """Of ArduPilot, home is item 0; of PX4, the takeoff is."""
    one = uavseg.resume(by_hand(), start=4.5).missions[0]
    assert uavseg.resume(by_hand(autopilot="px4"), start=3.5).missions[0].items == one.items
    generic = uavseg.resume(by_hand(autopilot="generic"), start=4.5)
    assert generic.missions[0].items == one.items
    assert any("PX4 counts one less" in text for text in generic.warnings)


def test_before_the_first_waypoint_all_is_left() -> None:
    for number in (1, 1.5, 2, 2.9):
        found = uavseg.resume(by_hand(), start=number)
        assert found.missions[0].items == by_hand().items
        assert any("the rest is all of it" in text for text in found.warnings)


def test_a_rest_can_be_resumed_in_turn() -> None:
    mission = by_hand(setting(206, 20.0, 0, 1))
    rest = uavseg.resume(mission, start=4.3).missions[0]
    _, _, first = shots_places(rest)
    k = len(first) // 2
    leg, share = shots_places(rest)[0][k]
    again = uavseg.resume(rest, start=stops_of(rest)[leg] + 1 + min(round(share, 6), 0.999)).missions[0]
    assert len(shots_places(again)[2]) in (len(first) - k, len(first) - k + 1)


def shots_places(mission: Mission) -> tuple[list[tuple[int, float]], None, list[Any]]:
    path = path_of(mission)
    places = [(run.leg, run.first + n * run.step) for run in path.shots for n in range(run.count)]
    return places, None, places


def test_a_takeoff_at_the_vehicle_begins_at_home() -> None:
    mission = by_hand()
    up = replace(mission.items[0], lat=0.0, lon=0.0)
    ring = FencePolygon(((46.999, 7.995), (46.999, 8.006), (47.004, 8.006), (47.004, 7.995)))
    zone = FencePolygon(((47.0004, 7.9994), (47.0004, 8.0003), (47.0006, 8.0003), (47.0006, 7.9994)), False)
    given = replace(mission, items=(up, *mission.items[1:]), fence=(ring, zone))
    rest = uavseg.resume(given, start=4.5).missions[0]
    assert not fence_problems(rest) and rest.items[0] == up
    climb = next(item for item in rest.items if item.command == WAYPOINT)
    assert (climb.lat, climb.lon, climb.altitude_m) == (47.0, 8.0, 40.0)


def test_limited_series_of_photographs_are_refused() -> None:
    with pytest.raises(MissionError, match=r"command 2000\) comes before the cut"):
        after_cut(setting(IMAGE_START, 0, 2, 12), leg=2)
