"""The rest of a flight that was cut: all of the ground is photographed, and one photograph at most twice."""

import json
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
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
    LANDINGS,
    RETURN,
    TAKEOFF,
    TAKEOFFS,
    WAYPOINT,
    FenceCircle,
    FencePolygon,
    HomePosition,
    MissionItem,
    distance_m,
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
    with rasterio.open(path, "w", driver="GTiff", transform=from_origin(7.992, 47.008, 1e-4, 1e-4), **shape) as f:
        f.write(heights.astype(np.float32), 1)
    return path


_PLANNED: dict[str, Mission] = {}


@pytest.fixture
def survey(request: pytest.FixtureRequest, ground: Path) -> Mission:
    """A survey by its name, as its file holds it: without the ground."""
    name = request.param
    if name not in _PLANNED:
        how = SURVEYS[name] | ({"dem": str(ground)} if "dem" in SURVEYS[name] else {})
        camera = {"camera": "mavic 3 enterprise", "gsd": 1.5}
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


@pytest.mark.parametrize("survey", SURVEYS, indirect=True)
def test_all_is_photographed_and_one_photograph_at_most_twice(survey: Mission) -> None:
    check_cuts(survey, Random(2).sample(range(len(stops_of(survey))), 6))


@pytest.mark.slow
@pytest.mark.parametrize("survey", SURVEYS, indirect=True)
def test_so_it_is_after_a_cut_on_any_leg(survey: Mission) -> None:
    check_cuts(survey, range(len(stops_of(survey))))
