"""Flight logs: where a mission was cut, from dataflash logs of ArduPilot and ULogs of PX4."""

import contextlib
import io
import mmap
import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from uavseg.dataclass import dataclass
from uavseg.errors import MissingLibraryError, MissionError
from uavseg.inputs import read_start, regular_file
from uavseg.plain_text import cause_of

Position = tuple[float, float]  # lat, lon in degrees, WGS 84
Fields = dict[str, Any]

HEAD = b"\xa3\x95"  # of each message of a binary dataflash log
_FORMAT, _FORMAT_LENGTH = 128, 89
_CODES = dict(zip("bBhHiIfdqQcCeELM", "bBhHiIfdqQhHiIiB", strict=True)) | {"n": "4s", "N": "16s"}
_CODES |= {"Z": "64s", "a": "64s"}  # of fields, as struct has them
_READ = frozenset({"CAM", "POS", "GPS", "MODE", "MISE", "CMD", "ARM", "MSG"})
_AUTO_COPTER, _AUTO_PLANE = 3, 10  # numbers of the mode in which a mission is flown
_MISSION_MODE = 3  # of PX4, NAVIGATION_STATE_AUTO_MISSION
_TOPICS = ["vehicle_status", "vehicle_global_position", "mission_result", "camera_capture", "camera_trigger"]


@dataclass(frozen=True, slots=True)
class LogEnd:
    """The end of the last flight of a mission in a log; items are numbered as the vehicle counts them."""

    place: Position  # of the last photograph, or without photographs the last one in mission mode
    is_photo: bool
    item: int | None  # that was flown to there; None where the log does not say it
    last_item: int | None  # that was flown to when the mission was left
    finished: bool = False


def end_of_log(path: str | os.PathLike[str]) -> LogEnd:
    """Read where the flight of a mission ended in a .bin or .log of ArduPilot or a .ulg of PX4.

    A MissionError says that the file cannot be read, is not a log, or shows no flight in mission mode; a
    MissingLibraryError that pyulog is not installed.
    """
    name = os.fspath(path)
    if name.lower().endswith(".tlog"):
        raise MissionError(
            f"{name}: recordings of ground stations (.tlog) are not read; give the log that the vehicle "
            "wrote, a .bin or .log of ArduPilot or a .ulg of PX4"
        )
    file = regular_file(path, MissionError)
    start = read_start(file, 4096, MissionError)
    if start.startswith(b"ULog"):
        return _ulog_end(file)
    if start.startswith(HEAD):
        return _dataflash_end(_binary_messages(file), name)
    if b"FMT," in start:
        return _dataflash_end(_text_messages(file), name)
    raise MissionError(f"{name} is not a flight log; expected a .bin or .log of ArduPilot or a .ulg of PX4")


def _binary_messages(path: Path) -> Iterator[tuple[str, Fields]]:
    """Yield the messages that are read; damaged bytes are skipped up to the next head."""
    lengths = {_FORMAT: _FORMAT_LENGTH}
    known: dict[int, tuple[str, struct.Struct, str, list[str]]] = {}
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        at, end = 0, len(data)
        while 0 <= at < end - len(HEAD):
            kind = data[at + 2]
            length = lengths.get(kind, 0)
            if data[at : at + 2] != HEAD or length <= len(HEAD) or at + length > end:
                at = data.find(HEAD, at + 1)
                continue
            if kind == _FORMAT:
                new, size, *texts = struct.unpack("<BB4s16s64s", data[at + 3 : at + length])
                name, codes, columns = (_text(text) for text in texts)
                lengths[new] = size
                layout = struct.Struct("<" + "".join(_CODES.get(code, "") for code in codes))
                known.pop(new, None)
                if name in _READ and layout.size == size - 3:
                    known[new] = name, layout, codes, columns.split(",")
            elif kind in known:
                name, layout, codes, columns_ = known[kind]
                values = layout.unpack(data[at + 3 : at + length])
                yield (
                    name,
                    {
                        column: value / 1e7 if code == "L" else _text(value) if code in "nNZ" else value
                        for column, code, value in zip(columns_, codes, values, strict=False)
                    },
                )
            at += length


def _text(value: bytes) -> str:
    return value.partition(b"\0")[0].decode("ascii", "replace")


def _text_messages(path: Path) -> Iterator[tuple[str, Fields]]:
    columns: dict[str, list[str]] = {}
    with path.open(encoding="ascii", errors="replace") as file:
        while line := file.readline(_LONGEST_LINE):
            name, *values = (part.strip() for part in line.split(","))
            if name == "FMT" and len(values) > 4:
                columns[values[2]] = values[4:]
            elif name in _READ and name in columns:
                yield name, dict(zip(columns[name], map(_number, values), strict=False))


_LONGEST_LINE = 4096  # of a text log


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def _dataflash_end(messages: Iterator[tuple[str, Fields]], name: str) -> LogEnd:
    """Follow mode, item, photographs and places; each arming begins a flight."""
    auto, in_auto = _AUTO_COPTER, False
    executed = "CMD"  # in logs without MISE; in others it is what was uploaded
    item: int | None = None
    place: Position | None = None
    photo: tuple[Position, int | None] | None = None
    for kind, fields in messages:
        try:
            if kind == "MSG" and str(fields.get("Message")).startswith(("ArduPlane", "ArduRover", "Rover")):
                auto = _AUTO_PLANE
            elif kind == "MODE":
                in_auto = int(fields["ModeNum" if "ModeNum" in fields else "Mode"]) == auto
            elif kind == "ARM" and int(fields["ArmState"]) == 1:
                item, place, photo = None, None, None
            elif in_auto and kind in ("MISE", executed):
                item, executed = int(fields["CNum"]), kind
            elif in_auto and kind in ("CAM", "POS", "GPS"):
                at = float(fields["Lat"]), float(fields["Lng"])
                if at == (0.0, 0.0) or not (abs(at[0]) <= 90 and abs(at[1]) <= 180):
                    continue  # without a fix
                if kind == "CAM":
                    photo = at, item
                place = at
        except (KeyError, TypeError, ValueError, OverflowError):
            continue  # a damaged message
    if place is None:
        raise MissionError(
            f"{name} shows no flight in mission mode (Auto): name the place or item of the cut"
        )
    at, item_there = photo or (place, item)
    return LogEnd(place=at, is_photo=photo is not None, item=item_there, last_item=item)


def _ulog_end(path: Path) -> LogEnd:
    try:
        from pyulog import ULog
    except ImportError as error:
        raise MissingLibraryError(
            'to read a .ulg of PX4, pyulog is needed: pip install "uavseg[logs]"'
        ) from error
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # pyulog prints what is damaged
            topics = {one.name: one.data for one in ULog(os.fspath(path), _TOPICS).data_list[::-1]}
        status = topics["vehicle_status"]
        in_mission = status["nav_state"] == _MISSION_MODE

        def flown(topic: str) -> Any:
            """Return the numbers of messages of a topic in mission mode."""
            k = np.searchsorted(status["timestamp"], topics[topic]["timestamp"], side="right") - 1
            return np.flatnonzero((k >= 0) & in_mission[np.maximum(k, 0)])

        positions = topics["vehicle_global_position"]
        photos = next((name for name in _TOPICS[3:] if name in topics and len(flown(name))), None)
        source = photos or "vehicle_global_position"
        last, places = flown(source)[-1], topics[source]
        time = places["timestamp"][last]
        if source == "camera_trigger":
            places, last = positions, max(int(np.searchsorted(positions["timestamp"], time)) - 1, 0)
        place = float(places["lat"][last]), float(places["lon"][last])
        results = topics.get("mission_result", {"timestamp": np.empty(0)})
        before = int(np.searchsorted(results["timestamp"], time, side="right")) - 1
        during = flown("mission_result")[-1:] if before >= 0 else []
        return LogEnd(
            place=place,
            is_photo=photos is not None,
            item=int(results["seq_current"][before]) if before >= 0 else None,
            last_item=int(results["seq_current"][during[0]]) if len(during) else None,
            finished=bool(len(during) and results["finished"][during[0]]),
        )
    except (KeyError, IndexError) as error:
        raise MissionError(
            f"{path} shows no flight in mission mode: name the place or item of the cut"
        ) from error
    except Exception as error:  # whatever pyulog raises of a damaged file
        raise MissionError(f"{path} cannot be read as a ULog ({cause_of(error)})") from error
