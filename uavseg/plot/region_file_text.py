"""Text report of a file of regions, one fact per line."""

import json
from typing import Any

from uavseg.regions.formats.about_file import RegionFile

_COVERED = ("range_values", "unit", "stretch_low", "stretch_high")  # part of another line


def region_file_text(found: RegionFile) -> str:
    """What a file of regions holds, and how they were made."""
    layer = "" if found.layer is None else f", layer {found.layer}"
    others = f" and {found.others} more" if found.others else ""
    rows = [
        ("file", found.path),
        ("format", f"{found.format}{layer}{others}"),
        ("regions", f"{found.regions:,} ({found.geometry})"),
        ("CRS", found.crs or "none: coordinates are local"),
        ("extent", _extent(found)),
        ("columns", ", ".join(found.columns)),
    ]
    lines = [f"{name:<16} {text}" for name, text in rows if text]
    if not found.metadata:
        return "\n".join([*lines, "", "The file does not say how its regions were made."])
    made = [f"{name:<16} {_text(name, found.metadata)}" for name in found.metadata if name not in _COVERED]
    return "\n".join([*lines, "", *made])


def _extent(found: RegionFile) -> str:
    if found.bounds is None:
        return ""
    left, bottom, right, top = (f"{value:.10g}" for value in found.bounds)
    return f"x {left} to {right}, y {bottom} to {top}"


def _text(name: str, about: dict[str, Any]) -> str:
    value = about[name]
    if name == "range":
        values = about.get("range_values") or [None, None]
        unit = f" {about['unit']}" if isinstance(about.get("unit"), str) else ""
        known = "" if values == [None, None] else f"; values {_ends(values)}{unit}"
        return f"v {_ends(value)}{known}"
    if isinstance(value, list) and all(isinstance(part, str | int | float) for part in value):
        return ", ".join(map(_plain, value))
    return _plain(value)


def _ends(pair: Any) -> str:
    """An interval in words; open where an end is missing."""
    if not isinstance(pair, list) or len(pair) != 2:
        return _plain(pair)
    low, high = pair
    if low is None or high is None:
        return f"up to {_plain(high)}" if low is None else f"{_plain(low)} and more"
    return f"{_plain(low)} to {_plain(high)}"


def _plain(value: Any) -> str:
    if isinstance(value, str):
        return value
    return f"{value:.10g}" if isinstance(value, float) else json.dumps(value)
