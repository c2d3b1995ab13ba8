"""DJI's .kmz files: the published format, and files that are not one."""

import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Callable
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.flight.fences import FENCE, RALLY
from tests.flight.formats.random_missions import HOME, routes
from tests.flight.formats.wpml_schema import TEMPLATE, WAYLINES, WPML, faults
from tests.flight.mission_items import waypoint
from uavseg.errors import MissionError, ParameterError
from uavseg.flight.formats import files
from uavseg.flight.formats.kmz import kmz_losses, write_kmz
from uavseg.flight.formats.options import DJI_MODELS, TURNS, FileOptions
from uavseg.flight.mission.items import (
    CAMERA_DISTANCE,
    CHANGE_SPEED,
    FRAME_AMSL,
    FRAME_MISSION,
    FRAME_RELATIVE,
    FRAME_TERRAIN,
    JUMP,
    LOITER_TURNS,
    MOUNT_CONTROL,
    RETURN,
    TAKEOFF,
    HomePosition,
    MissionItem,
)
from uavseg.flight.mission.mission import Mission

UP = MissionItem(TAKEOFF, FRAME_RELATIVE, (0.0, 0.0, 0.0, None), 47.0, 8.0, 50.0)
FREE = (0.0, 0.0, 0.0, None)


def mission_of(*items: MissionItem, autopilot: str = "ardupilot") -> Mission:
    return Mission(HomePosition(47.0, 8.0, 400.0), (UP, *items), autopilot)


PILOT = [key for key, model in DJI_MODELS.items() if not model.is_for_fly]


def documents(mission: Mission, model: str = "m3e", **how: Any) -> tuple[bytes, bytes]:
    with zipfile.ZipFile(BytesIO(write_kmz(mission, FileOptions(dji_model=model, **how)))) as made:
        assert made.namelist() == ["wpmz/template.kml", "wpmz/waylines.wpml"]
        return made.read("wpmz/template.kml"), made.read("wpmz/waylines.wpml")


SURVEY = mission_of(
    MissionItem(CHANGE_SPEED, FRAME_MISSION, (1.0, 7.5, -1.0, 0.0)),
    MissionItem(MOUNT_CONTROL, FRAME_MISSION, (-80.0, 0.0, 0.0, 0.0), altitude_m=2.0),
    waypoint(47.001, params=FREE),
    MissionItem(CAMERA_DISTANCE, FRAME_MISSION, (12.5, 0.0, 1.0, 0.0)),
    waypoint(47.002, params=FREE),
    MissionItem(CAMERA_DISTANCE, FRAME_MISSION, (0.0, 0.0, 0.0, 0.0)),
    waypoint(47.002, 8.001, params=FREE),
    MissionItem(CAMERA_DISTANCE, FRAME_MISSION, (12.5, 0.0, 1.0, 0.0)),
    waypoint(47.001, 8.001, params=FREE),
    MissionItem(CAMERA_DISTANCE, FRAME_MISSION, (0.0, 0.0, 0.0, 0.0)),
    MissionItem(RETURN, FRAME_MISSION),
)


@pytest.mark.slow
@given(mission=routes(), turn=st.sampled_from(TURNS), model=st.sampled_from(PILOT))
@settings(max_examples=150)
def test_documents_are_what_dji_publishes(mission: Mission, turn: str, model: str) -> None:
    template, waylines = documents(mission, model, turn=turn)
    assert faults(template, TEMPLATE) == []
    assert faults(waylines, WAYLINES) == []


@pytest.mark.parametrize("model", PILOT)
def test_every_aircraft_is_one_of_dji(model: str) -> None:
    template, waylines = documents(SURVEY, model)
    assert faults(template, TEMPLATE) == faults(waylines, WAYLINES) == []
    with pytest.raises(ParameterError, match=r"one of m3e, .*not 'phantom'"):
        FileOptions(dji_model="phantom")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"goHome", b"comeHome"),
        (b"<wpml:index>1</wpml:index>", b"<wpml:index>7</wpml:index>"),
        (b"<wpml:finishAction>goHome</wpml:finishAction>", b""),
        (b"<wpml:droneEnumValue>77<", b"<wpml:droneEnumValue>78<"),
        (b"multipleDistance", b"reachPoint"),
        (b"<wpml:actionGroupEndIndex>1<", b"<wpml:actionGroupEndIndex>9<"),
        (b"<wpml:executeHeight>50</wpml:executeHeight>", b"<wpml:height>50</wpml:height>"),
        (b"<wpml:globalTransitionalSpeed>7.5<", b"<wpml:globalTransitionalSpeed>17.5<"),
        (b"takePhoto", b"takePicture"),
        (b"http://www.dji.com/wpmz/1.0.2", b"http://www.dji.com/wpmz/9.9.9"),
    ],
)
def test_the_schema_refuses_other_documents(old: bytes, new: bytes) -> None:
    document = documents(SURVEY)[1]
    assert old in document and faults(document, WAYLINES) == []
    assert faults(document.replace(old, new), WAYLINES)


def test_lines_are_photographed_at_equal_distances() -> None:
    waylines = ET.fromstring(documents(SURVEY)[1])
    groups = [
        tuple(
            group.findtext(f".//{WPML}{name}")
            for name in (
                "actionGroupStartIndex",
                "actionGroupEndIndex",
                "actionTriggerType",
                "actionTriggerParam",
                "actionActuatorFunc",
            )
        )
        for group in waylines.iter(f"{WPML}actionGroup")
    ]
    assert groups == [
        ("0", "0", "reachPoint", None, "gimbalRotate"),
        ("0", "1", "multipleDistance", "12.5", "takePhoto"),
        ("2", "3", "multipleDistance", "12.5", "takePhoto"),
    ]
    assert waylines.findtext(f".//{WPML}gimbalPitchRotateAngle") == "-80"
    config = {
        name: waylines.findtext(f".//{WPML}{name}") for name in ("takeOffSecurityHeight", "globalRTHHeight")
    }
    assert config == {"takeOffSecurityHeight": "50", "globalRTHHeight": "50"}


def test_the_same_mission_gives_the_same_bytes() -> None:
    assert write_kmz(SURVEY, FileOptions()) == write_kmz(SURVEY, FileOptions())


def test_heights_above_the_sea_become_heights_above_home() -> None:
    high = mission_of(waypoint(47.001, altitude_m=465.5, frame=FRAME_AMSL), waypoint(47.002))
    heights = [one.text for one in ET.fromstring(documents(high)[1]).iter(f"{WPML}executeHeight")]
    assert heights == ["65.5", "50"]
    assert any("above home (400 m above the sea)" in note for note in kmz_losses(high, FileOptions()))


def test_what_is_not_held_is_said() -> None:
    yaw = MissionItem(115, FRAME_MISSION)
    notes = kmz_losses(replace(SURVEY, items=(*SURVEY.items[:4], yaw, *SURVEY.items[4:])), FileOptions())
    assert [note for note in notes if "command 115 (item 5)" in note]
    assert any("47.000000,8.000000" in note and "Mavic 3E" in note for note in notes)
    near = HomePosition(-33.851, 151.21, 5.0)
    fenced = Mission(near, (waypoint(-33.85, 151.21), waypoint(-33.85, 151.213)), fence=FENCE, rally=RALLY)
    assert any("fence or rally points" in note for note in kmz_losses(fenced, FileOptions()))


@pytest.mark.parametrize(
    ("items", "words"),
    [
        ((waypoint(),), "2 to"),
        ((waypoint(), waypoint(47.002, frame=FRAME_TERRAIN)), "above the terrain"),
        ((waypoint(), waypoint(command=LOITER_TURNS)), r"command 18 \(item 3\)"),
        ((waypoint(), MissionItem(RETURN, FRAME_MISSION), waypoint()), "item 4 follows"),
        ((waypoint(), UP, waypoint()), "second takeoff"),
        (
            (MissionItem(CHANGE_SPEED, FRAME_MISSION, (1.0, 16.0, -1.0, 0.0)), waypoint(), waypoint(47.002)),
            "up to 15 m/s",
        ),
        ((waypoint(), MissionItem(JUMP, FRAME_MISSION, (1.0, 3.0, 0.0, 0.0)), waypoint()), "command 177"),
    ],
)
def test_what_dji_cannot_fly_is_refused(tmp_path: Path, items: tuple[MissionItem, ...], words: str) -> None:
    with pytest.raises(MissionError, match=words):
        files.write_mission(mission_of(*items), tmp_path / "fly.kmz")
    assert not list(tmp_path.iterdir())


def archive(content: bytes, name: str = "wpmz/waylines.wpml", method: int = zipfile.ZIP_DEFLATED) -> bytes:
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w", method) as made:
        made.writestr(name, content)
    return stream.getvalue()


def swapped(old: bytes, new: bytes) -> Callable[[], bytes]:
    def make() -> bytes:
        document = documents(SURVEY)[1]
        assert old in document
        return archive(document.replace(old, new))

    return make


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: b"", "not a zip archive"),
        (lambda: b"PK\x03\x04 and no more", "not a zip archive"),
        (lambda: write_kmz(SURVEY, FileOptions())[:900], "not a zip archive"),
        (lambda: archive(b"<kml/>", "doc.kml"), "holds no wpmz/waylines.wpml"),
        (lambda: archive(b"<kml/>"), "no element Document/missionConfig"),
        (lambda: archive(b"<kml>"), "not well-formed"),
        (lambda: archive(b" " * (70 << 20)), "more than 67,108,864 bytes"),
        (lambda: archive(b"<kml/>", method=zipfile.ZIP_LZMA), "otherwise than by deflate"),
        (lambda: archive(b'<!DOCTYPE k [<!ENTITY a "aaaa">]><k>&a;</k>'), "document type"),
        (lambda: archive('<!DOCTYPE k SYSTEM "file:///etc/passwd"><k/>'.encode("utf-16")), "document type"),
        (lambda: archive(b"<k>" * 99 + b"</k>" * 99), "too deep"),
        (swapped(b"relativeToStartPoint", b"WGS84"), "above the ellipsoid"),
        (swapped(b"relativeToStartPoint", b"somehow"), "'somehow'"),
        (swapped(b"<wpml:executeHeight>50<", b"<wpml:executeHeight>high<"), "'high'; expected a number"),
        (swapped(b"<wpml:executeHeight>50<", b"<wpml:executeHeight>-50<"), "more than 0"),
        (swapped(b"<wpml:executeHeight>50<", b"<wpml:executeHeight>nan<"), "finite"),
        (swapped(b"<wpml:index>1<", b"<wpml:index>5<"), "waypoint 1"),
        (swapped(b"EndIndex>3<", b"EndIndex>4<"), "2 to 4"),
        (swapped(b"8.0,47.001<", b"8.0;47.001<"), "longitude,latitude"),
        (swapped(b"8.0,47.001<", b"47.001,98.0<"), "swapped|-90..90"),
        (swapped(b"<Folder>", b"<Folder/><Folder>"), "2 waylines"),
    ],
)
def test_damaged_and_hostile_archives_are_refused_in_one_line(
    tmp_path: Path, make: Callable[[], bytes], words: str
) -> None:
    path = tmp_path / "odd.kmz"
    path.write_bytes(make())
    with pytest.raises(MissionError, match=words) as refused:
        files.read_mission(path)
    assert "odd.kmz" in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (b"followWayline", b"towardPOI", "'towardPOI' was not read"),
        (b"toPointAndStopWithDiscontinuityCurvature", b"coordinateTurn", "cut corners"),
        (b">gimbalRotate<", b">startRecord<", "'startRecord' was not read"),
        (b"goHome", b"gotoFirstWaypoint", "'gotoFirstWaypoint' was not read"),
    ],
)
def test_what_is_not_read_is_noted(tmp_path: Path, old: bytes, new: bytes, words: str) -> None:
    path = tmp_path / "fly.kmz"
    path.write_bytes(swapped(old, new)())
    assert any(words in note for note in files.read_mission(path).notes)


def test_home_is_not_in_the_file(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="take off at"):
        files.write_mission(SURVEY, tmp_path / "fly.kmz")
    found = files.read_mission(tmp_path / "fly.kmz")
    assert (found.home, found.autopilot) == (HomePosition(47.001, 8.0, 0.0), "generic")
    assert found.home != HOME
