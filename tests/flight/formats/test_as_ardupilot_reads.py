"""Missions for ArduPilot are read as it reads them: altitude 0, position 0, 0, separators, no home row."""

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

from tests.flight.formats.mission_texts import plan_text, waypoints_text
from tests.flight.formats.random_missions import missions
from uavseg.errors import MissionError
from uavseg.flight.formats import files
from uavseg.flight.mission.items import (
    FRAME_AMSL,
    FRAME_RELATIVE,
    LAND,
    POSITION_COMMANDS,
    RETURN,
    TAKEOFF,
    WAYPOINT,
    HomePosition,
    MissionItem,
)
from uavseg.flight.mission.mission import Mission

HOME = "0\t0\t0\t16\t0\t0\t0\t0\t-35.363262\t149.165237\t584\t1"
UP = "1\t0\t3\t22\t0\t0\t0\t0\t0\t0\t20\t1"


def rows(*lines: str) -> str:
    return "\n".join(["QGC WPL 110", *lines]) + "\n"


def read(text: str, folder: Path, name: str = "odd.waypoints") -> Mission:
    path = folder / name
    path.write_text(text)
    return files.read_mission(path)


def row(number: int, command: int = 16, frame: int = 3, lat: float = -35.362, lon: float = 149.165,
        altitude: float = 0.0) -> str:  # fmt: skip
    return f"{number}\t0\t{frame}\t{command}\t0\t0\t0\t0\t{lat}\t{lon}\t{altitude}\t1"


def test_altitude_0_keeps_the_height_of_the_item_before_in_its_frame(tmp_path: Path) -> None:
    mission = read(
        rows(HOME, UP, row(2), row(3, frame=0, altitude=700), row(4), row(5, 19), row(6, 21)), tmp_path
    )
    heights = [(item.frame, item.altitude_m) for item in mission.items]
    assert heights == [(3, 20), (3, 20), (0, 700), (0, 700), (0, 700), (3, 0)]
    (note,) = [text for text in mission.warnings if "altitude 0" in text]
    assert note.endswith("to ArduPilot: item 2 at 20 m, item 4 at 700 m, item 5 at 700 m")


def test_position_0_0_is_where_the_vehicle_is(tmp_path: Path) -> None:
    mission = read(rows(HOME, UP, row(2, 19, lat=0, lon=0), row(3), row(4, 18, lat=0, lon=0)), tmp_path)
    up, at_home, there, again = mission.items
    assert up.is_at_vehicle  # a takeoff keeps it
    assert (at_home.lat, at_home.lon) == (mission.home.lat, mission.home.lon)
    assert (again.lat, again.lon) == (there.lat, there.lon) == (-35.362, 149.165)
    after = [row(3), row(4, 94), row(5, 19, lat=0, lon=0), row(6, 20), row(7, lat=0, lon=0)]
    places = [(item.lat, item.lon) for item in read(rows(HOME, UP, row(2), *after), tmp_path).items]
    assert places[4] == places[3] and places[6] == (mission.home.lat, mission.home.lon)
    assert any(
        "item 2 at -35.363262,149.165237, item 2 at 20 m, item 3 at 20 m and 2 more" in text
        for text in mission.warnings
    )


@pytest.mark.parametrize("separator", ["\t", " ", "   \t", ",", " , "])
def test_separators_blank_lines_comments_and_a_byte_order_mark_change_nothing(
    separator: str, tmp_path: Path
) -> None:
    lines = [HOME, UP, row(2, altitude=30)]
    plain = read(rows(*lines), tmp_path)
    odd = "\ufeff" + rows(
        "# by hand", *(f" {line}".replace("\t", separator) for line in lines), "", "  # end"
    )
    assert read(odd.replace("\n", "\r\n"), tmp_path) == plain


@pytest.mark.parametrize("lines", [[UP, row(2, altitude=30)], [row(0, 16, 0, 0, 0), UP, row(2, altitude=30)]])
def test_without_home_it_is_at_the_first_position_and_a_note_says_so(
    lines: list[str], tmp_path: Path
) -> None:
    mission = read(rows(*lines), tmp_path)
    assert mission.home == HomePosition(-35.362, 149.165) and len(mission.items) == 2
    assert "the file does not hold home" in mission.warnings[0]


def test_a_first_row_that_is_no_home_is_said_to_be_lost(tmp_path: Path) -> None:
    mission = read(rows(row(0, 22, 3, altitude=20), row(1, altitude=30)), tmp_path)
    assert [item.command for item in mission.items] == [WAYPOINT]
    assert mission.warnings[0] == "row 0 is home for ArduPilot, which does not fly its command 22"


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ([HOME, row(1)], "item 1: altitude is 0 m; the flight must be above home"),
        ([HOME, row(1, frame=0)], "item 1: ArduPilot reads altitude 0"),
        ([HOME, row(1, 22)], "item 1: altitude is 0 m"),
        ([HOME, UP, row(2, 31)], "item 2: altitude is 0 m"),  # it would go down to it
        ([HOME, row(2, altitude=3)], "line 3 is not item 1"),
        (["1 0 3 178 0 3 0 0 0 0 0 1"], "neither home nor a position"),
        ([], "neither home nor a position"),
    ],
)
def test_what_nobody_can_know_is_refused(lines: list[str], words: str, tmp_path: Path) -> None:
    with pytest.raises(MissionError, match=words):
        read(rows(*lines), tmp_path)


@pytest.mark.parametrize(("frame", "same"), [(5, 0), (6, 3), (11, 10), (2, 0)])
def test_frames_are_those_that_ardupilot_stores(frame: int, same: int, tmp_path: Path) -> None:
    mission = read(rows(HOME, UP, row(2, frame=frame, altitude=700)), tmp_path)
    assert mission.items[1].frame == same


def test_a_landing_at_0_above_the_sea_is_on_the_ground(tmp_path: Path) -> None:
    mission = read(rows(HOME, UP, row(2, 21, 0)), tmp_path)
    assert (mission.items[1].frame, mission.items[1].altitude_m) == (FRAME_RELATIVE, 0)


def test_a_plan_for_ardupilot_is_read_likewise_and_one_for_px4_refused(tmp_path: Path) -> None:
    home = HomePosition(-35.363262, 149.165237, 584.0)
    items = (
        MissionItem(TAKEOFF, FRAME_RELATIVE, altitude_m=20.0),
        MissionItem(WAYPOINT, FRAME_RELATIVE, (0.0, 0.0, 0.0, None), -35.362, 149.165, 77.0),
    )
    text = plan_text(Mission(home, items)).replace("77", "0")
    assert read(text, tmp_path, "a.plan").items[1].altitude_m == 20
    with pytest.raises(MissionError, match="item 2: altitude is 0 m"):
        read(text.replace('"firmwareType": 3', '"firmwareType": 12'), tmp_path, "p.plan")


def test_what_ardupilot_would_read_otherwise_is_not_written() -> None:
    home, up = HomePosition(0.001, 0.001), MissionItem(TAKEOFF, FRAME_RELATIVE, altitude_m=20.0)
    for odd in (
        MissionItem(WAYPOINT, FRAME_AMSL, lat=0.001, lon=0.002, altitude_m=0.0),
        MissionItem(WAYPOINT, FRAME_RELATIVE, lat=0.0, lon=0.0, altitude_m=9.0),
    ):
        with pytest.raises(MissionError, match="item 2: ArduPilot reads"):
            Mission(home, (up, odd))
        Mission(home, (up, odd), "px4")


@pytest.mark.slow
@given(mission=missions(), blanked=st.sets(st.integers(0, 12)))
@settings(max_examples=200)
def test_a_file_whose_heights_and_places_are_left_out_is_read_as_the_one_that_repeats_them(
    mission: Mission, blanked: set[int], tmp_path_factory: pytest.TempPathFactory
) -> None:
    """The slow plain version: each blank is the value of the nearest item before."""
    folder = tmp_path_factory.getbasetemp()
    items, height, place = [], None, (mission.home.lat, mission.home.lon)
    texts = waypoints_text(replace(mission, autopilot="ardupilot")).splitlines()
    for number, item in enumerate(mission.items):
        moves = item.command in POSITION_COMMANDS
        if moves and number in blanked and item.command not in {TAKEOFF, LAND} and height:
            fields = texts[number + 2].split("\t")
            texts[number + 2] = "\t".join([*fields[:8], "0", "0", "0", fields[11]])
            item = replace(item, lat=place[0], lon=place[1], frame=height[0], altitude_m=height[1])
        if moves and item.command != LAND:
            height = item.frame, item.altitude_m
        if item.command == RETURN:
            place = mission.home.lat, mission.home.lon
        elif moves and item.command != TAKEOFF:
            place = item.lat, item.lon
        items.append(item)
    try:
        expected = Mission(mission.home, tuple(items))
    except MissionError:  # too far from home
        return
    plain = read(waypoints_text(expected), folder, "plain.waypoints")
    assert read("\n".join(texts), folder, "blank.waypoints") == plain
