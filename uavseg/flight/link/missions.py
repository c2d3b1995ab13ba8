"""Upload of fence, rally points and mission to a vehicle, each read back and compared; download."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from uavseg.errors import LinkError, MissionError, UnverifiedError, named_errors
from uavseg.execution.executors import Progress
from uavseg.flight.link import messages
from uavseg.flight.link.link import POLL_S, Link, LinkedVehicle
from uavseg.flight.link.messages import LinkItem, MissionType, RefusedError, TransferLostError
from uavseg.flight.link.transfer import Count, count_items, receive_items, send_items
from uavseg.flight.mission import items as mav
from uavseg.flight.mission.items import AUTOPILOT_NAMES, HomePosition, MissionItem
from uavseg.flight.mission.mission import Mission

UNITS = 1  # of 1e-7 degrees
ALTITUDE_M = 0.02  # ArduPilot keeps whole centimetres, rounded down
RALLY_ALTITUDE_M = 1.0  # and whole metres of rally points
RELATIVE = 1e-6  # of a 32-bit float
EXACT_PARAMS = 2  # param1 and param2 of items without position decide what they do
MAX_BYTE = 255  # ArduPilot keeps radii and turns in 8 bits, and radii above that in tens of metres
# Parameters of items with a position (command, number) that are not left out; ArduPlane leaves out holds.
ARDUPILOT_KEEPS = frozenset(
    {(mav.LOITER, 3), (mav.LOITER_TURNS, 1), (mav.LOITER_TURNS, 3)}
    | {(mav.LOITER_TIME, 1), (mav.LOITER_TO_ALTITUDE, 2)}
)
PX4_KEEPS = frozenset(
    {(mav.WAYPOINT, 1), (mav.WAYPOINT, 2), (mav.LOITER, 3)}
    | {(mav.LOITER_TIME, 1), (mav.LOITER_TIME, 3), (mav.LOITER_TO_ALTITUDE, 2)}
    | {(command, 4) for command in (*mav.HEADING_COMMANDS, *mav.LANDINGS)}
)
ARDUPILOT_FLAGS = frozenset(
    (command, 4) for command in (mav.LOITER_TURNS, mav.LOITER_TIME, mav.LOITER_TO_ALTITUDE)
)
PX4_FLAGS = frozenset(
    {(mav.LOITER_TIME, 2), (mav.LOITER_TIME, 4), (mav.LOITER_TO_ALTITUDE, 1), (mav.LOITER_TO_ALTITUDE, 4)}
)
HOME_S = 2.5  # PX4 sends HOME_POSITION every 2 s
ATTEMPTS = 3


def differences(
    sent: Sequence[LinkItem], kept: Sequence[LinkItem], list_type: MissionType, autopilot: str
) -> list[str]:
    """Return how the list that a vehicle holds differs from the one that was sent; empty if it would fly it.

    Home (item 0 of ArduPilot) is not compared, because the vehicle replaces it. A parameter may come back as
    what the autopilot is known to make of it, which `rounded` reports; a generic vehicle keeps everything.
    NaN where a number was sent, and infinity, are differences everywhere. `autopilot` is "ardupilot", "px4"
    or "generic".
    """
    if len(sent) != len(kept):
        return [f"it holds {len(kept)} items instead of {len(sent)}"]
    texts = [_difference(*pair, list_type, autopilot) for pair in zip(sent, kept, strict=True)]
    first = _first(list_type, autopilot)
    return [f"item {number}: {text}" for number, text in enumerate(texts) if text and number >= first]


def rounded(
    sent: Sequence[LinkItem], kept: Sequence[LinkItem], list_type: MissionType, autopilot: str
) -> list[str]:
    """Return the parameters that a vehicle keeps otherwise, and whether it does not wait, one sentence each.

    There are no `differences`; `autopilot` as there.
    """
    if list_type != MissionType.MISSION:
        return []
    seen: dict[tuple[int, int], list[tuple[float | None, float | None]]] = {}
    start = _first(list_type, autopilot)
    for item, back in zip(sent[start:], kept[start:], strict=True):
        for n, (value, got) in enumerate(zip(item.params, back.params, strict=True), start=1):
            # ArduPilot and PX4 keep 0 for NaN; how others fly it is not known
            if (value is not None or autopilot == "generic") and not _equal(value, got):
                seen.setdefault((item.command, n), []).append((value, got))
    first = next((n for n in range(len(sent)) if kept[n].autocontinue > sent[n].autocontinue), None)
    continues = f"the vehicle keeps autocontinue of item {first} as 1 instead of 0: it does not wait there"
    return [continues] * (first is not None) + [
        f"the vehicle keeps parameter {n} of command {command} as {_text(pairs[0][1])} instead of "
        f"{_text(pairs[0][0])}" + (f", and otherwise in {len(pairs)} items" if len(pairs) > 1 else "")
        for (command, n), pairs in sorted(seen.items())
    ]


def _first(list_type: MissionType, autopilot: str) -> int:
    return int(list_type == MissionType.MISSION and autopilot == "ardupilot")


def _difference(sent: LinkItem, kept: LinkItem, list_type: MissionType, autopilot: str) -> str:
    if kept.command != sent.command:
        return f"command {kept.command} instead of {sent.command}"
    in_mission = list_type == MissionType.MISSION
    is_set = autopilot == "ardupilot" and kept.autocontinue == 1  # which it does whatever it was sent
    if in_mission and kept.autocontinue != sent.autocontinue and not is_set:
        return f"autocontinue is {kept.autocontinue} instead of {sent.autocontinue}"
    has_place = not in_mission or sent.command in mav.POSITION_COMMANDS or bool(sent.x or sent.y)
    if has_place and max(abs(kept.x - sent.x), abs(kept.y - sent.y)) > UNITS:
        return f"position {_position(kept)} instead of {_position(sent)}"
    is_located = has_place and (list_type == MissionType.RALLY or sent.command in messages.LOCATED)
    tolerance_m = RALLY_ALTITUDE_M if list_type == MissionType.RALLY else ALTITUDE_M
    tolerance_m = tolerance_m if is_located else math.inf
    if not (math.isfinite(kept.z) and abs(kept.z - sent.z) <= tolerance_m):
        return f"altitude {kept.z:g} m instead of {sent.z:g} m"
    if is_located and in_mission and mav.FRAME_MISSION != sent.frame != kept.frame:
        return f"frame {kept.frame} instead of {sent.frame}"
    for n, (value, got) in enumerate(zip(sent.params, kept.params, strict=True), start=1):
        if not _is_kept(value, got, n, sent.command, list_type, autopilot):
            return f"parameter {n} is {_text(got)} instead of {_text(value)}"
    return ""


def _is_kept(
    value: float | None, got: float | None, n: int, command: int, list_type: MissionType, autopilot: str
) -> bool:
    """Return whether a parameter came back as it was sent, or as the autopilot is known to round it."""
    if _equal(value, got):
        return True
    if got is None or not math.isfinite(got):
        return False
    if autopilot == "generic":
        return value is None and got == 0
    if list_type != MissionType.MISSION:
        return not (list_type == MissionType.FENCE and n == 1)  # the number of vertices, or the radius
    if command not in messages.LOCATED:
        return got == 0 and (value is None or n > EXACT_PARAMS)
    rounded_by = _rounded_by_ardupilot if autopilot == "ardupilot" else _rounded_by_px4
    return any(_equal(one, got) for one in rounded_by(value, command, n))


def _rounded_by_ardupilot(value: float | None, command: int, n: int) -> Iterator[float]:
    """Yield what ArduPilot may keep of a parameter of an item with a position (AP_Mission.cpp)."""
    if value is None or (command, n) not in ARDUPILOT_KEEPS:
        yield 0.0
    number = value or 0.0
    sign = math.copysign(1.0, number)
    yield float(math.trunc(number))
    if (command, n) == (mav.LOITER_TURNS, 1) and abs(number) < 1:
        yield math.floor(256 * number) / 256
    if abs(number) > MAX_BYTE and (n > 1 or command == mav.LOITER_TURNS):
        yield from (sign * 10 * min(math.trunc(abs(number) / 10), MAX_BYTE), sign * MAX_BYTE)
    if (command, n) in {(mav.LAND, 4), (mav.LOITER_TIME, 3)}:  # the direction of the turn
        yield sign
    if (command, n) in ARDUPILOT_FLAGS:
        yield float(number > 0)


def _rounded_by_px4(value: float | None, command: int, n: int) -> Iterator[float]:
    """Yield what PX4 may keep of a parameter of an item with a position (mavlink_mission.cpp)."""
    if (command, n) not in PX4_KEEPS:
        yield 0.0
    elif value is not None and n == 4:
        yield value % 360
    if value is not None and (command, n) in PX4_FLAGS:
        yield float(value > 0)
    if value is not None and (command, n) == (mav.LAND, 2):
        yield float(math.trunc(value))


def _position(item: LinkItem) -> str:
    return f"{item.x / 1e7:.7f},{item.y / 1e7:.7f}"


def _text(value: float | None) -> str:
    return "nan" if value is None else f"{value:g}"


def _equal(one: float | None, other: float | None) -> bool:
    """Return whether two numbers are equal as 32-bit floats; None is NaN, which equals itself alone."""
    if one is None or other is None:
        return one is other
    if not (math.isfinite(one) and math.isfinite(other)):
        return one == other
    return abs(one - other) <= RELATIVE * max(abs(one), abs(other), 1.0)


def upload_mission(
    link: Link, mission: Mission, progress: Progress | None = None, while_armed: bool = False
) -> tuple[str, ...]:
    """Upload a mission with its fence and rally points, read them back and compare.

    The fence goes first, so that the vehicle never holds the mission without it. A fence and rally points
    that the mission does not have are left as they are. `progress` is called with the number of items that
    were sent or read back, and of all. With `while_armed` the lists of a vehicle whose motors are armed may
    be replaced.

    The results are warnings for the pilot. A MissionError says that the mission is for another autopilot, an
    UnverifiedError that the vehicle accepted a list that could not be read back, a LinkError that it is
    armed, refuses a list, falls silent, or holds another one afterwards.
    """
    ours, theirs = mission.autopilot, link.vehicle.autopilot
    if theirs != "generic" and ours in AUTOPILOT_NAMES and ours != theirs:
        raise MissionError(
            f"the mission is for {AUTOPILOT_NAMES[ours]}, and the vehicle is {link.vehicle}; plan it for "
            f"{AUTOPILOT_NAMES[theirs]} (a .waypoints file is always for ArduPilot)"
        )
    warnings = []
    lists = {
        MissionType.FENCE: messages.items_of_fence(mission.fence),
        MissionType.RALLY: messages.items_of_rally(mission.rally),
        MissionType.MISSION: messages.items_of_mission(mission, link.vehicle.has_home_row),
    }
    lists = {list_type: items for list_type, items in lists.items() if items}
    # an item counts when it is sent and when it is read back
    done, total = 0, 2 * sum(map(len, lists.values()))
    report = progress or (lambda done, total: None)
    for number, (list_type, items) in enumerate(lists.items()):
        if not while_armed:
            _check_disarmed(link.vehicle, list(lists)[:number])

        def count(number: int, done: int = done) -> None:
            report(done + number, total)

        warnings += _transfer(link, list_type, items, count)
        done += 2 * len(items)
    if link.vehicle.is_armed:
        warnings.append("the vehicle is armed: its mission was replaced while it may be flying")
    for list_type in (MissionType.FENCE, MissionType.RALLY):
        left = None if list_type in lists else count_items(link, list_type)
        if left:
            warnings.append(f"the vehicle keeps its {list_type} ({left} items): the mission has none")
    return tuple(warnings)


def _check_disarmed(vehicle: LinkedVehicle, sent: Sequence[MissionType]) -> None:
    """Raise LinkError if a vehicle is armed, in any mode: it may be switched to its mission at any time."""
    if not vehicle.is_armed:
        return
    state = "is armed and may be flying: nothing was sent to it"
    if sent:
        lists = " and ".join(map(str, sent))
        state = f"was armed after its {lists} had been sent, and may be flying: nothing more was sent"
    raise LinkError(
        f"the vehicle {state}; disarm it, or give --while-armed if its mission may change while it flies"
    )


def _transfer(link: Link, list_type: MissionType, items: Sequence[LinkItem], count: Count) -> list[str]:
    """Send one list and compare what the vehicle then holds; the list is sent again if the transfer stops."""
    for attempt in range(1, ATTEMPTS + 1):
        try:
            is_acknowledged = send_items(link, list_type, items, count)
        except TransferLostError:
            if attempt == ATTEMPTS:
                raise
            continue
        except BaseException:
            link.cancel(list_type)
            raise
        kept = _read_back(link, list_type, items, count, is_acknowledged)
        wrong = differences(items, kept, list_type, link.vehicle.autopilot)
        if not wrong:
            return rounded(items, kept, list_type, link.vehicle.autopilot)
        if is_acknowledged or attempt == ATTEMPTS:
            more = f" (and {len(wrong) - 1} more)" if len(wrong) > 1 else ""
            raise LinkError(
                f"the vehicle does not hold the {list_type} that was sent: {wrong[0]}{more}; upload again"
            )
    raise AssertionError("the last attempt returns or raises")


def _read_back(
    link: Link, list_type: MissionType, items: Sequence[LinkItem], count: Count, is_acknowledged: bool
) -> list[LinkItem]:
    try:
        return receive_items(link, list_type, lambda done, total: count(len(items) + min(done, len(items))))
    except TransferLostError as error:
        if is_acknowledged:
            raise UnverifiedError(
                f"the vehicle accepted the {list_type}, but it could not be read back and compared: {error}"
            ) from error
        raise LinkError(
            f"all items of the {list_type} were sent, but they were neither acknowledged nor read back "
            f"({error}); what the vehicle holds is not known: upload again"
        ) from error


def download_mission(link: Link, progress: Progress | None = None) -> Mission:
    """Read the mission of a vehicle, with its fence and rally points.

    ArduPilot sends home as item 0, PX4 in a message; where neither is there, home is at the first item, at 0
    m above the sea, and a note says so. `progress` is called with the number of items of the mission that
    were received, and of all. A LinkError says that the vehicle falls silent or refuses, a MissionError that
    it holds no mission, or one that would not be safe.
    """
    rows = receive_items(link, MissionType.MISSION, progress or (lambda done, total: None))
    vehicle = link.vehicle
    if len(rows) <= int(vehicle.has_home_row):
        raise MissionError("the vehicle holds no mission")
    notes: list[str] = []
    fence_items = _optional(link, MissionType.FENCE, notes)
    rally_items = _optional(link, MissionType.RALLY, notes)
    if any(item.command == messages.FENCE_RETURN for item in fence_items):
        notes.append("the return point of the fence was not read")
    with named_errors("what the vehicle holds cannot be used", MissionError):
        items = messages.mission_items(rows[1:] if vehicle.has_home_row else rows, vehicle.has_home_row)
        home = _home(link, rows, items, notes)
        fence, rally = messages.fence_of_items(fence_items), messages.rally_of_items(rally_items)
        mission = Mission(home, items, _autopilot(home, items, vehicle, notes), fence=fence, rally=rally)
    return replace(mission, notes=tuple(notes))


def _optional(link: Link, list_type: MissionType, notes: list[str]) -> list[LinkItem]:
    """Receive a list that a vehicle need not support."""
    try:
        return receive_items(link, list_type, lambda done, total: None)
    except (TransferLostError, RefusedError) as error:
        notes.append(f"the {list_type} of the vehicle could not be read: {error}")
        return []


def _home(
    link: Link, rows: Sequence[LinkItem], items: Sequence[MissionItem], notes: list[str]
) -> HomePosition:
    home = messages.home_of_row(rows[0]) if link.vehicle.has_home_row and rows else None
    if home is not None:
        return home
    if link.home is None and link.vehicle.autopilot == "px4":
        until = link.now() + HOME_S
        while link.home is None and link.now() < until:
            link.next_message(min(link.now() + POLL_S, until), none_expected=True)
    if link.home is not None:
        return HomePosition(*link.home)
    first = next((item for item in items if item.has_position and not item.is_at_vehicle), None)
    if first is None:
        raise MissionError("the mission of the vehicle flies to no position")
    notes.append("the vehicle does not tell its home: the position of the first item is taken, at 0 m")
    return HomePosition(first.lat, first.lon)


def _autopilot(
    home: HomePosition, items: tuple[MissionItem, ...], vehicle: LinkedVehicle, notes: list[str]
) -> str:
    """Return the autopilot that the mission is for; of a generic vehicle, the first whose rules it keeps."""
    if vehicle.autopilot != "generic":
        return vehicle.autopilot
    for autopilot in ("generic", *AUTOPILOT_NAMES):
        try:
            Mission(home, items, autopilot)
        except MissionError:
            continue
        if autopilot != "generic":
            name = AUTOPILOT_NAMES[autopilot]
            notes.append(f"the vehicle is a generic one: its mission is read as one for {name}")
        return autopilot
    return next(iter(AUTOPILOT_NAMES))  # whose rules the mission breaks, as its error then says
