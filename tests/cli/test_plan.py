import json
from dataclasses import replace
from pathlib import Path

import geopandas
import numpy as np
import pytest
import shapely
from click.testing import CliRunner, Result
from pyproj import Geod

from uavseg.cli.plan import command
from uavseg.errors import MissionError, OutputExistsError, ParameterError, RegionError, UavsegError
from uavseg.flight.formats import files
from uavseg.flight.mission.estimate import estimate
from uavseg.flight.mission.items import CAMERA_DISTANCE, WAYPOINT
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.vehicle import read_vehicle

GEOD = Geod(ellps="WGS84")
HOME = "47.0,8.0,430"


@pytest.fixture
def regions(tmp_path: Path) -> Path:
    """Three regions some hundred metres from home: 300 x 150, 75 x 110 and 75 x 20 metres."""
    path = tmp_path / "regions.geojson"
    boxes = [(8.0, 47.0, 8.004, 47.00135), (8.006, 47.0, 8.007, 47.001), (8.008, 47.0, 8.009, 47.0002)]
    columns = {"id": [1, 2, 3], "mean": [0.6, 0.8, 0.9]}
    geopandas.GeoDataFrame(columns, geometry=[shapely.box(*box) for box in boxes], crs=4326).to_file(path)
    return path


def run(*arguments: object, text: bytes | None = None) -> Result:
    return CliRunner().invoke(command, [str(argument) for argument in arguments], input=text)


def flown(regions: Path, *options: object, suffix: str = ".plan", altitude: float | None = 60) -> Mission:
    output = regions.with_suffix(suffix)
    height = [] if altitude is None else ["--altitude", altitude]
    done = run(regions, "-o", output, *height, "--home", HOME, "--overwrite", *options)
    assert done.exception is None, done.output
    return files.read_mission(output)


def error(regions: Path, *options: object, output: str = "mission.plan") -> UavsegError:
    done = run(regions, "-o", regions.parent / output, *options)
    assert isinstance(done.exception, UavsegError), done.output
    assert "\n" not in str(done.exception)
    assert not (regions.parent / output).exists()
    return done.exception


def waypoints(mission: Mission) -> int:
    return sum(item.command == WAYPOINT for item in mission.items)


def test_by_default_every_region_is_visited(regions: Path) -> None:
    assert waypoints(flown(regions)) == 3


@pytest.mark.slow
def test_a_spacing_makes_a_survey_and_the_pattern_decides(regions: Path) -> None:
    assert waypoints(flown(regions, "--spacing", 25, "--angle", 90)) == 2 * (6 + 5 + 1)
    survey = ("--pattern", "survey", "--spacing", 25, "--angle")
    assert waypoints(flown(regions, *survey, 0)) == 2 * (13 + 4 + 4)
    # 4 lines of 111 m over the second region take less time than 5 of 76 m, but then the ways are longer
    automatic = flown(regions, *survey, "auto")
    assert waypoints(automatic) == 2 * (6 + 5 + 1)
    for angle in range(0, 180, 15):
        assert estimate(automatic).duration_s <= estimate(flown(regions, *survey, angle)).duration_s
    assert waypoints(flown(regions, "--pattern", "perimeter", "--tolerance", 0.5)) == 15


def test_regions_are_chosen(regions: Path) -> None:
    assert waypoints(flown(regions, "--ids", "1,3")) == 2
    assert waypoints(flown(regions, "--largest", 1)) == 1
    assert waypoints(flown(regions, "--where", "mean > 0.7 and area_m2 > 3000")) == 1


def test_how_to_fly_reaches_the_mission(regions: Path) -> None:
    mission = flown(regions, "--speed", 8.5, "--autopilot", "px4")
    assert (mission.autopilot, mission.speed_m_s, mission.items[0].altitude_m) == ("px4", 8.5, 60)
    assert (mission.home.lat, mission.home.lon, mission.home.altitude_m) == (47, 8, 430)


def test_both_formats_hold_the_same_flight(regions: Path) -> None:
    fenced = flown(regions, suffix=".plan")
    assert fenced.fence and replace(fenced, fence=()) == flown(regions, suffix=".waypoints")


def test_home_is_found_outside_of_all_regions_and_near_the_chosen_ones(regions: Path) -> None:
    mission = flown(regions, "--home", "auto", "--ids", "2,3")
    home = shapely.Point(mission.home.lon, mission.home.lat)
    everywhere = shapely.union_all(geopandas.read_file(regions).geometry)
    assert 1e-4 < shapely.distance(everywhere, home) < 3e-4
    assert shapely.box(8.005, 47.0, 8.0095, 47.001).distance(home) < 2e-4


def test_regions_may_come_from_standard_input(regions: Path) -> None:
    output = regions.with_name("piped.plan")
    done = run("-", "-o", output, "--altitude", 60, "--home", HOME, text=regions.read_bytes())
    assert done.exception is None
    assert waypoints(files.read_mission(output)) == 3


def test_the_summary_is_on_stderr_and_can_be_silenced(regions: Path) -> None:
    arguments = [
        regions,
        "-o",
        regions.with_suffix(".plan"),
        "--altitude",
        60,
        "--home",
        "47,8",
        "--overwrite",
    ]
    told = run(*arguments)
    assert told.stdout == ""
    first, heads, _, *notes = told.stderr.splitlines()
    assert heads.startswith("flight ")
    assert "3 regions, 6 items, " in first and " km, about " in first
    assert notes and all(note.startswith("note: ") for note in notes)
    assert run(*arguments, "-q").output == ""


def test_what_a_format_loses_is_said(regions: Path) -> None:
    arguments = ["--altitude", 60, "--home", HOME, "--autopilot", "px4"]
    assert "face north" in run(regions, "-o", regions.with_suffix(".waypoints"), *arguments).stderr
    assert "face north" not in run(regions, "-o", regions.with_suffix(".plan"), *arguments).stderr


FLY = ("--altitude", 60, "--home", HOME)


@pytest.mark.parametrize(
    ("options", "kind", "words"),
    [
        (("--home", HOME), ParameterError, "--altitude"),
        (("--altitude", 60), ParameterError, "--home LAT,LON"),
        ((*FLY, "--altitude", 0), ParameterError, "altitude"),
        ((*FLY, "--altitude", "nan"), ParameterError, "altitude"),
        ((*FLY, "--home", "here"), ParameterError, "LAT,LON"),
        ((*FLY, "--home", "47"), ParameterError, "LAT,LON"),
        ((*FLY, "--home", "8.0,47.0"), MissionError, "look swapped"),
        ((*FLY, "--home", "47.0,208.0"), MissionError, "-180..180"),
        ((*FLY, "--angle", "north"), ParameterError, "--angle"),
        ((*FLY, "--angle", "30"), ParameterError, "survey"),
        ((*FLY, "--pattern", "survey"), ParameterError, "spacing"),
        ((*FLY, "--pattern", "visit", "--spacing", "9"), ParameterError, "spacing"),
        ((*FLY, "--ids", "1,x"), RegionError, "--ids"),
        ((*FLY, "--ids", "1,9"), RegionError, "no region 9; there are 1, 2, 3"),
        ((*FLY, "--where", "size > 3"), RegionError, "they have id, area_m2, mean, lon, lat"),
        ((*FLY, "--where", "__import__('os')"), RegionError, "not understood"),
        ((*FLY, "--where", "mean > 1"), RegionError, "none of the 3"),
    ],
)
def test_what_cannot_be_flown_is_refused_and_nothing_written(
    regions: Path, options: tuple[object, ...], kind: type[UavsegError], words: str
) -> None:
    refused = error(regions, *options)
    assert isinstance(refused, kind)
    assert words in str(refused)


def test_an_unknown_format_is_refused_before_anything_is_read(tmp_path: Path) -> None:
    refused = error(tmp_path / "none.gpkg", *FLY, output="mission.gpx")
    assert ".plan, .waypoints" in str(refused)


def test_a_mission_is_not_replaced_without_overwrite(regions: Path) -> None:
    output = regions.with_suffix(".plan")
    output.write_text("mine")
    assert isinstance(run(regions, "-o", output, *FLY).exception, OutputExistsError)
    assert output.read_text() == "mine"


def test_a_word_that_is_no_choice_is_a_usage_error(regions: Path) -> None:
    assert run(regions, "-o", "x.plan", *FLY, "--autopilot", "dji").exit_code == 2
    assert run(regions, "-o", "x.plan", *FLY, "--largest", "0").exit_code == 2


@pytest.mark.slow
def test_a_camera_gives_height_spacing_and_photographs(regions: Path) -> None:
    mission = flown(regions, "--camera", "phantom 4 rtk", "--gsd", 2, "--where", "mean < 0.7", altitude=None)
    heights = {item.altitude_m for item in mission.items if item.command == WAYPOINT}
    assert len(heights) == 1 and heights.pop() == pytest.approx(72.97, abs=0.01)
    assert sum(item.command == CAMERA_DISTANCE for item in mission.items) == waypoints(mission)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--camera", "mavik 3", "--altitude", 60), "DJI Mavic 3"),
        (("--gsd", 2), "needs a camera"),
        (("--camera", "phantom 4 rtk", "--gsd", 2, "--altitude", 60), "one of the two"),
        (("--camera", "phantom 4 rtk", "--gsd", 0), "100 cm"),
        (("--camera", "phantom 4 rtk"), "--altitude"),
        (("--camera", "phantom 4 rtk", "--altitude", 60, "--overlap", "75"), "two numbers"),
        (("--camera", "phantom 4 rtk", "--altitude", 60, "--overlap", "75,100"), "per cent"),
        (("--camera", "phantom 4 rtk", "--altitude", 60, "--overlap", "a,b"), "per cent"),
        (("--camera", "phantom 4 rtk", "--altitude", 60, "--gimbal-pitch", "0"), "gimbal pitch"),
        (("--sensor", "13.2x8.8", "--altitude", 60), "all of --sensor"),
        (("--sensor", "13.2", "--image", "5472x3648", "--focal", 8.8, "--altitude", 60), "WIDTHxHEIGHT"),
        (("--camera", "phantom 4 rtk", "--focal", 8.8, "--altitude", 60), "leave --focal out"),
        (("--camera", "phantom 4 rtk", "--shutter", "1/0", "--altitude", 60), "--shutter is seconds"),
        (("--trigger", "hover", "--altitude", 60), "--trigger needs a camera"),
        (("--offset", 5, "--altitude", 60), "--offset is for the pattern perimeter"),
        (("--pattern", "perimeter", "--offset", -400, "--altitude", 60), "every region is narrower"),
        (("--pattern", "visit", "--hold", -1, "--altitude", 60), "the hold is 0 to 3600"),
    ],
)
def test_a_camera_that_cannot_photograph_so_is_refused(
    regions: Path, options: tuple[object, ...], words: str
) -> None:
    assert words in str(error(regions, "--home", HOME, *options))


@pytest.mark.slow
def test_footprints_are_a_part_of_json(regions: Path) -> None:
    words = ["--camera", "DJI Mavic 3 Enterprise", "--gsd", "3", "--home", HOME, "--overwrite", "-q"]
    output = regions.with_name("shown.plan")
    plain = json.loads(run(regions, "-o", output, *words, "--json").stdout)
    written = output.read_bytes()
    found = json.loads(run(regions, "-o", output, *words, "--json", "--footprints").stdout)
    assert output.read_bytes() == written
    [flight] = found["flights"]
    corners = np.array(flight.pop("footprints"))
    assert flight.pop("footprints_note") == "" and found == plain
    assert corners.shape == (flight["photographs"], 4, 2)
    area = GEOD.geometry_area_perimeter(shapely.union_all(shapely.polygons(corners)))[0]
    assert abs(area) == pytest.approx(flight["photographed_m2"], rel=0.05)
    refused = run(regions, "-o", output, *words, "--footprints")
    assert refused.exit_code == 2 and "--footprints are a part of --json" in refused.stderr


@pytest.mark.slow
def test_estimates_are_printed_as_a_table_and_as_json(regions: Path) -> None:
    quad = regions.with_name("quad.json")
    quad.write_text(json.dumps({"hover_w": 200, "cruise_w": 180, "battery_wh": 80}))
    camera = ("--camera", "phantom 4 rtk", "--altitude", 60, "--home", HOME, "--vehicle", quad)
    output = regions.with_suffix(".plan")
    done = run(regions, "-o", output, *camera, "--json")
    [flight] = json.loads(done.stdout)["flights"]
    estimate = replace(files.read_mission(output), vehicle=read_vehicle(quad)).estimate
    assert flight["duration_s"] == pytest.approx(estimate.duration_s, abs=0.1)
    assert flight["photographs"] == estimate.photographs > 20
    assert flight["battery"] == pytest.approx(estimate.battery, abs=1e-3)
    assert 0 < flight["gsd_m"] < 0.02 and flight["photographed_m2"] > 300 * 150
    heads, cells = (line.split() for line in done.stderr.splitlines()[1:3])
    row = dict(zip(heads, cells, strict=True))
    minutes, seconds = map(int, row["time"].split(":"))
    assert 60 * minutes + seconds == round(flight["duration_s"])
    assert (
        row["photographs"] == str(flight["photographs"])
        and row["battery"] == f"{100 * flight['battery']:.0f}%"
    )
    quiet = run(regions, "-o", output, *camera, "--json", "--quiet", "--overwrite")
    assert quiet.stdout == done.stdout and quiet.stderr == ""


def test_a_table_has_no_empty_columns(regions: Path) -> None:
    done = run(regions, "-o", regions.with_suffix(".plan"), "--altitude", 60, "--home", HOME)
    assert done.stdout == ""
    assert done.stderr.splitlines()[1].split() == [
        "flight",
        "km",
        "time",
        "climb",
        "legs",
        "return",
        "landing",
    ]


def test_a_vehicle_that_cannot_be_read_is_refused(regions: Path) -> None:
    where = ("--altitude", 60, "--home", HOME, "--vehicle")
    assert "a vehicle has only" in str(error(regions, *where, regions))
    assert "none.json" in str(error(regions, *where, regions.with_name("none.json")))
