"""DJI's .kmz files: the published format, and files that are not one."""

import math
import warnings
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Callable
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
import shapely
from hypothesis import given, settings, strategies as st
from pyproj import Geod

from tests.flight.fences import FENCE, RALLY
from tests.flight.formats.random_missions import HOME, routes
from tests.flight.formats.wpml_schema import TEMPLATE, WAYLINES, WPML, faults
from tests.flight.mission_items import waypoint
from uavseg.errors import MissionError, ParameterError
from uavseg.flight.camera.camera import Photos, camera_named, cameras
from uavseg.flight.formats import files
from uavseg.flight.formats.kmz import kmz_losses, write_kmz
from uavseg.flight.formats.options import DJI_MODELS, TURNS, FileOptions
from uavseg.flight.formats.wpml import TURN_MODE
from uavseg.flight.mission.items import (
    CAMERA_DISTANCE,
    CHANGE_SPEED,
    FRAME_AMSL,
    FRAME_MISSION,
    FRAME_RELATIVE,
    FRAME_TERRAIN,
    JUMP,
    LAND,
    LOITER_TURNS,
    MOUNT_CONTROL,
    RETURN,
    ROI_LOCATION,
    ROI_NONE,
    TAKEOFF,
    HomePosition,
    MissionItem,
    distance_m,
)
from uavseg.flight.mission.mission import Mission
from uavseg.flight.params.plan import SafetyParams
from uavseg.flight.safety.check import SafetyCheck
from uavseg.jobs.flights.plan import MissionPlan

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


def texts(document: bytes, name: str) -> list[str | None]:
    return [one.text for one in ET.fromstring(document).iter(f"{WPML}{name}")]


def orbit(*after: MissionItem) -> Mission:
    """Half a circle of 100 m around a place at 10 m, 40 m below the flight, and straight on."""
    around = [Geod(ellps="WGS84").fwd(8.01, 47.01, bearing, 100.0)[1::-1] for bearing in (0, 60, 120, 180)]
    first, *others = (waypoint(lat, lon, params=FREE) for lat, lon in around)
    look = MissionItem(ROI_LOCATION, FRAME_RELATIVE, lat=47.01, lon=8.01, altitude_m=10.0)
    ahead = MissionItem(ROI_NONE, FRAME_MISSION)
    return mission_of(first, look, *others, ahead, waypoint(47.0, 8.01, params=FREE), *after)


@pytest.mark.parametrize("model", ["m3e", "mini4pro"])
def test_an_orbit_looks_at_its_region(model: str) -> None:
    waylines = documents(orbit(), model)[1].replace(b"www.uav.com", b"www.dji.com")
    assert texts(waylines, "waypointHeadingMode") == ["towardPOI"] * 3 + ["followWayline"] * 2
    targets = [text for text in texts(waylines, "waypointPoiPoint") if text != "0.000000,0.000000,0.000000"]
    assert targets == ["47.010000,8.010000,10.000000"] * 3
    [pitch] = texts(waylines, "gimbalPitchRotateAngle")  # the same all around
    assert float(pitch or 0) == pytest.approx(-math.degrees(math.atan2(40, 100)), abs=0.06)


def test_the_gimbal_returns_to_its_own_pitch() -> None:
    own = MissionItem(MOUNT_CONTROL, FRAME_MISSION, (-70.0, 0.0, 0.0, 0.0), altitude_m=2.0)
    mission = orbit()
    turned = replace(mission, items=(UP, own, *mission.items[1:]))
    assert texts(documents(turned)[1], "gimbalPitchRotateAngle") == ["-21.8", "-70"]


def test_a_place_to_look_at_is_read_back(tmp_path: Path) -> None:
    path = tmp_path / "fly.kmz"
    with pytest.warns(UserWarning, match="take off at"):
        files.write_mission(orbit(), path)
    found = files.read_mission(path)
    assert [item for item in found.items if item.command in {ROI_LOCATION, ROI_NONE}] == [
        item for item in orbit().items if item.command in {ROI_LOCATION, ROI_NONE}
    ]
    assert not any("not read" in note for note in found.notes)


def test_places_to_look_at_above_the_terrain_are_said_to_be_left_out() -> None:
    look = MissionItem(ROI_LOCATION, FRAME_TERRAIN, lat=47.01, lon=8.01, altitude_m=10.0)
    mission = mission_of(waypoint(47.001, params=FREE), look, waypoint(47.002, params=FREE))
    assert texts(documents(mission)[1], "waypointHeadingMode") == ["followWayline"] * 2
    assert any("look at" in note for note in kmz_losses(mission, FileOptions()))


@pytest.mark.parametrize(
    ("model", "lens", "written"),
    [
        ("m3e", None, "wide"),
        ("m3t", None, "visable,ir"),
        ("m3m", None, "visable,narrow_band"),
        ("m30t", None, "wide,ir"),
        ("m350-h30t", "zoom, ir", "zoom,ir"),
        ("m3t", "ir,ir", "ir"),
    ],
)
def test_photographs_are_taken_with_the_lenses_that_there_are(
    model: str, lens: str | None, written: str
) -> None:
    template, waylines = documents(SURVEY, model, lens=lens)
    assert texts(template, "imageFormat") == [written]
    assert set(texts(template, "payloadLensIndex") + texts(waylines, "payloadLensIndex")) == {written}
    assert set(texts(waylines, "useGlobalPayloadLensIndex")) == {"1"}
    assert faults(template, TEMPLATE) == faults(waylines, WAYLINES) == []


@pytest.mark.parametrize("model", PILOT)
def test_default_lenses_are_lenses_of_the_aircraft(model: str) -> None:
    found = DJI_MODELS[model]
    assert found.default_lenses and set(found.default_lenses) <= set(found.lenses)
    known = {camera.name for camera in cameras()}
    assert set(found.cameras) <= known


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"lens": "ir"}, "a Mavic 3E .* has the lenses wide, zoom, not 'ir'"),
        ({"dji_model": "m3m", "lens": "visible,wide"}, "visible, narrow_band, not 'wide'"),
        ({"lens": ""}, "not ''"),
        ({"turn": "round"}, "stop, through, not 'round'"),
    ],
)
def test_other_lenses_and_turns_are_refused(tmp_path: Path, how: dict[str, str], words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        files.write_mission(SURVEY, tmp_path / "fly.kmz", **how)  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", [".plan", ".csv", ".waypoints"])
@pytest.mark.parametrize("how", [{"lens": "wide"}, {"turn": "through"}])
def test_lenses_and_turns_are_for_a_kmz(tmp_path: Path, suffix: str, how: dict[str, str]) -> None:
    with pytest.raises(ParameterError, match=r"is for a \.kmz"):
        files.write_mission(SURVEY, tmp_path / f"fly{suffix}", **how)  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def test_the_lens_in_view_is_a_matter_of_the_pilot() -> None:
    assert any("in view" in note for note in kmz_losses(SURVEY, FileOptions(dji_model="m4t")))
    for how in ({"dji_model": "m3m"}, {"dji_model": "m4t", "lens": "wide,ir"}, {}):
        assert not any("in view" in note for note in kmz_losses(SURVEY, FileOptions(**how)))  # type: ignore[arg-type]


def test_an_aircraft_stops_or_passes_within_two_metres() -> None:
    stop = waypoint(47.0025, 8.001, params=(2.0, 0.0, 0.0, None))
    corners = waypoint(47.001), waypoint(47.002), waypoint(47.00201), stop, waypoint(47.003), waypoint(47.004)
    stopped, passed = (documents(mission_of(*corners), turn=turn)[1] for turn in TURNS)
    assert set(texts(stopped, "waypointTurnDampingDist")) == {"0"}
    assert set(texts(stopped, "waypointTurnMode")) == {TURN_MODE}
    assert set(texts(passed, "useStraightLine")) == {"1"}
    modes = texts(passed, "waypointTurnMode")
    assert [mode == TURN_MODE for mode in modes] == [True, False, False, True, False, True]
    short = distance_m(47.002, 8.0, 47.00201, 8.0)
    turns = [float(text or 0) for text in texts(passed, "waypointTurnDampingDist")]
    assert turns == pytest.approx([0, 0.45 * short, 0.45 * short, 0, 2, 0], abs=1e-3)
    assert any(
        ", which stops at every waypoint" in note for note in kmz_losses(mission_of(*corners), FileOptions())
    )
    notes = kmz_losses(mission_of(*corners), FileOptions(turn="through"))
    assert not any("stops" in note for note in notes)
    assert any("up to 1 m: keep more than that from zones" in note for note in notes)


def test_corners_that_may_be_cut_stay_out_of_zones(tmp_path: Path) -> None:
    zones = [shapely.box(8.01, 47.01, 8.02, 47.02)]
    near, far = (SafetyCheck(SafetyParams(avoid_margin_m=margin), zones) for margin in (0.9, 1.0))
    with pytest.raises(MissionError, match="up to 1 m at corners"):
        MissionPlan((SURVEY,), 1, near).write(tmp_path / "fly.kmz", turn="through")
    assert not list(tmp_path.iterdir())
    for check, turn in ((near, "stop"), (far, "through")):
        with warnings.catch_warnings(action="ignore"):
            MissionPlan((SURVEY,), 1, check).write(tmp_path / "fly.kmz", overwrite=True, turn=turn)


def photographed(camera: str) -> Mission:
    return replace(SURVEY, photos=Photos(camera_named(camera)))


@pytest.mark.parametrize(
    ("model", "camera"),
    [
        ("m3e", "DJI Phantom 4 RTK"),
        ("m3e", "Sony RX0"),
        ("m3t", "DJI Mavic 3 Enterprise"),
        ("m3m", "DJI Mavic 3 Thermal"),
        ("m300-h20", "DJI Mini 2"),
        ("m350-h30t", "DJI Mavic 3 Enterprise"),
        ("mini4pro", "DJI Mini 3 Pro"),
        ("mavic3", "DJI Mavic 3 Enterprise"),
    ],
)
def test_a_camera_of_another_aircraft_is_refused(tmp_path: Path, model: str, camera: str) -> None:
    with pytest.raises(MissionError, match=f"camera {camera}, which a {DJI_MODELS[model].name} .* not carry"):
        files.write_mission(photographed(camera), tmp_path / "fly.kmz", dji_model=model)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("model", "camera", "noted"),
    [
        ("m3e", "DJI Mavic 3 Enterprise", False),
        ("m3t", "DJI Mavic 3 Thermal wide", False),
        ("m300-h20t", "DJI Zenmuse H20T thermal", False),
        ("m300-h20", "DJI Zenmuse H30", True),
        ("m350-h30", "MicaSense Altum", True),
        ("m3d", "DJI Mavic 3 Enterprise", True),  # its own is not in the catalogue
        ("mavic3pro", "DJI Mavic 3", False),
    ],
)
def test_a_camera_that_may_be_carried_is_written(model: str, camera: str, noted: bool) -> None:
    options = FileOptions(dji_model=model)
    assert write_kmz(photographed(camera), options)
    told = any(
        f"planned for the camera {camera}" in note for note in kmz_losses(photographed(camera), options)
    )
    assert told == noted


def test_a_camera_of_ones_own_is_written() -> None:
    own = replace(camera_named("DJI Phantom 4 RTK"), focal_mm=9.0)
    assert write_kmz(replace(SURVEY, photos=Photos(own)), FileOptions())


def test_a_landing_at_the_last_waypoint_adds_none() -> None:
    land = MissionItem(LAND, FRAME_RELATIVE, FREE, 47.002, 8.0)
    document = documents(mission_of(waypoint(47.001), waypoint(47.002), land))[1]
    assert len(texts(document, "index")) == 2 and texts(document, "finishAction") == ["autoLand"]


def test_a_photograph_that_a_trigger_takes_at_once_is_taken() -> None:
    once = [MissionItem(CAMERA_DISTANCE, FRAME_MISSION, (every, 0.0, 1.0, 0.0)) for every in (9.0, 0.0)]
    document = documents(mission_of(waypoint(47.001), *once, waypoint(47.002)))[1]
    assert texts(document, "actionActuatorFunc") == ["takePhoto"]
    assert texts(document, "actionTriggerType") == ["reachPoint"]


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
        ((waypoint(),), "2 to 65535"),
        ((waypoint(47.001), waypoint(47.001, 8.000006)), "legs of 0.5 m at least, and .* is 0.46 m long"),
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


def looking(place: str) -> Callable[[], bytes]:
    point = f"towardPOI</wpml:waypointHeadingMode><wpml:waypointPoiPoint>{place}</wpml:waypointPoiPoint>"
    return swapped(b"followWayline</wpml:waypointHeadingMode>", point.encode())


@pytest.mark.slow
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
        (looking("47,8"), "waypointPoiPoint is '47,8'; expected latitude,longitude,height"),
        (looking("47,8,low"), "waypointPoiPoint is 'low'; expected a number"),
        (looking("97,8,0"), "a place to look at lies at lat 97"),
        (looking("47,8,nan"), "finite numbers"),
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
