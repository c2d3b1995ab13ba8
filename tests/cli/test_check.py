"""`uavseg check`: what a mission holds, who refuses it, and exit codes."""

import json
import warnings
from dataclasses import replace
from pathlib import Path

import geopandas
import numpy as np
import pytest
import rasterio
import shapely
from affine import Affine
from click.testing import CliRunner, Result

import uavseg
from tests.flight.fences import FENCE, RALLY
from tests.flight.formats.mission_texts import waypoints_text
from tests.flight.formats.test_kmz import SURVEY, mission_of
from tests.flight.mission_items import waypoint
from tests.flight.test_files import FENCED
from uavseg.cli import main
from uavseg.errors import MissionError, ParameterError
from uavseg.flight.formats import files
from uavseg.flight.mission.items import LOITER_TURNS, HomePosition
from uavseg.flight.mission.mission import Mission


def check(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["check", *map(str, arguments)])


def written(mission: Mission, path: Path) -> Path:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        files.write_mission(mission, path)
    return path


@pytest.mark.parametrize("suffix", files.FORMATS)
def test_every_format_is_read_back(tmp_path: Path, suffix: str) -> None:
    path = written(SURVEY, tmp_path / f"fly{suffix}")
    result = check(path)
    assert result.exit_code == 0, result.output
    rows = dict(line.split("  ", 1) for line in result.stdout.splitlines())
    assert rows["ArduPilot"].strip() == rows["PX4"].strip() == "accepts it"
    assert "(4 waypoints)" in rows["items"] and "at 7.5 m/s" in rows["distance"]
    assert "50 to 50 m above home" in rows["heights"]
    assert rows["DJI (.kmz)"].strip() == rows["Litchi (.csv)"].strip() == "accepts it"
    assert ("QGroundControl" in rows) == (suffix in {".plan", ".waypoints"})


def test_json_holds_the_same(tmp_path: Path) -> None:
    path = written(SURVEY, tmp_path / "fly.plan")
    result = check(path, "--json")
    found = json.loads(result.stdout, parse_constant=pytest.fail)
    assert (result.exit_code, found["ok"], found["items"], found["photographs"]) == (0, True, 12, 18)
    assert found["distance_m"] == pytest.approx(SURVEY.distance_m, abs=0.1)
    assert found["home"] == {"lat": 47.0, "lon": 8.0, "altitude_m": 400.0}
    assert result.stderr == ""


def test_an_autopilot_that_refuses_is_exit_code_1(tmp_path: Path) -> None:
    circle = waypoint(command=LOITER_TURNS, params=(1.0, 0.0, 0.0, 0.0))
    path = written(mission_of(waypoint(), circle, waypoint(47.002)), tmp_path / "fly.plan")
    assert check(path).exit_code == 0
    for autopilot in ("px4", "generic"):
        result = check(path, "--autopilot", autopilot)
        assert result.exit_code == 1
        assert "fly.plan: PX4 refuses it: item 3: PX4 does not fly LOITER_TURNS" in result.stderr
    assert "refuses it: a .kmz of DJI cannot hold command 18 (item 3)" in result.stdout
    assert json.loads(check(path, "--autopilot", "px4", "--json").stdout)["problems"]


def test_a_fence_that_is_left_is_exit_code_1(tmp_path: Path) -> None:
    fly = written(replace(FENCED), tmp_path / "fly.plan")
    result = check(fly)
    assert result.exit_code == 1
    assert "leaves the fence (shape 1)" in result.stderr
    near = (waypoint(-33.856, 151.21), waypoint(-33.86, 151.22))
    inside = Mission(HomePosition(-33.855, 151.216, 5.0), near, fence=FENCE[:1], rally=RALLY)
    result = check(written(inside, tmp_path / "inside.plan"))
    assert result.exit_code == 0
    assert "1 to stay inside, 0 to keep out of" in result.stdout


def test_an_unsafe_item_is_named(tmp_path: Path) -> None:
    path = tmp_path / "fly.waypoints"
    path.write_text(waypoints_text(SURVEY).replace("\t50.000000\t1\n", "\t-50.000000\t1\n"))
    result = check(path)
    assert result.exit_code == 1 and result.stdout == ""
    assert "fly.waypoints: item 1: altitude is -50 m" in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_what_a_pilot_should_know_is_noted(tmp_path: Path) -> None:
    path = written(Mission(HomePosition(47.0, 8.0), (waypoint(altitude_m=150.0),)), tmp_path / "fly.plan")
    notes = check(path).stderr
    assert "no takeoff" in notes and "ends in the air" in notes and "150 m above home" in notes
    assert check(path, "-q").output == ""


def test_zones_limits_and_ground_are_checked(tmp_path: Path) -> None:
    lon = np.array([item.lon for item in SURVEY.items if item.has_position])
    lat = np.array([item.lat for item in SURVEY.items if item.has_position])
    zone = tmp_path / "zone.geojson"
    polygons = [shapely.Point(lon.max(), lat.max()).buffer(1e-5)]
    geopandas.GeoDataFrame({"id": [1]}, geometry=polygons, crs=4326).to_file(zone)
    path, dem = written(SURVEY, tmp_path / "fly.plan"), tmp_path / "hill.tif"
    ground = np.full((50, 50), 400, np.float32)
    ground[:, 25:] = 446
    how = {"height": 50, "width": 50, "count": 1, "dtype": "float32", "crs": "EPSG:4326"}
    step = Affine(6e-4, 0, lon.mean() - 0.015, 0, -6e-4, lat.mean() + 0.015)
    with rasterio.open(dem, "w", "GTiff", transform=step, **how) as file:
        file.write(ground, 1)
    for words, said in (
        (["--avoid", zone], "of a keep-out zone, and at least 10 m are kept"),
        (["--avoid", zone, "--avoid-margin", "0"], "within 0.0 m of a keep-out zone"),
        (["--max-altitude", "49"], "50.0 m high, above the 49 m"),
        (["--max-distance", "20"], "farther than the 20 m"),
        (["--dem", dem], "above the ground of hill.tif, and at least 5.0 m"),
        (["--max-altitude", "nan"], "--max-altitude is above 0"),
        (["--avoid", tmp_path / "none.gpkg"], "none.gpkg does not exist"),
    ):
        result = check(path, *words, "-q")
        assert (result.exit_code, len(result.stderr.splitlines())) == (1, 1) and said in result.stderr
    assert check(path, "--max-altitude", 51, "--max-distance", 5000).exit_code == 0
    assert "keep-out zone" in uavseg.check(path, avoid=zone).problems[0]


def test_commands_that_are_not_known_are_kept_and_listed(tmp_path: Path) -> None:
    home = "0 0 0 16 0 0 0 0 -35.363262 149.165237 584 1\n1 0 3 22 0 0 0 0 -35.3633 149.1652 20 1\n"
    for number, (item, listed, moves) in enumerate(
        [
            ("2 0 0 218 70 2 0 0 0 0 0 1", "not checked: 218", False),
            ("2 0 3 94 0 0 0 0 -35.363 149.165 9 1", "not checked: 94", True),
            ("2 0 3 36 90 0 0 0 -35.363 149.165 9 1", "not checked: 36", True),
            ("2 0 0 177 1 2 0 0 0 0 0 1", "item 2 (command 177): where", True),
            ("2 0 3 82 0 0 0 0 -35.363 149.165 9 1", "item 2 (command 82): where", True),
            ("2 0 3 18 3 0 9 0 -35.363 149.165 9 1", "item 2 (command 18): where", True),
            ("2 0 0 93 5 0 0 0 0 0 0 1", "", False),
        ]
    ):
        path, zone = tmp_path / f"{number}.waypoints", tmp_path / f"{number}.geojson"
        path.write_text(f"QGC WPL 110\n{home}{item}\n3 0 0 20 0 0 0 0 0 0 0 1\n")
        far = shapely.box(149.3, -35.3, 149.31, -35.29)
        geopandas.GeoDataFrame({"id": [1]}, geometry=[far], crs=4326).to_file(zone)
        result = check(path)
        assert result.exit_code == 0 and listed in result.stderr
        assert ("known here" in result.stderr) == bool(listed)
        result = check(path, "--avoid", zone, "-q")  # nobody knows whether it keeps away
        assert result.exit_code == int(moves) and ("neither checked" in result.stderr) == moves


@pytest.mark.parametrize("name", ["none.plan", "fly.txt", "."])
def test_what_is_no_mission_file_is_one_line(tmp_path: Path, name: str) -> None:
    result = check(tmp_path / name)
    assert result.exit_code == 1 and len(result.stderr.splitlines()) == 1


def test_wrong_usage_ends_with_2() -> None:
    assert check().exit_code == 2
    assert check("x.plan", "--autopilot", "dji").exit_code == 2


def test_python_gives_the_same(tmp_path: Path) -> None:
    path = written(SURVEY, tmp_path / "fly.plan")
    found = uavseg.check(path)
    assert json.loads(check(path, "--json").stdout) == found.as_dict()
    assert found.mission == SURVEY and found.problems == ()
    assert uavseg.check(SURVEY).as_dict()["items"] == 12
    with pytest.raises(ParameterError, match="'dji'"):
        uavseg.check(path, autopilot="dji")
    with pytest.raises(MissionError, match="there is no file"):
        uavseg.check(tmp_path / "none.plan")
