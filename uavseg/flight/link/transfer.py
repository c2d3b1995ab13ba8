"""Mission protocol: send a list to the vehicle, or receive one from it."""

from collections.abc import Callable, Sequence
from typing import Any

from pymavlink.dialects.v20 import common

from uavseg.errors import LinkError
from uavseg.execution.executors import Progress
from uavseg.flight.link import messages
from uavseg.flight.link.link import Link
from uavseg.flight.link.messages import LinkItem, MissionType, RefusedError, Result, TransferLostError

REQUEST_S = 0.7  # within which MAVSDK and PX4 ask again, if no item comes; every item puts MAVSDK off
LAST_ACK_S = 4.0  # after the last item; a vehicle that misses it asks again earlier
NO_SPACE_S = 5.0  # how long a vehicle that starts may have no space yet
STOPPED_S = 2.0  # after an error the vehicle asks again within 1 s, if it goes on
TEXT_S = 0.5  # within which the vehicle says why it refuses
MAX_RESTARTS = 5  # by the vehicle, which then asks for item 0 again

Count = Callable[[int], None]  # called with the number of items that are done

_BUSY = frozenset({Result.ERROR, Result.DENIED, Result.NO_SPACE, Result.OPERATION_CANCELLED})
PAUSES_S = (0.0, 0.02, 0.05, 0.05, 0.1, 0.1, 0.2, 0.2)  # between items; of each attempt
STALL_S = 4.0  # MAVSDK ends a transfer after 2.5 s, PX4 after 5 s; then only a new one goes on
SETTLE_S = 0.5  # for what is still on its way, before a new attempt
COUNT_S = 3.0  # for a list that is only counted
_LATE = (Result.ACCEPTED, Result.INVALID_SEQUENCE)  # answers to items of an earlier upload


def send_items(link: Link, list_type: MissionType, items: Sequence[LinkItem], count: Count) -> bool:
    """Send a list to the vehicle, which drives the transfer by its requests.

    Both MISSION_REQUEST and MISSION_REQUEST_INT are answered with MISSION_ITEM_INT. What is not answered is
    sent again: MISSION_COUNT until the first request, then the item that was requested last, once soon and
    then seldom, because the vehicle asks again as well. A vehicle that is busy, or starts and has no space
    yet, is offered the list again. MISSION_ACK with INVALID_SEQUENCE is ArduPilot's answer to an item that it
    did not expect; it goes on, and so does this.

    `count` is called with the number of items that were requested. The result is whether the vehicle
    acknowledged the list. If not, all items were sent and the acknowledgement is missing or an error, which
    an item that was repeated gives too: compare what the vehicle holds. A TransferLostError says that the
    vehicle falls silent or cancels the transfer, a LinkError that it refuses an item, or that another
    transfer is noticed.
    """
    return _Sender(link, list_type, items, count).run()


class _Sender:
    """State of one upload."""

    def __init__(self, link: Link, list_type: MissionType, items: Sequence[LinkItem], count: Count) -> None:
        self.link, self.type, self.items, self.count = link, list_type, items, count
        self.last = self.farthest = -1  # the item that was requested last, and the highest so far
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
            wait_s = self.link.timer.timeout_s
            wait_s = max(wait_s, REQUEST_S) if self.last >= 0 and self.repeats else wait_s
            message = self.link.next_message(min(self.sent_at + wait_s, self._give_up_at))
            if message is None:
                if self.link.now() >= self._give_up_at:
                    return self._give_up()
                self.link.timer.repeated()
                self.repeats += 1
                self._send_last()
            elif message.mission_type != self.type:
                continue  # late, of an earlier transfer
            elif message.get_type() in ("MISSION_REQUEST", "MISSION_REQUEST_INT"):
                self._answer(message.seq)
            elif message.get_type() == "MISSION_ACK" and self._is_end(message.type):
                return bool(message.type == Result.ACCEPTED)

    def _answer(self, number: int) -> None:
        if number >= len(self.items):
            raise LinkError(
                f"the vehicle asks for item {number} of {len(self.items)} of the {self.type}: "
                "another transfer is under way; end that, and transfer again"
            )
        if number > self.farthest:
            if number != self.last:
                self.link.timer.answered(self.link.now() - self.sent_at)
            self._progress(number)
        elif number == 0 and self.restarts < MAX_RESTARTS:
            self.restarts += 1
            self._progress(number)
        self.last, self.repeats = number, 0
        self.error_at = self.refusal = None
        self._send_last()

    def _progress(self, number: int) -> None:
        self.farthest, self.progress_at = number, self.link.now()
        self.count(number + 1)

    def _is_end(self, result: int) -> bool:
        """Return whether an acknowledgement ends the transfer; raise LinkError for a refusal."""
        if result == Result.ACCEPTED:
            return self._is_all_sent  # or a late one of an earlier transfer
        if result == Result.INVALID_SEQUENCE:
            return False
        if self.last < 0 and result in _BUSY:
            self.refusal = result
            return False
        if result == Result.OPERATION_CANCELLED:
            raise TransferLostError(f"the vehicle cancelled the transfer of the {self.type}")
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
            self.link.send("mission_count", self.type, len(self.items))
        else:
            # never 2 or 3, which fly at once
            is_current = self.last == 0 and self.type == MissionType.MISSION
            fields = self.items[self.last].fields(self.last, is_current)
            self.link.send("mission_item_int", self.type, *fields)

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
            raise LinkError(f"the vehicle does not answer to the {self.type} for {self.link.timeout_s:g} s")
        raise TransferLostError(
            f"the transfer stopped after {self.farthest} of {len(self.items)} items of the {self.type}: "
            f"no progress for {self.link.timeout_s:g} s"
        )

    def _refused(self, result: int) -> LinkError:
        """Return the error of a refusal, with the status text that the vehicle sends about it."""
        ends_at = self.link.now() + TEXT_S
        while self.link.now() < ends_at and not self.link.texts:
            self.link.next_message(ends_at)
        refused, remains = f"{len(self.items)} items of the {self.type}", ""
        if self.last >= 0:
            item = self.items[self.last]
            command = command_name(item.command)
            refused = f"item {self.last} of the {self.type}, {command} in frame {item.frame}"
            if self.link.vehicle.autopilot == "ardupilot":  # which writes items as they come
                remains = f"; its {self.type} is now a mix of old and new items: do not fly it"
        text = f'; it says "{self.link.texts[-1]}"' if self.link.texts else ""
        return LinkError(f"the vehicle refuses {refused}: {messages.result_text(result)}{text}{remains}")


def command_name(command: int) -> str:
    """Return the name of a MAV_CMD with its number."""
    entry: Any = common.enums["MAV_CMD"].get(command)
    return f"{entry.name.removeprefix('MAV_CMD_')} ({command})" if entry else f"command {command}"


def receive_items(link: Link, list_type: MissionType, progress: Progress) -> list[LinkItem]:
    """Receive a list from the vehicle, from its beginning again if the transfer stops.

    PX4 stops when a request comes late, after two more; so each new attempt pauses longer between the items.
    `progress` is called with the number of items that were received, and of all. A TransferLostError says
    that the vehicle falls silent, a LinkError that it refuses, or that another transfer is noticed.
    """
    for pause_s in PAUSES_S:
        receiver = _Receiver(link, list_type, progress)
        try:
            return receiver.run(pause_s)
        except TransferLostError:
            if pause_s == PAUSES_S[-1] or receiver.count is None:
                raise
            link.next_message(link.now() + SETTLE_S, none_expected=True)
    raise AssertionError("the last attempt returns or raises")


def count_items(link: Link, list_type: MissionType) -> int | None:
    """Return how many items of a list the vehicle holds; None if it does not answer."""
    receiver = _Receiver(link, list_type, lambda done, total: None, min(COUNT_S, link.timeout_s))
    try:
        count = receiver.ask_count()
    except (TransferLostError, RefusedError):
        return None
    link.acknowledge(list_type, Result.OPERATION_CANCELLED if count else Result.ACCEPTED)
    return count


class _Receiver:
    """State of one download."""

    def __init__(
        self, link: Link, list_type: MissionType, progress: Progress, timeout_s: float | None = None
    ) -> None:
        self.link, self.type, self.progress = link, list_type, progress
        self.timeout_s = link.timeout_s if timeout_s is None else timeout_s
        self.count: int | None = None
        self.items: list[LinkItem] = []

    def run(self, pause_s: float) -> list[LinkItem]:
        try:
            self.count = self.ask_count()
            while len(self.items) < self.count:
                message = self._request("mission_request_int", "MISSION_ITEM_INT", len(self.items))
                self.items.append(LinkItem.of_message(message))
                self.progress(len(self.items), self.count)
                if pause_s:
                    self.link.next_message(self.link.now() + pause_s, none_expected=True)
        except BaseException:
            self.link.cancel(self.type)
            raise
        self.link.acknowledge(self.type, Result.ACCEPTED)
        return self.items

    def ask_count(self) -> int:
        """Request the list; return the number of its items."""
        return int(self._request("mission_request_list", "MISSION_COUNT").count)

    def _request(self, request: str, answer: str, number: int | None = None) -> Any:
        """Send a request, for the list or the item with this number, until it is answered."""
        link = self.link
        sent_at = first_at = link.now()
        keeps_state = number is not None and link.vehicle.autopilot != "ardupilot"
        give_up_at = first_at + (min(STALL_S, self.timeout_s) if keeps_state else self.timeout_s)
        refusal: int | None = None
        fields = () if number is None else (number,)
        link.send(request, self.type, *fields)
        while True:
            message = link.next_message(min(sent_at + link.timer.timeout_s, give_up_at))
            if message is None:
                if link.now() >= give_up_at:
                    raise self._lost(refusal)
                link.timer.repeated()
                sent_at = link.now()
                link.send(request, self.type, *fields)
            elif message.mission_type != self.type:
                continue  # late, of an earlier transfer
            elif message.get_type() == answer and number in (None, getattr(message, "seq", None)):
                link.timer.answered(link.now() - sent_at)
                return message
            elif message.get_type() == "MISSION_COUNT" and message.count != self.count:
                raise LinkError(
                    f"the {self.type} of the vehicle changes while it is read; end the other transfer"
                )
            elif message.get_type() == "MISSION_ACK" and message.type not in _LATE:
                refusal = message.type
                if refusal not in (Result.ERROR, Result.DENIED, Result.OPERATION_CANCELLED):
                    raise self._refused(refusal)
                if number is not None:  # PX4 stops the transfer; ask for the list again
                    give_up_at = min(give_up_at, link.now() + STOPPED_S)

    def _lost(self, refusal: int | None) -> LinkError:
        if refusal is not None and self.count is None:
            return self._refused(refusal)
        where = "when asked" if self.count is None else f"after {len(self.items)} of {self.count} items"
        return TransferLostError(f"the vehicle fell silent {where} for its {self.type}")

    def _refused(self, result: int) -> LinkError:
        return RefusedError(f"the vehicle refuses to send its {self.type}: {messages.result_text(result)}")
