"""Comparison of what a vehicle holds with what was sent to it."""

from collections.abc import Sequence

from uavseg.flight.items import POSITION_COMMANDS
from uavseg.flight.link.link_items import LOCATED, LinkItem
from uavseg.flight.link.results import Kind

UNITS = 1  # of 1e-7 degrees
ALTITUDE_M = 0.02  # ArduPilot keeps whole centimetres, rounded down
RALLY_ALTITUDE_M = 1.0  # and whole metres of rally points
RELATIVE = 1e-6  # of a 32-bit float
EXACT_PARAMS = 2  # param1 and param2 of items without position decide what they do


def differences(sent: Sequence[LinkItem], kept: Sequence[LinkItem], kind: Kind, autopilot: str) -> list[str]:
    """What the vehicle holds other than it was sent, so that it would not fly the mission; empty if nothing.

    Home (item 0 of ArduPilot) is not compared, because the vehicle replaces it. Parameters that autopilots
    round or do not store are compared by `rounded`; a generic vehicle keeps everything.
    """
    if len(sent) != len(kept):
        return [f"it holds {len(kept)} items instead of {len(sent)}"]
    found = []
    for number in range(_first(kind, autopilot), len(sent)):
        what = _difference(sent[number], kept[number], kind, autopilot)
        if what:
            found.append(f"item {number}: {what}")
    return found


def rounded(sent: Sequence[LinkItem], kept: Sequence[LinkItem], kind: Kind, autopilot: str) -> list[str]:
    """Parameters that the vehicle keeps otherwise, one line for each command and parameter."""
    if autopilot == "generic" or kind != Kind.MISSION:
        return []
    seen: dict[tuple[int, int], list[tuple[float, float]]] = {}
    for mine, theirs in zip(sent[_first(kind, autopilot) :], kept[_first(kind, autopilot) :], strict=True):
        for n, (value, known) in enumerate(zip(mine.params, theirs.params, strict=True), start=1):
            if value is not None and not _equal(value, known or 0.0):
                seen.setdefault((mine.command, n), []).append((value, known or 0.0))
    return [
        f"the vehicle keeps parameter {n} of command {command} as {pairs[0][1]:g} instead of {pairs[0][0]:g}"
        + (f", and otherwise in {len(pairs)} items" if len(pairs) > 1 else "")
        for (command, n), pairs in sorted(seen.items())
    ]


def _first(kind: Kind, autopilot: str) -> int:
    return int(kind == Kind.MISSION and autopilot == "ardupilot")


def _difference(sent: LinkItem, kept: LinkItem, kind: Kind, autopilot: str) -> str:
    if kept.command != sent.command:
        return f"command {kept.command} instead of {sent.command}"
    is_place = kind != Kind.MISSION or sent.command in POSITION_COMMANDS
    if (is_place or sent.x or sent.y) and max(abs(kept.x - sent.x), abs(kept.y - sent.y)) > UNITS:
        return f"position {_position(kept)} instead of {_position(sent)}"
    if kind != Kind.FENCE and is_place:
        tolerance_m = RALLY_ALTITUDE_M if kind == Kind.RALLY else ALTITUDE_M
        if abs(kept.z - sent.z) > tolerance_m:
            return f"altitude {kept.z:g} m instead of {sent.z:g} m"
        if kept.frame != sent.frame and kind == Kind.MISSION:
            return f"frame {kept.frame} instead of {sent.frame}"
    for n in range(_exact_params(sent, kind, autopilot)):
        value, known = sent.params[n] or 0.0, kept.params[n] or 0.0
        if not _equal(value, known):
            return f"parameter {n + 1} is {known:g} instead of {value:g}"
    return ""


def _exact_params(sent: LinkItem, kind: Kind, autopilot: str) -> int:
    """How many parameters must be kept exactly."""
    if autopilot == "generic":
        return 4
    if kind != Kind.MISSION:
        return int(kind == Kind.FENCE)  # the number of vertices, or the radius
    return 0 if sent.command in LOCATED else EXACT_PARAMS


def _position(item: LinkItem) -> str:
    return f"{item.x / 1e7:.7f},{item.y / 1e7:.7f}"


def _equal(one: float, other: float) -> bool:
    return abs(one - other) <= RELATIVE * max(abs(one), abs(other), 1.0)
