"""Minimal writers of flight logs: dataflash of ArduPilot and ULog of PX4."""

import struct
from collections.abc import Sequence
from typing import Any

FIELDS = {  # name: number, format, columns
    "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns"),
    "MSG": (129, "QZ", "TimeUS,Message"),
    "MODE": (130, "QMBB", "TimeUS,Mode,ModeNum,Rsn"),
    "MISE": (131, "QHHHffffLLfB", "TimeUS,CTot,CNum,CId,Prm1,Prm2,Prm3,Prm4,Lat,Lng,Alt,Frame"),
    "CAM": (132, "QIHLLeeC", "TimeUS,GPSTime,GPSWeek,Lat,Lng,Alt,RelAlt,Y"),
    "POS": (133, "QLLf", "TimeUS,Lat,Lng,Alt"),
    "ARM": (134, "QBI", "TimeUS,ArmState,ArmChecks"),
    "IMU": (135, "Qf", "TimeUS,GyrX"),
}
CODES = {"n": "4s", "N": "16s", "Z": "64s", "L": "i", "M": "B", "e": "i", "C": "H"}
SCALES = {"L": 1e7, "e": 100, "C": 100}
Message = tuple[str, dict[str, Any]]


def _layout(name: str) -> struct.Struct:
    return struct.Struct("<" + "".join(CODES.get(code, code) for code in FIELDS[name][1]))


def binary(name: str, *values: Any) -> bytes:
    """A message of a binary dataflash log."""
    number, codes, _ = FIELDS[name]
    stored = [
        value.encode() if code in "nNZ" else round(value * SCALES[code]) if code in SCALES else value
        for code, value in zip(codes, values, strict=True)
    ]
    return b"\xa3\x95" + bytes([number]) + _layout(name).pack(*stored)


def _rows(messages: Sequence[Message]) -> list[tuple[str, list[Any]]]:
    rows = []
    for time, (name, fields) in enumerate(messages, start=1):
        _, codes, columns = FIELDS[name]
        default = {code: "" if code in "nNZ" else 0 for code in codes}
        named = zip(columns.split(","), codes, strict=True)
        rows.append((name, [fields.get(one, default[code]) for one, code in named]))
        rows[-1][1][0] = time * 100_000
    return rows


def dataflash(messages: Sequence[Message]) -> bytes:
    """A binary dataflash log (.bin), with a format message for each type."""
    formats = [
        binary("FMT", number, 3 + _layout(name).size, name, codes, columns)
        for name, (number, codes, columns) in FIELDS.items()
    ]
    return b"".join(formats) + b"".join(binary(name, *values) for name, values in _rows(messages))


TOPICS = {
    "vehicle_status": [("uint64_t", "timestamp", "Q"), ("uint8_t", "nav_state", "B")],
    "vehicle_global_position": [
        ("uint64_t", "timestamp", "Q"),
        ("double", "lat", "d"),
        ("double", "lon", "d"),
    ],
    "mission_result": [
        ("uint64_t", "timestamp", "Q"),
        ("uint16_t", "seq_current", "H"),
        ("bool", "finished", "?"),
    ],
    "camera_capture": [
        ("uint64_t", "timestamp", "Q"),
        *(("double", name, "d") for name in ("lat", "lon")),
        ("float", "alt", "f"),
        ("float[4]", "q", "4f"),
    ],
    "home_position": [("uint64_t", "timestamp", "Q"), ("float", "alt", "f")],
    "camera_trigger": [("uint64_t", "timestamp", "Q"), ("uint32_t", "seq", "I")],
}


def ulog(messages: Sequence[tuple[str, tuple[Any, ...]]]) -> bytes:
    """A ULog: topics and their values, with the time in microseconds first."""

    def message(kind: str, body: bytes) -> bytes:
        return struct.pack("<HB", len(body), ord(kind)) + body

    used = [name for name in TOPICS if any(name == one for one, _ in messages)]
    content = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    for name in used:
        fields = ";".join(f"{kind} {field}" for kind, field, _ in TOPICS[name])
        content += message("F", f"{name}:{fields};".encode())
    for number, name in enumerate(used):
        content += message("A", struct.pack("<BH", 0, number) + name.encode())
    for name, values in messages:
        layout = "<" + "".join(code for *_, code in TOPICS[name])
        content += message("D", struct.pack("<H", used.index(name)) + struct.pack(layout, *values))
    return content
