"""Upload: send the fence, the rally points and the mission to a vehicle, read each back and compare."""

from collections.abc import Sequence

from uavseg.errors import LinkError, MissionError, UnverifiedError
from uavseg.flight.link.compare import differences, rounded
from uavseg.flight.link.link import AUTOPILOT_NAMES, Link, LinkedVehicle
from uavseg.flight.link.messages import (
    LinkItem,
    MissionType,
    TransferLostError,
    items_of_fence,
    items_of_mission,
    items_of_rally,
)
from uavseg.flight.link.transfer import Count, Progress, count_items, receive_items, send_items
from uavseg.flight.mission.mission import Mission

ATTEMPTS = 3


def upload_mission(
    link: Link, mission: Mission, progress: Progress | None = None, while_armed: bool = False
) -> tuple[str, ...]:
    """Upload a mission with its fence and rally points, read them back and compare.

    The fence goes first, so that the vehicle never holds the mission without it. A fence and rally points
    that the mission does not have are left as they are.

    Parameters
    ----------
    link : Link
    mission : Mission
    progress : callable, optional
        Called with the number of items that were sent or read back, and of all.
    while_armed : bool
        Whether the lists of a vehicle whose motors are armed may be replaced.

    Returns
    -------
    warnings : tuple of str
        For the pilot.

    Raises
    ------
    MissionError
        If the mission is for another autopilot.
    UnverifiedError
        If the vehicle accepted a list that could not be read back.
    LinkError
        If the vehicle is armed, refuses a list, falls silent, or holds another one afterwards.
    """
    _check_autopilot(mission, link.vehicle)
    warnings = []
    lists = {
        MissionType.FENCE: items_of_fence(mission.fence),
        MissionType.RALLY: items_of_rally(mission.rally),
        MissionType.MISSION: items_of_mission(mission, link.vehicle.has_home_row),
    }
    lists = {list_type: items for list_type, items in lists.items() if items}
    done, total = (
        0,
        2 * sum(map(len, lists.values())),
    )  # an item counts when it is sent and when it is read back
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


def _check_autopilot(mission: Mission, vehicle: LinkedVehicle) -> None:
    """Raise MissionError if a mission is for another autopilot than the vehicle's."""
    autopilot = vehicle.autopilot
    if autopilot == "generic" or mission.autopilot not in AUTOPILOT_NAMES or mission.autopilot == autopilot:
        return
    raise MissionError(
        f"the mission is for {AUTOPILOT_NAMES[mission.autopilot]}, and the vehicle is {vehicle}; plan it for "
        f"{AUTOPILOT_NAMES[autopilot]} (a .waypoints file is always for ArduPilot)"
    )


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
