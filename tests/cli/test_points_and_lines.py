"""Points and lines in files: kept out of, visited, flown along, or said to be left out."""

from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import shapely
from click.testing import CliRunner, Result

from tests.flight.small_regions import box, degrees
from uavseg.cli import main
from uavseg.flight.formats.files import read_mission
from uavseg.flight.mission.items import WAYPOINT
from uavseg.flight.mission.track import Plane

PLANE = Plane(47.0, 8.0)
ROAD = shapely.LineString([(0, 300), (150, 380), (400, 350)])
MASTS = [shapely.Point(60, 250), shapely.Point(0, 400)]
HOW = ["--altitude", "40", "--home", "47,8,430", "-o", "fly.plan", "--overwrite"]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    shapes = {
        "mixed": [box(100, -100, 200, 200), *map(degrees, [*MASTS, ROAD])],
        "road": [degrees(ROAD)],
        "masts": list(map(degrees, MASTS)),
        "field": [box(100, 200, 250, 250)],
        "at_home": [degrees(shapely.Point(3, 4))],
    }
    for name, some in shapes.items():
        frame = geopandas.GeoDataFrame({"name": ["x"] * len(some)}, geometry=some, crs=4326)
        frame.to_file(f"{name}.geojson")


def run(*words: str) -> Result:
    return CliRunner().invoke(main, list(words))


def flown() -> Any:
    places = [(item.lon, item.lat) for item in read_mission("fly.plan").items if item.command == WAYPOINT]
    return np.column_stack(PLANE.xy_from_lonlat(*np.array(places).T))


def test_points_are_visited() -> None:
    result = run("plan", "masts.geojson", *HOW)
    assert result.exit_code == 0 and "note: 2 points of masts.geojson: visited" in result.stderr
    assert shapely.distance(shapely.MultiPoint(flown()), MASTS).max() < 0.1


@pytest.mark.parametrize("width", [[], ["--width", "20"]])
def test_a_line_is_flown_along(width: list[str]) -> None:
    result = run("plan", "road.geojson", *HOW, "--pattern", "corridor", "--spacing", "40", *width)
    assert result.exit_code == 0, result.stderr
    assert "note: 1 line of road.geojson: flown along, 20 m wide (--width)" in result.stderr
    assert shapely.hausdorff_distance(shapely.LineString(flown()), ROAD, 0.05) < 14  # round ends


def test_a_wide_line_is_flown_along_several_times() -> None:
    run("plan", "road.geojson", *HOW, "--pattern", "corridor", "--spacing", "20", "--width", "60")
    lines = shapely.LineString(flown())
    assert shapely.covers(lines.buffer(11), ROAD.buffer(30, cap_style="flat"))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], ["2 points of mixed.geojson: visited", "1 line of mixed.geojson: not flown, as --pattern"]),
        (["--spacing", "30"], ["2 points and 1 line of mixed.geojson: not flown, as --pattern visit"]),
        (
            ["--pattern", "corridor", "--spacing", "30"],
            ["2 points of mixed.geojson: not flown", "1 line of mixed.geojson: flown along, 15 m wide"],
        ),
    ],
)
def test_what_is_used_and_what_is_not_is_said(words: list[str], said: list[str]) -> None:
    result = run("plan", "mixed.geojson", *HOW, *words)
    assert result.exit_code == 0, result.stderr
    assert all(f"note: {text}" in result.stderr for text in said)


@pytest.mark.slow
def test_masts_are_kept_out_of_and_checked() -> None:
    result = run(
        "plan",
        "field.geojson",
        *HOW,
        "--spacing",
        "20",
        "--angle",
        "0",
        "--avoid",
        "masts.geojson",
        "--avoid",
        "road.geojson",
    )
    assert result.exit_code == 0, result.stderr
    assert "note: 2 points of masts.geojson: kept out of, 10 m wide (--zone-width)" in result.stderr
    kept = shapely.union_all([shapely.buffer(one, 5) for one in (ROAD, *MASTS)])
    legs = shapely.LineString(np.vstack([[0, 0], flown(), [0, 0]]))
    assert shapely.distance(legs, kept) >= 12.4  # and 2.5 m for corners at 5 m/s
    wide = ["check", "fly.plan", "--avoid", "road.geojson", "--zone-width"]
    assert run(*wide, "10").exit_code == 0 and run(*wide, "40").exit_code == 1
    assert run(*wide, "40", "--zone-height", "30").exit_code == 0
    assert "1 line of road.geojson: kept out of, 40 m wide" in run(*wide, "40", "--json").stdout


def test_a_home_beside_a_mast_is_told_a_place_that_works() -> None:
    refused = run("plan", "field.geojson", *HOW, "--avoid", "at_home.geojson")
    assert refused.exit_code == 1 and len(refused.stderr.splitlines()) == 1
    place = refused.stderr.partition("nearest free place is ")[2].partition(":")[0]
    moved = [word.replace("47,8,430", place) for word in HOW]
    assert run("plan", "field.geojson", *moved, "--avoid", "at_home.geojson").exit_code == 0


@pytest.mark.parametrize("words", [["road"], ["masts", "--spacing", "20"], ["road", "--pattern", "orbit"]])
def test_a_file_of_which_nothing_is_flown_is_one_line(words: list[str]) -> None:
    name, *more = words
    result = run("plan", f"{name}.geojson", *HOW, *more)
    assert result.exit_code == 1 and "and there is nothing else in it" in result.stderr
    assert len(result.stderr.splitlines()) == 1 and not Path("fly.plan").exists()
