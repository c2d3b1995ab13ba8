"""Upload: send the fence, the rally points and the mission to a vehicle, read each back and compare."""

from collections.abc import Sequence

from uavseg.errors import LinkError, MissionError, UnverifiedError
from uavseg.flight.link.compare import differences, rounded
from uavseg.flight.link.link import Link
from uavseg.flight.link.link_items import LinkItem, items_of_fence, items_of_mission, items_of_rally
from uavseg.flight.link.receive import Progress, count_items, receive_items
from uavseg.flight.link.results import Kind, TransferLostError
from uavseg.flight.link.send import send_items
from uavseg.flight.link.vehicle import AUTOPILOT_NAMES, Vehicle
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
        What the pilot should know.

    Raises
    ------
    MissionError
        If the mission is for another autopilot.
    UnverifiedError
        If the vehicle accepted a list that could not be read back.
    LinkError
        If the vehicle is armed, refuses a list, falls silent, or holds another one afterwards.
    """
    check_autopilot(mission, link.vehicle)
    warnings = []
    lists = _lists(mission, link.vehicle)
    steps = _Steps(progress, 2 * sum(map(len, lists.values())))
    for kind, items in lists.items():
        if not while_armed:
            _check_disarmed(link.vehicle, kind, list(lists))
        warnings += _transfer(link, kind, items, steps)
        steps.begin += 2 * len(items)
    if link.vehicle.is_armed:
        warnings.append("the vehicle is armed: its mission was replaced while it may be flying")
    for kind in (Kind.FENCE, Kind.RALLY):
        left = None if kind in lists else count_items(link, kind)
        if left:
            warnings.append(f"the vehicle keeps its {kind} ({left} items): the mission has none")
    return tuple(warnings)


def check_autopilot(mission: Mission, vehicle: Vehicle) -> None:
    """Raise MissionError if a mission is for another autopilot than the vehicle's."""
    known = vehicle.autopilot
    if known == "generic" or mission.autopilot not in AUTOPILOT_NAMES or mission.autopilot == known:
        return
    raise MissionError(
        f"the mission is for {AUTOPILOT_NAMES[mission.autopilot]}, and the vehicle is {vehicle}; plan it for "
        f"{AUTOPILOT_NAMES[known]} (a .waypoints file is always for ArduPilot)"
    )


def _check_disarmed(vehicle: Vehicle, kind: Kind, kinds: Sequence[Kind]) -> None:
    """Raise LinkError if a vehicle is armed, in any mode: it may be switched to its mission at any time."""
    if not vehicle.is_armed:
        return
    done = " and ".join(map(str, kinds[: kinds.index(kind)]))
    what = "the vehicle is armed and may be flying: nothing was sent to it"
    if done:
        what = (
            f"the vehicle was armed after its {done} had been sent, and may be flying: nothing more was sent"
        )
    raise LinkError(f"{what}; disarm it, or give --while-armed if its mission may change while it flies")


def _lists(mission: Mission, vehicle: Vehicle) -> dict[Kind, list[LinkItem]]:
    """What is sent, in this order."""
    lists = {
        Kind.FENCE: items_of_fence(mission.fence),
        Kind.RALLY: items_of_rally(mission.rally),
        Kind.MISSION: items_of_mission(mission, vehicle.has_home_row),
    }
    return {kind: items for kind, items in lists.items() if items}


class _Steps:
    """Progress over all lists; each item counts when it is sent and when it is read back."""

    def __init__(self, progress: Progress | None, total: int) -> None:
        self._progress = progress
        self._total = total
        self.begin = 0

    def done(self, count: int) -> None:
        if self._progress is not None:
            self._progress(self.begin + count, self._total)


def _transfer(link: Link, kind: Kind, items: Sequence[LinkItem], steps: _Steps) -> list[str]:
    """Send one list and compare what the vehicle then holds; the list is sent again if the transfer stops."""
    for attempt in range(1, ATTEMPTS + 1):
        try:
            is_acknowledged = send_items(link, kind, items, steps.done)
        except TransferLostError:
            if attempt == ATTEMPTS:
                raise
            continue
        except BaseException:
            link.cancel(kind)
            raise
        kept = _read_back(link, kind, items, steps, is_acknowledged)
        wrong = differences(items, kept, kind, link.vehicle.autopilot)
        if not wrong:
            return rounded(items, kept, kind, link.vehicle.autopilot)
        if is_acknowledged or attempt == ATTEMPTS:
            raise LinkError(_mismatch(kind, wrong))
    raise AssertionError("the last attempt returns or raises")


def _read_back(
    link: Link, kind: Kind, items: Sequence[LinkItem], steps: _Steps, is_acknowledged: bool
) -> list[LinkItem]:
    try:
        return receive_items(link, kind, lambda done, total: steps.done(len(items) + min(done, len(items))))
    except TransferLostError as error:
        if is_acknowledged:
            raise UnverifiedError(
                f"the vehicle accepted the {kind}, but it could not be read back and compared: {error}"
            ) from error
        raise LinkError(
            f"all items of the {kind} were sent, but they were neither acknowledged nor read back ({error}); "
            f"what the vehicle holds is not known: upload again"
        ) from error


def _mismatch(kind: Kind, wrong: Sequence[str]) -> str:
    more = f" (and {len(wrong) - 1} more)" if len(wrong) > 1 else ""
    return f"the vehicle does not hold the {kind} that was sent: {wrong[0]}{more}; upload again"
