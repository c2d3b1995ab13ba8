"""Logs of a flight that was cut: its last photograph, or the last place in mission mode."""

import os
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import uavseg
from tests.flight.flight_logs import dataflash, ulog
from tests.flight.test_resume import area, first_number, shots
from uavseg.errors import MissionError
from uavseg.flight.link.logs import LogEnd, end_of_log
from uavseg.flight.mission.items import distance_m
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.track import Plane
from uavseg.flight.planning.resume import path_of, stops_of

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")

AUTO, RTL = 3, 6
PLACES = [(47.0, 8.0), (-33.9, 179.9995)]


@cache
def planned(autopilot: str, place: tuple[float, float] = PLACES[0]) -> Mission:
    lat, lon = place
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return uavseg.plan(
            area(lon, lat),
            home=(lat - 3e-4, lon, 400),
            camera="mavic 3 enterprise",
            gsd=1.5,
            angle=0,
            autopilot=autopilot,
        ).missions[0]


def degrees(mission: Mission, xyz: Any) -> tuple[float, float]:
    lon, lat = Plane(mission.home.lat, mission.home.lon).lonlat_from_xy(xyz[0], xyz[1])
    return float(lat), float(lon)


def flown(mission: Mission, photographs: int) -> list[tuple[str, dict[str, Any]]]:
    """Item, place and photograph of a flight up to its n-th photograph, and 9 m farther."""
    places, _, at = shots(mission)
    path, stops = path_of(mission), stops_of(mission)
    events: list[tuple[str, dict[str, Any]]] = []
    for (leg, _), xyz in zip(places[:photographs], at, strict=False):
        lat, lon = degrees(mission, xyz)
        events.append(("MISE", {"CNum": stops[leg] + first_number(mission)}))
        events += [(name, {"Lat": lat, "Lng": lon}) for name in ("POS", "CAM")]
    leg, share = places[photographs - 1]
    share = min(share + 9 / float(path.length_m[leg]), 1.0)
    lat, lon = degrees(mission, path.xyz_m[leg] + share * (path.xyz_m[leg + 1] - path.xyz_m[leg]))
    return [*events, ("POS", {"Lat": lat, "Lng": lon})]


def ardupilot(mission: Mission, photographs: int, cameras: bool = True) -> list[tuple[str, dict[str, Any]]]:
    """A flight by hand, in Auto up to a photograph, and back by hand; photographs by hand do not count."""
    home = {"Lat": mission.home.lat, "Lng": mission.home.lon}
    events = flown(mission, photographs)
    by_hand = [("CAM", home), ("POS", home), ("IMU", {"GyrX": 1.0})]
    found = [
        ("MSG", {"Message": "ArduCopter V4.5.1 (abc)"}),
        ("MODE", {"Mode": 5, "ModeNum": 5}),
        ("ARM", {"ArmState": 1}),
        *by_hand,
        ("MODE", {"Mode": AUTO, "ModeNum": AUTO}),
        ("CAM", {"Lat": 0.0, "Lng": 0.0}),  # without a fix
        *events,
        ("MODE", {"Mode": RTL, "ModeNum": RTL}),
        *by_hand,
    ]
    return [one for one in found if cameras or one[0] != "CAM"]


def px4(mission: Mission, photographs: int, source: str = "camera_capture", finished: bool = False) -> bytes:
    rows: list[tuple[str, tuple[Any, ...]]] = [("vehicle_status", (1, 2)), ("vehicle_status", (10, 3))]
    time = 20
    for name, fields in flown(mission, photographs):
        time += 10
        if name == "MISE":
            rows.append(("mission_result", (time, fields["CNum"], finished)))
        elif name == "POS":
            rows.append(("vehicle_global_position", (time, fields["Lat"], fields["Lng"])))
        elif source == "camera_capture":
            rows.append((source, (time, fields["Lat"], fields["Lng"], 0.0, 1.0, 0.0, 0.0, 0.0)))
        elif source == "camera_trigger":
            rows.append((source, (time + 1, 1)))
    home = mission.home.lat, mission.home.lon
    rows += [("vehicle_status", (time + 20, 5)), ("vehicle_global_position", (time + 30, *home))]
    return ulog(rows)


WRITERS: dict[str, tuple[str, Callable[[Mission, int], bytes]]] = {
    "a.bin": ("ardupilot", lambda mission, n: dataflash(ardupilot(mission, n))),
    "capture.ulg": ("px4", px4),
    "trigger.ulg": ("px4", lambda mission, n: px4(mission, n, "camera_trigger")),
}


@pytest.mark.slow
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("name", WRITERS)
def test_the_flight_goes_on_at_the_last_photograph_of_the_log(
    name: str, place: tuple[float, float], tmp_path: Path
) -> None:
    if name.endswith(".ulg"):
        pytest.importorskip("pyulog")
    autopilot, write = WRITERS[name]
    mission = planned(autopilot, place)
    _, _, at = shots(mission)
    for count in (2, len(at) // 2, len(at) - 1):
        (tmp_path / name).write_bytes(write(mission, count))
        rest = uavseg.resume(mission, start=tmp_path / name).missions[0]
        _, _, again = shots(rest)
        assert np.hypot(*(again[0] - at[count - 1])[:2]) < 1.0
        assert len(again) == len(at) - count + 1
    (tmp_path / name).write_bytes(write(mission, len(at)))
    with pytest.raises(MissionError, match="nothing is left"):
        uavseg.resume(mission, start=tmp_path / name)


@pytest.mark.slow
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_without_photographs_it_is_the_last_place_in_the_mission(autopilot: str, tmp_path: Path) -> None:
    pytest.importorskip("pyulog")
    mission, log = planned(autopilot), tmp_path / "log"
    ways = {
        "ardupilot": lambda: dataflash(ardupilot(mission, 20, cameras=False)),
        "px4": lambda: px4(mission, 20, ""),
    }
    log.write_bytes(ways[autopilot]())
    end = end_of_log(log)
    expected = flown(mission, 20)[-1][1]
    assert not end.is_photo
    assert distance_m(*end.place, expected["Lat"], expected["Lng"]) < 0.1
    path, (leg, share) = path_of(mission), shots(mission)[0][19]
    cut = min(share + 9 / float(path.length_m[leg]), 1.0)
    number = stops_of(mission)[leg] + first_number(mission) + min(round(cut, 4), 0.9999)
    assert uavseg.resume(mission, start=log).missions == uavseg.resume(mission, start=number).missions


@pytest.mark.slow
def test_each_arming_begins_another_flight(tmp_path: Path) -> None:
    mission, log = planned("ardupilot"), tmp_path / "a.bin"
    log.write_bytes(dataflash([*ardupilot(mission, 30), *ardupilot(mission, 8)]))
    alone = tmp_path / "b.bin"
    alone.write_bytes(dataflash(ardupilot(mission, 8)))
    assert end_of_log(log) == end_of_log(alone)


@pytest.mark.slow
def test_a_plane_flies_missions_in_another_mode(tmp_path: Path) -> None:
    mission, log = planned("ardupilot"), tmp_path / "a.bin"
    events = [
        (name, {"Mode": 10, "ModeNum": 10} if fields.get("ModeNum") == AUTO else fields)
        for name, fields in ardupilot(mission, 9)
    ]
    log.write_bytes(dataflash(events))
    with pytest.raises(MissionError, match="no flight in mission mode"):
        end_of_log(log)
    log.write_bytes(dataflash([("MSG", {"Message": "ArduPlane V4.5.1"}), *events[1:]]))
    assert end_of_log(log).is_photo


@pytest.mark.slow
def test_logs_of_other_missions_and_of_finished_ones_are_refused(tmp_path: Path) -> None:
    pytest.importorskip("pyulog")
    mission, log = planned("ardupilot"), tmp_path / "a.bin"
    log.write_bytes(dataflash(ardupilot(planned("ardupilot", (47.01, 8.0)), 9)))
    with pytest.raises(MissionError, match=r"m from the leg to item \d+ .* is the log of another mission"):
        uavseg.resume(mission, start=log)
    back = ("MISE", {"CNum": len(mission.items)})
    events = ardupilot(mission, 9)
    log.write_bytes(dataflash([*events[:-4], back, *events[-4:]]))
    with pytest.raises(MissionError, match="flown to its end: nothing is left"):
        uavseg.resume(mission, start=log)
    log.write_bytes(dataflash([*events[:-4], ("MISE", {"CNum": 900}), *events[-4:]]))
    with pytest.raises(MissionError, match="there is no item 900"):
        uavseg.resume(mission, start=log)
    log.write_bytes(dataflash([*events[:-4], ("MISE", {"CNum": 2}), *events[-4:]]))
    with pytest.raises(MissionError, match="begun again"):
        uavseg.resume(mission, start=log)
    log.write_bytes(px4(planned("px4"), 9, finished=True))
    with pytest.raises(MissionError, match="flown to its end: nothing is left"):
        uavseg.resume(planned("px4"), start=log)


@pytest.mark.slow
def test_a_log_without_items_finds_its_place_on_the_path(tmp_path: Path) -> None:
    mission, log = planned("ardupilot"), tmp_path / "a.bin"
    events = [one for one in ardupilot(mission, 20) if one[0] != "MISE"]
    log.write_bytes(dataflash(events))
    rest = uavseg.resume(mission, start=log).missions[0]
    assert len(shots(rest)[2]) == len(shots(mission)[2]) - 19


# Damaged logs

ARDUPILOT_LOG = dataflash(ardupilot(planned("ardupilot"), 12))
PX4_LOG = px4(planned("px4"), 12)


def read(content: bytes, path: Path, capfd: Any = None) -> LogEnd | None:
    path.write_bytes(content)
    try:
        return end_of_log(path)
    except MissionError as error:
        assert str(error).count("\n") == 0
        return None


@pytest.mark.parametrize("log", [ARDUPILOT_LOG, PX4_LOG], ids=["binary", "ulog"])
def test_damaged_logs_end_in_a_place_or_in_one_line(log: bytes, tmp_path: Path, capfd: Any) -> None:
    if log is PX4_LOG:
        pytest.importorskip("pyulog")
    random, found = Random(3), 0
    for _ in range(150):
        content = bytearray(log)
        for _ in range(random.randint(1, 20)):
            content[random.randrange(len(content))] = random.randrange(256)
        cut = random.choice([len(content), random.randrange(len(content))])
        found += read(bytes(content[:cut]), tmp_path / "log") is not None
    assert found  # some are read all the same
    assert capfd.readouterr() == ("", "")


def test_a_type_of_no_length_does_not_stop_the_reader(tmp_path: Path) -> None:
    """pymavlink's DFReader reads such a log for ever."""
    start = ARDUPILOT_LOG[: 89 * 3]
    nothing = b"\xa3\x95\x80" + bytes([200, 0]) + bytes(84)
    content = start + nothing + b"\xa3\x95\xc8" * 9 + ARDUPILOT_LOG[89 * 3 :]
    assert read(content, tmp_path / "a.bin") == read(ARDUPILOT_LOG, tmp_path / "b.bin") is not None


@pytest.mark.slow
@given(st.binary(max_size=300), st.integers(0, 40))
@settings(max_examples=60, deadline=None)
def test_other_bytes_between_messages_change_nothing(noise: bytes, where: int) -> None:
    import tempfile

    noise = noise.replace(b"\xa3", b"")
    head, ends = 89 * 8, []
    at = head
    while at < len(ARDUPILOT_LOG):
        ends.append(at)
        at = ARDUPILOT_LOG.find(b"\xa3\x95", at + 1)
        at = len(ARDUPILOT_LOG) if at < 0 else at
    cut = ends[where % len(ends)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.bin"
        changed = read(ARDUPILOT_LOG[:cut] + noise + ARDUPILOT_LOG[cut:], path)
        assert changed == read(ARDUPILOT_LOG, path)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.tlog", b"\xfe\x09", r"recordings of ground stations \(.tlog\) and logs .* are not read"),
        (
            "a.log",
            b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n",
            r"as text \(.log\) are not read",
        ),
        ("a.bin", b"", "is not a flight log; expected a .bin of ArduPilot or a .ulg of PX4"),
        ("a.bin", b"PK\3\4", "is not a flight log"),
        ("a.bin", ARDUPILOT_LOG[: 89 * 8], "shows no flight in mission mode"),
        ("a.ulg", b"ULog\x01\x12\x35", "cannot be read as a ULog|shows no flight"),
        ("a.ulg", PX4_LOG[:60], "cannot be read as a ULog|shows no flight"),
    ],
)
def test_what_is_no_log_is_refused(name: str, content: bytes, message: str, tmp_path: Path) -> None:
    if name.endswith(".ulg"):
        pytest.importorskip("pyulog")
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(MissionError, match=message):
        end_of_log(path)


def test_a_ulog_without_its_reader_names_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pyulog", None)
    (tmp_path / "a.ulg").write_bytes(PX4_LOG)
    with pytest.raises(uavseg.errors.MissingLibraryError, match=r'pip install "uavseg\[logs\]"'):
        end_of_log(tmp_path / "a.ulg")


def test_a_folder_and_a_pipe_are_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.bin")
    for name, message in (("pipe.bin", "named pipe"), (".", "folder"), ("no.bin", "there is no file")):
        with pytest.raises(MissionError, match=message):
            end_of_log(tmp_path / name)


def test_pymavlink_reads_the_same_messages(tmp_path: Path) -> None:
    from pymavlink import DFReader

    (tmp_path / "a.bin").write_bytes(ARDUPILOT_LOG)
    log, last = DFReader.DFReader_binary(str(tmp_path / "a.bin")), None
    while message := log.recv_match(type=["CAM", "MISE"]):
        if log.flightmode == "AUTO" and message.get_type() == "CAM" and message.Lat:
            last = message.Lat, message.Lng
    log.close()
    assert end_of_log(tmp_path / "a.bin").place == pytest.approx(last, abs=1e-9)
