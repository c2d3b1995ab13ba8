"""Receiving side of the mission protocol: ask how many items there are, then for one after the other."""

from collections.abc import Callable
from typing import Any

from uavseg.errors import LinkError
from uavseg.flight.link.link import Link
from uavseg.flight.link.link_items import LinkItem
from uavseg.flight.link.results import Kind, RefusedError, Result, TransferLostError, result_words
from uavseg.flight.link.send import STOPPED_S

Progress = Callable[[int, int], None]
"""Called with the number of items that are done, and of all."""

PAUSES_S = (0.0, 0.02, 0.05, 0.05, 0.1, 0.1, 0.2, 0.2)  # between items; of each attempt
STALL_S = 4.0  # MAVSDK ends a transfer after 2.5 s, PX4 after 5 s; then only a new one goes on
SETTLE_S = 0.5  # for what is still on its way, before a new attempt
COUNT_S = 3.0  # for a list that is only counted
_LATE = (Result.ACCEPTED, Result.INVALID_SEQUENCE)  # answers to items of an earlier upload


def receive_items(link: Link, kind: Kind, progress: Progress) -> list[LinkItem]:
    """Receive a list from the vehicle, from its beginning again if it stops in between.

    PX4 stops when a request comes late, after two more; so each new attempt pauses longer between the items.

    Raises
    ------
    TransferLostError
        If the vehicle falls silent.
    LinkError
        If the vehicle refuses, or another transfer is noticed.
    """
    for pause_s in PAUSES_S:
        receiving = _Receiving(link, kind, progress)
        try:
            return receiving.run(pause_s)
        except TransferLostError:
            if pause_s == PAUSES_S[-1] or receiving.count is None:
                raise
            link.next_message(link.now() + SETTLE_S, none_expected=True)
    raise AssertionError("the last attempt returns or raises")


def count_items(link: Link, kind: Kind) -> int | None:
    """How many items of a list the vehicle holds; None if it does not say."""
    receiving = _Receiving(link, kind, lambda done, total: None, min(COUNT_S, link.timeout_s))
    try:
        count = receiving.ask_count()
    except (TransferLostError, RefusedError):
        return None
    link.acknowledge(kind, Result.OPERATION_CANCELLED if count else Result.ACCEPTED)
    return count


class _Receiving:
    """State of one transfer."""

    def __init__(self, link: Link, kind: Kind, progress: Progress, timeout_s: float | None = None) -> None:
        self.link, self.kind, self.progress = link, kind, progress
        self.timeout_s = link.timeout_s if timeout_s is None else timeout_s
        self.count: int | None = None
        self.items: list[LinkItem] = []

    def run(self, pause_s: float) -> list[LinkItem]:
        try:
            self.count = self.ask_count()
            while len(self.items) < self.count:
                self.items.append(LinkItem.of_message(self._ask_item(len(self.items))))
                self.progress(len(self.items), self.count)
                if pause_s:
                    self.link.next_message(self.link.now() + pause_s, none_expected=True)
        except BaseException:
            self.link.cancel(self.kind)
            raise
        self.link.acknowledge(self.kind, Result.ACCEPTED)
        return self.items

    def ask_count(self) -> int:
        """Ask for the list; the vehicle answers how many items it has."""
        return int(self._ask(lambda: self.link.request_list(self.kind), "MISSION_COUNT", None).count)

    def _ask_item(self, number: int) -> Any:
        return self._ask(lambda: self.link.request_item(self.kind, number), "MISSION_ITEM_INT", number)

    def _ask(self, send: Callable[[], None], answer: str, number: int | None) -> Any:
        """Send a question until it is answered."""
        link = self.link
        sent_at = asked_at = link.now()
        keeps_state = number is not None and link.vehicle.autopilot != "ardupilot"
        give_up_at = asked_at + (min(STALL_S, self.timeout_s) if keeps_state else self.timeout_s)
        refusal: int | None = None
        send()
        while True:
            message = link.next_message(min(sent_at + link.patience.wait_s, give_up_at))
            if message is None:
                if link.now() >= give_up_at:
                    raise self._lost(refusal)
                link.patience.repeated()
                sent_at = link.now()
                send()
            elif message.mission_type != self.kind:
                continue  # late, of an earlier transfer
            elif message.get_type() == answer and number in (None, getattr(message, "seq", None)):
                link.patience.answered(link.now() - sent_at)
                return message
            elif message.get_type() == "MISSION_COUNT" and message.count != self.count:
                raise LinkError(
                    f"the {self.kind} of the vehicle changes while it is read; end the other transfer"
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
        where = "when asked"
        if self.count is not None:
            where = f"after {len(self.items)} of {self.count} items"
        return TransferLostError(f"the vehicle fell silent {where} for its {self.kind}")

    def _refused(self, result: int) -> LinkError:
        return RefusedError(f"the vehicle refuses to send its {self.kind}: {result_words(result)}")
