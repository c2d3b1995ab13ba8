"""Sending side of the mission protocol: offer a list, and answer the vehicle's requests until it has all."""

from collections.abc import Callable, Sequence
from typing import Any

from pymavlink.dialects.v20 import common

from uavseg.errors import LinkError
from uavseg.flight.link.link import Link
from uavseg.flight.link.link_items import LinkItem
from uavseg.flight.link.results import Kind, Result, TransferLostError, result_words

ASKS_S = 0.7  # within which MAVSDK and PX4 ask again, if no item comes; every item puts MAVSDK off
LAST_ACK_S = 4.0  # after the last item; a vehicle that misses it asks again before
NO_SPACE_S = 5.0  # how long a vehicle that starts may have no space yet
STOPPED_S = 2.0  # after an error the vehicle asks again within 1 s, if it goes on
TEXT_S = 0.5  # within which the vehicle says why it refuses
MAX_RESTARTS = 5  # by the vehicle, which then asks for item 0 again

Count = Callable[[int], None]
"""Called with the number of items that are done."""

_BUSY = frozenset({Result.ERROR, Result.DENIED, Result.NO_SPACE, Result.OPERATION_CANCELLED})


def send_items(link: Link, kind: Kind, items: Sequence[LinkItem], count: Count) -> bool:
    """Send a list to the vehicle, which drives the transfer by its requests.

    Both MISSION_REQUEST and MISSION_REQUEST_INT are answered with MISSION_ITEM_INT. What is not answered is
    sent again: MISSION_COUNT until the first request, then the item that was requested last, once soon and
    then seldom, because the vehicle asks again as well. A vehicle that is busy, or starts and has no space
    yet, is offered the list again. MISSION_ACK with INVALID_SEQUENCE is ArduPilot's answer to an item that it
    did not expect; it goes on, and so does this.

    Returns
    -------
    acknowledged : bool
        Whether the vehicle acknowledged the list. If not, all items were sent and the acknowledgement is
        missing or an error, which an item that was repeated gives too: compare what the vehicle holds.

    Raises
    ------
    TransferLostError
        If the vehicle falls silent or cancels the transfer.
    LinkError
        If the vehicle refuses an item, or another transfer is noticed.
    """
    return _Sending(link, kind, items, count).run()


class _Sending:
    """State of one transfer."""

    def __init__(self, link: Link, kind: Kind, items: Sequence[LinkItem], count: Count) -> None:
        self.link, self.kind, self.items, self.count = link, kind, items, count
        self.last = -1  # the item that was requested last
        self.farthest = -1
        self.restarts = self.repeats = 0
        self.started_at = self.progress_at = link.now()
        self.sent_at = 0.0
        self.error_at: float | None = None
        self.refusal: int | None = None
        link.texts.clear()

    @property
    def _is_all_sent(self) -> bool:
        return self.farthest == len(self.items) - 1

    def run(self) -> bool:
        self._send_last()
        while True:
            message = self.link.next_message(min(self._repeat_at, self._give_up_at))
            if message is None:
                if self.link.now() >= self._give_up_at:
                    return self._give_up()
                self.link.patience.repeated()
                self.repeats += 1
                self._send_last()
            elif message.mission_type != self.kind:
                continue  # late, of an earlier transfer
            elif message.get_type() in ("MISSION_REQUEST", "MISSION_REQUEST_INT"):
                self._answer(message.seq)
            elif message.get_type() == "MISSION_ACK" and self._is_end(message.type):
                return bool(message.type == Result.ACCEPTED)

    def _answer(self, number: int) -> None:
        if number >= len(self.items):
            raise LinkError(
                f"the vehicle asks for item {number} of {len(self.items)} of the {self.kind}: "
                "another transfer is under way; end that, and transfer again"
            )
        if number > self.farthest:
            if number != self.last:
                self.link.patience.answered(self.link.now() - self.sent_at)
            self._progress(number)
        elif number == 0 and self.restarts < MAX_RESTARTS:
            self.restarts += 1
            self._progress(number)
        self.last = number
        self.repeats = 0
        self.error_at = self.refusal = None
        self._send_last()

    def _progress(self, number: int) -> None:
        self.farthest = number
        self.progress_at = self.link.now()
        self.count(number + 1)

    def _is_end(self, result: int) -> bool:
        """Whether an acknowledgement ends the transfer; a refusal is raised."""
        if result == Result.ACCEPTED:
            return self._is_all_sent  # or a late one of an earlier transfer
        if result == Result.INVALID_SEQUENCE:
            return False
        if self.last < 0 and result in _BUSY:
            self.refusal = result
            return False
        if result == Result.OPERATION_CANCELLED:
            raise TransferLostError(f"the vehicle cancelled the transfer of the {self.kind}")
        if result == Result.ERROR:
            if self._is_all_sent:
                return True
            self.error_at = self.link.now() if self.error_at is None else self.error_at
            self.refusal = result
            return False
        raise self._refused(result)

    def _send_last(self) -> None:
        self.sent_at = self.link.now()
        if self.last < 0:
            self.link.count(self.kind, len(self.items))
        else:
            is_current = self.last == 0 and self.kind == Kind.MISSION  # never 2 or 3, which fly at once
            self.link.item(self.kind, self.items[self.last].fields(self.last, is_current))

    @property
    def _repeat_at(self) -> float:
        wait_s = self.link.patience.wait_s
        return self.sent_at + (max(wait_s, ASKS_S) if self.last >= 0 and self.repeats else wait_s)

    @property
    def _give_up_at(self) -> float:
        give_up_at = self.progress_at + self.link.timeout_s
        if self.error_at is not None:
            return min(give_up_at, self.error_at + STOPPED_S)
        if self._is_all_sent:
            return min(give_up_at, self.progress_at + LAST_ACK_S)
        if self.refusal == Result.NO_SPACE:
            return min(give_up_at, self.started_at + NO_SPACE_S)
        return give_up_at

    def _give_up(self) -> bool:
        if self._is_all_sent:
            return False
        if self.refusal is not None:
            raise self._refused(self.refusal)
        if self.last < 0:
            raise LinkError(f"the vehicle does not answer to the {self.kind} for {self.link.timeout_s:g} s")
        raise TransferLostError(
            f"the transfer stopped after {self.farthest} of {len(self.items)} items of the {self.kind}: "
            f"no progress for {self.link.timeout_s:g} s"
        )

    def _refused(self, result: int) -> LinkError:
        """The error of a refusal, with what the vehicle says about it."""
        ends_at = self.link.now() + TEXT_S
        while self.link.now() < ends_at and not self.link.texts:
            self.link.next_message(ends_at)
        what = f"{len(self.items)} items of the {self.kind}"
        kept = ""
        if self.last >= 0:
            item = self.items[self.last]
            what = f"item {self.last} of the {self.kind}, {command_name(item.command)} in frame {item.frame}"
            if self.link.vehicle.autopilot == "ardupilot":  # which writes items as they come
                kept = f"; its {self.kind} is now a mix of old and new items: do not fly it"
        says = f'; it says "{self.link.texts[-1]}"' if self.link.texts else ""
        return LinkError(f"the vehicle refuses {what}: {result_words(result)}{says}{kept}")


def command_name(command: int) -> str:
    """The name of a command with its number."""
    known: Any = common.enums["MAV_CMD"].get(command)
    return f"{known.name.removeprefix('MAV_CMD_')} ({command})" if known else f"command {command}"
