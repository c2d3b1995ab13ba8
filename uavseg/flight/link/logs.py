"""Flight logs of ArduPilot (dataflash, .bin) and PX4 (.ulg): photographs, and where a mission was cut."""

import contextlib
import io
import math
import mmap
import os
import struct
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from uavseg.dataclass import dataclass
from uavseg.errors import MissingLibraryError, MissionError, caused_errors
from uavseg.inputs import read_start, regular_file

Position = tuple[float, float]  # lat, lon in degrees, WGS 84
Message = tuple[str, dict[str, Any]]  # name and fields, as of ArduPilot

HEAD = b"\xa3\x95"  # of each message of a dataflash log
_FORMAT, _NO_FORMAT = 128, ("", struct.Struct(""), "", "")
_CODES = dict(zip("bBhHiIfdqQcCeELM", "bBhHiIfdqQhHiIiB", strict=True))  # of fields, as struct has them
_CODES |= {"n": "4s", "N": "16s", "Z": "64s", "a": "64s"}
_READ = frozenset({"FMT", "CAM", "POS", "GPS", "MODE", "MISE", "CMD", "ARM", "MSG"})
_AUTO, _AUTO_PLANE = 3, 10  # modes in which missions are flown: of copters and of PX4, of planes and rovers
_PLACE = {"Lat": "lat", "Lng": "lon"}
_SHOT = {**_PLACE, "Alt": "alt", **{f"q{k}": f"q[{k}]" for k in range(4)}}
_TOPICS = {  # of PX4 as messages of ArduPilot, in their order at one time
    "vehicle_status": ("MODE", {"ModeNum": "nav_state"}),
    "mission_result": ("MISE", {"CNum": "seq_current", "Finished": "finished"}),
    "vehicle_global_position": ("POS", _PLACE),
    "home_position": ("ORGN", {"Alt": "alt"}),
    "camera_capture": ("CAM", _SHOT),
    "camera_trigger": ("CAM", {}),
}


@dataclass(frozen=True, slots=True)
class LogEnd:
    """The end of the last flight of a mission in a log; items are numbered as the vehicle counts them."""

    place: Position  # of the last photograph, or without photographs the last one in mission mode
    is_photo: bool
    item: int | None  # that was flown to there; None where the log does not say it
    last_item: int | None  # that was flown to when the mission was left
    finished: bool = False


def end_of_log(path: str | os.PathLike[str]) -> LogEnd:
    """Read where the flight of a mission ended in a .bin of ArduPilot or a .ulg of PX4.

    Each arming begins a flight. A MissionError says that the file cannot be read, is not a log, or shows no
    flight in mission mode; a MissingLibraryError that pyulog is not installed.
    """
    auto, in_auto = _AUTO, False
    executed = "CMD"  # in logs without MISE; in others it is what was uploaded
    item = last_item = place = photo = None
    finished = was_finished = False
    for name, fields in _messages(path):
        with contextlib.suppress(KeyError, TypeError, ValueError, OverflowError):  # a damaged message
            if name == "MSG" and fields["Message"].startswith(("ArduPlane", "ArduRover", "Rover")):
                auto = _AUTO_PLANE
            elif name == "MODE":
                in_auto = int(fields["ModeNum" if "ModeNum" in fields else "Mode"]) == auto
            elif name == "ARM" and int(fields["ArmState"]) == 1:
                item = last_item = place = photo = None
            elif name == "MISE" or (in_auto and name == executed):
                item, executed, finished = int(fields["CNum"]), name, bool(fields.get("Finished"))
            elif in_auto and name in ("CAM", "POS", "GPS"):
                at = (float(fields["Lat"]), float(fields["Lng"])) if "Lat" in fields else place
                if at and at != (0.0, 0.0) and abs(at[0]) <= 90 and abs(at[1]) <= 180:  # with a fix
                    place, photo = at, (at, item) if name == "CAM" else photo
            if in_auto:
                last_item, was_finished = item, finished
    if place is None:
        raise MissionError(
            f"{os.fspath(path)} shows no flight in mission mode (Auto): name the place or item of the cut"
        )
    at, item = photo or (place, last_item)
    return LogEnd(place=at, is_photo=photo is not None, item=item, last_item=last_item, finished=was_finished)


@dataclass(frozen=True, slots=True)
class Shot:
    """A photograph in a log: where the vehicle was, and how it was turned."""

    lat: float
    lon: float
    relative_m: float | None  # above home
    altitude_m: float  # above the sea
    yaw_deg: float
    taken_s: float  # of the clock of the vehicle


def shots_of_log(path: str | os.PathLike[str]) -> list[Shot]:
    """Read the photographs of a log, in the order of their times; errors as of `end_of_log`.

    A MissionError also says that the log has none with place, height and direction.
    """
    shots: list[Shot] = []
    home_m = math.nan
    for name, fields in _messages(path):
        with contextlib.suppress(KeyError, TypeError, ValueError, OverflowError):  # a damaged message
            if name == "ORGN":
                home_m = float(fields["Alt"])
            elif name == "CAM":
                altitude_m = float(fields["Alt"])
                relative_m = float(fields.get("RelAlt", altitude_m - home_m))
                yaw = float(fields["Y"]) if "Y" in fields else _yaw_deg([fields[f"q{k}"] for k in range(4)])
                numbers = (
                    float(fields["Lat"]),
                    float(fields["Lng"]),
                    altitude_m,
                    yaw,
                    fields["TimeUS"] / 1e6,
                )
                if all(map(math.isfinite, numbers)) and any(numbers[:2]):
                    lat, lon, altitude_m, yaw, seconds = numbers
                    known = relative_m if math.isfinite(relative_m) else None
                    shots.append(Shot(lat, lon, known, altitude_m, yaw % 360, seconds))
    if not shots:
        raise MissionError(
            f"{path} has no photographs with place, height and direction (CAM, camera_capture)"
        )
    return shots


def _yaw_deg(q: Sequence[float]) -> float:
    """Return the azimuth of the front of a vehicle, from its attitude as a quaternion (w, x, y, z)."""
    w, x, y, z = map(float, q)
    return math.degrees(math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))


def _messages(path: str | os.PathLike[str]) -> Iterable[Message]:
    file = regular_file(path, MissionError)
    start = read_start(file, 4, MissionError)
    if not start.startswith((b"ULog", HEAD)):
        raise MissionError(
            f"{file} is not a flight log; expected a .bin of ArduPilot or a .ulg of PX4; "
            "recordings of ground stations (.tlog) and logs as text (.log) are not read"
        )
    return _ulog_messages(file) if start == b"ULog" else _dataflash_messages(file)


def _dataflash_messages(path: Path) -> Iterator[Message]:
    """Yield the messages that are read; damaged bytes are skipped up to the next head."""
    known = {_FORMAT: ("FMT", struct.Struct("<BB4s16s64s"), "BBnNZ", "Type,Length,Name,Format,Columns")}
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        at = 0
        while 0 <= at < len(data) - len(HEAD):
            name, layout, codes, columns = known.get(data[at + 2], _NO_FORMAT)
            end = at + 3 + layout.size
            if data[at : at + 2] != HEAD or not layout.size or end > len(data):
                at = data.find(HEAD, at + 1)
                continue
            if name:
                values = map(_value, codes, layout.unpack_from(data, at + 3))
                fields: dict[str, Any] = dict(zip(columns.split(","), values, strict=False))
                if name != "FMT":
                    yield name, fields
                elif (number := fields["Type"]) != _FORMAT:
                    name, codes, size = fields["Name"], fields["Format"], max(fields["Length"] - 3, 0)
                    layout = struct.Struct("<" + "".join(_CODES.get(code, "") for code in codes))
                    known[number] = "", struct.Struct(f"{size}x"), "", ""
                    if name in _READ and layout.size == size:
                        known[number] = name, layout, codes, fields["Columns"]
            at = end


def _value(code: str, value: Any) -> Any:
    if code in "nNZ":
        return value.partition(b"\0")[0].decode("ascii", "replace")
    return value / (1e7 if code == "L" else 100) if code in "LcCeE" else value


def _ulog_messages(path: Path) -> list[Message]:
    missing = 'a .ulg of PX4 needs pyulog: pip install "uavseg[logs]"'
    with caused_errors(missing, MissingLibraryError, ImportError, form="{}"):
        from pyulog import ULog
    # Whatever pyulog raises of a damaged file is caught.
    with caused_errors(f"{path} cannot be read as a ULog", MissionError, Exception):
        with contextlib.redirect_stdout(io.StringIO()):  # pyulog prints what is damaged
            topics = {one.name: one.data for one in ULog(os.fspath(path), list(_TOPICS)).data_list[::-1]}
        if "camera_capture" in topics:  # photographs that were taken, in place of triggers
            topics.pop("camera_trigger", None)
        rows = [
            (
                int(time),
                name,
                {field: topics[topic][at][k] for field, at in columns.items() if at in topics[topic]}
                | {"TimeUS": int(time)},
            )
            for topic, (name, columns) in _TOPICS.items()
            if topic in topics
            for k, time in enumerate(topics[topic]["timestamp"])
        ]
    return [(name, fields) for _, name, fields in sorted(rows, key=lambda row: row[0])]
