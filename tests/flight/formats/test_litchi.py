"""Litchi's .csv files: the columns of the Mission Hub, its limits, and files that are none."""

import csv
from dataclasses import replace
from pathlib import Path

import pytest

from tests.flight.formats.test_kmz import SURVEY, mission_of, orbit
from tests.flight.mission_items import waypoint
from uavseg.errors import MissionError
from uavseg.flight.formats import files
from uavseg.flight.formats.litchi import litchi_losses, write_litchi
from uavseg.flight.formats.options import FileOptions
from uavseg.flight.mission.items import (
    CHANGE_SPEED,
    FRAME_MISSION,
    FRAME_TERRAIN,
    IMAGE_START,
    RETURN,
    ROI_LOCATION,
    MissionItem,
)

# The first line of a file that the Mission Hub exports in metric units.
HEADER = (
    "latitude,longitude,altitude(m),heading(deg),curvesize(m),rotationdir,gimbalmode,gimbalpitchangle,"
    + "".join(f"actiontype{n},actionparam{n}," for n in range(1, 16))
    + "altitudemode,speed(m/s),poi_latitude,poi_longitude,poi_altitude(m),poi_altitudemode,"
    "photo_timeinterval,photo_distinterval"
)


def rows(content: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(content.decode().splitlines()))


def test_the_columns_are_those_of_the_mission_hub() -> None:
    content = write_litchi(SURVEY, FileOptions())
    assert content.decode().splitlines()[0] == HEADER
    assert all(line.count(",") == HEADER.count(",") for line in content.decode().splitlines())


def test_a_survey_is_photographed_line_by_line() -> None:
    found = rows(write_litchi(SURVEY, FileOptions()))
    assert [row["photo_distinterval"] for row in found] == ["12.5", "-1", "12.5", "-1"]
    assert {(row["gimbalmode"], row["gimbalpitchangle"], row["speed(m/s)"]) for row in found} == {
        ("2", "-80.0", "7.5")
    }
    assert {(row["curvesize(m)"], row["altitudemode"], row["altitude(m)"]) for row in found} == {
        ("0", "0", "50.0")
    }
    assert [float(row["latitude"]) for row in found] == [47.001, 47.002, 47.002, 47.001]


def test_holds_and_photographs_are_actions() -> None:
    photo = MissionItem(IMAGE_START, FRAME_MISSION, (0.0, 0.0, 1.0, 0.0))
    stop = waypoint(params=(2.5, 0.0, 0.0, None))
    [first, second] = rows(write_litchi(mission_of(stop, photo, waypoint(47.002)), FileOptions()))
    assert [first[f"action{word}{n}"] for n in (1, 2, 3) for word in ("type", "param")] == [
        *("0", "2500", "1", "0", "-1", "0"),
    ]
    assert second["actiontype1"] == "-1"


def test_heights_above_the_terrain_are_above_ground_in_litchi(tmp_path: Path) -> None:
    spots = [waypoint(47 + n / 1000, frame=FRAME_TERRAIN) for n in (1, 2)]
    path = tmp_path / "fly.csv"
    path.write_bytes(write_litchi(mission_of(*spots), FileOptions()))
    assert {row["altitudemode"] for row in rows(path.read_bytes())} == {"1"}
    found = files.read_mission(path)
    assert found.autopilot == "ardupilot" and found.items[-1].frame == FRAME_TERRAIN


def test_an_orbit_looks_at_its_region(tmp_path: Path) -> None:
    path = tmp_path / "fly.csv"
    path.write_bytes(write_litchi(orbit(), FileOptions()))
    found = rows(path.read_bytes())
    assert [row["gimbalmode"] for row in found] == ["1"] * 4 + ["0"]
    places = {
        (row["poi_latitude"], row["poi_longitude"], row["poi_altitude(m)"], row["poi_altitudemode"])
        for row in found[:4]
    }
    assert places == {("47.01000000", "8.01000000", "10.0", "0")}
    assert (found[4]["poi_latitude"], found[4]["poi_longitude"]) == ("0", "0")
    headings = [float(row["heading(deg)"]) for row in found[:4]]
    assert headings == pytest.approx([180, 240, 300, 360], abs=0.1)  # from each to the place
    assert any("heading mode to custom" in note for note in litchi_losses(orbit(), FileOptions()))
    mission = files.read_mission(path)
    look = next(item for item in mission.items if item.command == ROI_LOCATION)
    assert (look.lat, look.lon, look.altitude_m) == (47.01, 8.01, 10.0)
    assert not any("interest" in note for note in mission.notes)


def test_what_has_to_be_set_in_litchi_is_said() -> None:
    [note] = litchi_losses(SURVEY, FileOptions())
    assert "straight lines" in note and "finish action to RTH" in note and "47.000000,8.000000" in note
    turned = replace(SURVEY, items=(*SURVEY.items, MissionItem(CHANGE_SPEED, FRAME_MISSION, (1, 3, -1, 0))))
    assert turned.items[-2].command == RETURN
    with pytest.raises(MissionError, match="follows"):
        litchi_losses(turned, FileOptions())


@pytest.mark.parametrize(
    ("items", "words"),
    [
        ([waypoint()], "2 to 99 waypoints, and the mission has 1"),
        ([waypoint(47 + n / 1000) for n in range(1, 101)], r"has 100: split it"),
        ([waypoint(), waypoint(47.002, altitude_m=501.0)], "waypoint 2 is at 501 m"),
        ([waypoint(), waypoint(47.002, params=(40.0, 0.0, 0.0, None))], "up to 32 s"),
        ([waypoint(), waypoint()], "from waypoint 1 to 2 is 0.0 m long"),
        ([waypoint(), waypoint(47.03)], "is 32.* m long"),
        (
            [MissionItem(CHANGE_SPEED, FRAME_MISSION, (1.0, 20.0, -1.0, 0.0)), waypoint(), waypoint(47.002)],
            "asks for 20 m/s",
        ),
    ],
)
def test_what_litchi_cannot_fly_is_refused(tmp_path: Path, items: list[MissionItem], words: str) -> None:
    with pytest.raises(MissionError, match=words):
        files.write_mission(mission_of(*items), tmp_path / "fly.csv")
    assert not list(tmp_path.iterdir())


GOOD = write_litchi(SURVEY, FileOptions()).decode()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "does not name latitude"),
        ("id,name\n1,a\n", "does not name latitude, longitude, altitude"),
        (HEADER + "\n", "holds no waypoints"),
        (GOOD.replace("altitude(m)", "altitude(ft)", 1), "in feet"),
        (GOOD.replace("47.00100000", "here", 1), "latitude of waypoint 1 is 'here'"),
        (GOOD.replace("47.00100000", "97.0", 1), "-90..90"),
        (GOOD.replace("50.0", "nan", 1), r"altitude\(m\) of waypoint 1 is .nan.; expected a number"),
        (GOOD.replace("50.0,", "50.0,1,", 1), "waypoint 1 has 47 fields instead of 46"),
        (GOOD.replace("rotationdir", "latitude", 1), "same name"),
        (GOOD.replace("8.00000000", '"8.0', 1), "not a table"),
        (GOOD.replace("8.00000000", "\udcff", 1), "not UTF-8"),
        (HEADER + "\n" + "\n" * 100_001, "more than 100,000 rows"),
    ],
)
def test_other_tables_are_refused_in_one_line(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "odd.csv"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(MissionError, match=words) as refused:
        files.read_mission(path)
    assert "odd.csv" in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (",-1,0,-1,0", ",5,0,-1,0", "type 5"),
        (",0,0,2,-80", ",3.5,0,2,-80", "curves"),
        (",2,-80", ",1,-80", "interest"),
    ],
)
def test_what_is_not_read_is_noted(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert old in GOOD
    path = tmp_path / "fly.csv"
    path.write_text(GOOD.replace(old, new, 1))
    assert any(words in note for note in files.read_mission(path).notes)
