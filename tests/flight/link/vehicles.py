"""Vehicles that answer the mission protocol as ArduPilot and PX4 do, after their sources.

ArduPilot: GCS_MAVLink/MissionItemProtocol.cpp and AP_Mission.cpp; PX4: mavlink/mavlink_mission.cpp.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Any

from pymavlink.dialects.v20 import common

from uavseg.flight.link.messages import Result

MISSION_MESSAGES = {
    *("HEARTBEAT", "MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ACK"),
    *("MISSION_REQUEST_LIST", "MISSION_REQUEST_INT"),
}
GLOBAL_FRAMES = {0: 0, 3: 3, 5: 0, 6: 3, 10: 10, 11: 10}
LOCATED = {16, 17, 18, 19, 21, 22, 31, 82, 84, 85, 189, 195, 201}
KNOWN = LOCATED | {20, 112, 115, 177, 178, 206, 2000, 5000, 5001, 5002, 5003, 5004, 5100}


@dataclass
class Item:
    """What a vehicle stores of MISSION_ITEM_INT."""

    command: int
    frame: int
    params: tuple[float, float, float, float]
    x: int
    y: int
    z: float
    autocontinue: int = 1

    @classmethod
    def of(cls, message: Any) -> "Item":
        params = (message.param1, message.param2, message.param3, message.param4)
        place = message.x, message.y, message.z
        return cls(message.command, message.frame, params, *place, message.autocontinue)


EKF_HOME = Item(16, 0, (0.0,) * 4, 470000000, 80000000, 412.5)


@dataclass
class Upload:
    """An upload that a vehicle has begun."""

    sender: tuple[int, int]
    kind: int
    count: int
    received_at: float
    requested_at: float = 0.0
    expected: int = 0
    items: list[Item] = field(default_factory=list)


class FakeVehicle:
    """A vehicle: `handle` takes bytes, `tick` passes time, both collect what is sent in `outbox`."""

    autopilot = 0
    heartbeat_s = 1.0
    repeat_s = 0.5
    give_up_s = 3.0

    def __init__(self, system: int = 1, armed: bool = False) -> None:
        self.stored: dict[int, list[Item]] = {0: [], 1: [], 2: []}
        self.seen: set[str] = set()
        self.currents: set[int] = set()
        self.refused: dict[int, int] = {}  # result by number of item
        self.silent_after: float | None = None  # number of messages
        self.handled = 0
        self.armed = armed
        self.armed_mode = 128  # its flags while it is armed
        self.upload: Upload | None = None
        self.outbox: list[bytes] = []
        self.system = system
        self._mav = common.MAVLink(self, system, 1)
        self._heartbeat_at = -1.0
        self.now = 0.0

    def write(self, data: bytes) -> None:
        """What pymavlink sends."""
        self.outbox.append(bytes(data))

    def handle(self, data: bytes, now: float) -> None:
        """Take in the bytes of whole messages."""
        self.now = now
        parser = common.MAVLink(None)
        parser.robust_parsing = True
        for message in parser.parse_buffer(data) or []:
            name = message.get_type()
            self.seen.add(name)
            if getattr(message, "target_system", self.system) != self.system:
                continue
            self.handled += name != "HEARTBEAT"
            if self.silent_after is not None and self.handled > self.silent_after:
                continue
            handler = getattr(self, f"on_{name.lower()}", None)
            if handler is not None:
                handler(message, (message.get_srcSystem(), message.get_srcComponent()))

    def tick(self, now: float) -> None:
        """Let time pass: heartbeats, repeated requests, time-outs."""
        self.now = now
        if now - self._heartbeat_at >= self.heartbeat_s:
            self._heartbeat_at = now
            self._mav.heartbeat_send(2, self.autopilot, self.armed_mode if self.armed else 0, 0, 4)
        if self.upload is not None and not self.is_mute:
            if now - self.upload.received_at > self.give_up_s:
                self.on_give_up(self.upload)
                self.upload = None
            elif now - self.upload.requested_at > self.repeat_s:
                self.request()

    @property
    def is_mute(self) -> bool:
        """Whether it has fallen silent."""
        return self.silent_after is not None and self.handled > self.silent_after

    def request(self) -> None:
        """Ask for the next item."""
        upload = self.upload
        assert upload is not None
        upload.requested_at = self.now
        self.send_request(*upload.sender, upload.expected, upload.kind)

    def send_request(self, *fields: int) -> None:
        self._mav.mission_request_int_send(*fields)

    def ack(self, to: tuple[int, int], result: int, kind: int) -> None:
        self._mav.mission_ack_send(*to, int(result), kind)

    def text(self, words: str) -> None:
        self._mav.statustext_send(4, words.encode())

    def on_give_up(self, upload: Upload) -> None:
        """An upload ends without having come to its end."""

    def item_message(self, item: Item, number: int, to: tuple[int, int], kind: int) -> None:
        start = number, item.frame, item.command, 0, item.autocontinue
        self._mav.mission_item_int_send(*to, *start, *item.params, item.x, item.y, item.z, kind)

    def check(self, message: Any) -> int:
        """Result for an item."""
        return self.refused.get(message.seq, Result.ACCEPTED if message.command in KNOWN else 3)


class ArduPilot(FakeVehicle):
    """Asks by MISSION_REQUEST, stores each item at once, and answers INVALID_SEQUENCE and goes on."""

    autopilot = 3
    repeat_s = 1.0
    give_up_s = 8.0

    def __init__(
        self, home: Item | None = None, capacity: int = 650, boots_s: float = 0.0, **how: Any
    ) -> None:
        super().__init__(**how)
        self.home = home or Item(16, 0, (0.0,) * 4, 470000000, 80000000, 412.5)
        self.capacity, self.boots_s = capacity, boots_s
        self.starts = 0

    def send_request(self, *fields: int) -> None:
        self._mav.mission_request_send(*fields)

    def on_mission_count(self, message: Any, sender: tuple[int, int]) -> None:
        kind = message.mission_type
        if self.upload is not None and self.upload.sender != sender:
            self.ack(sender, Result.DENIED, kind)
            return
        if message.count > self.capacity or self.now < self.boots_s:
            self.ack(sender, Result.NO_SPACE, kind)
            if self.now >= self.boots_s:
                self.text(f"Only {self.capacity} items are supported")
            return
        self.starts += 1
        del self.stored[kind][message.count :]
        if message.count == 0:
            self.ack(sender, Result.ACCEPTED, kind)
            return
        self.upload = Upload(sender, kind, message.count, self.now)
        self.request()

    def on_mission_item_int(self, message: Any, sender: tuple[int, int]) -> None:
        self.currents.add(message.current)
        upload, kind = self.upload, message.mission_type
        if upload is None:
            self.ack(sender, Result.ERROR, kind)
        elif message.seq != upload.expected:
            self.ack(sender, Result.INVALID_SEQUENCE, kind)
        elif sender != upload.sender:
            self.ack(sender, Result.DENIED, kind)
        elif (result := self.check(message)) != Result.ACCEPTED:
            self.ack(sender, result, kind)
            self.upload = None
        else:
            self.stored[kind][message.seq : message.seq + 1] = [self.keep(Item.of(message))]
            upload.received_at = self.now
            upload.expected += 1
            if upload.expected == upload.count:
                self.ack(sender, Result.ACCEPTED, kind)
                self.upload = None
            else:
                self.request()

    def check(self, message: Any) -> int:
        is_known = message.command not in LOCATED or message.frame in GLOBAL_FRAMES
        return super().check(message) if is_known else Result.UNSUPPORTED_FRAME

    def keep(self, item: Item) -> Item:
        """What its storage makes of an item: whole centimetres, few parameters, no headings."""
        first, second, third, _ = item.params
        altitude_cm = int(item.z * 100)
        if item.command in (5001, 5002, 5003, 5004):
            return Item(item.command, 0, (first, 0.0, 0.0, 0.0), item.x, item.y, 0.0)
        if item.command == 5100:
            return Item(5100, 3, (0.0,) * 4, item.x, item.y, float(int(item.z)))
        if item.command in LOCATED:
            whole = (float(int(first)), 0.0, 0.0, float(item.command == 21))  # of a landing, its direction
            frame = GLOBAL_FRAMES.get(item.frame, 0)
            return Item(item.command, frame, whole, item.x, item.y, altitude_cm / 100)
        return Item(item.command, 0, (first, second, third, 0.0), 0, 0, 0.0)

    def on_give_up(self, upload: Upload) -> None:
        self.ack(upload.sender, Result.OPERATION_CANCELLED, upload.kind)
        self.text("Mission upload timeout")

    def held(self, kind: int) -> list[Item]:
        """What it would send: home in place of item 0."""
        items = self.stored[kind]
        return [self.home, *items[1:]] if kind == 0 and items else items

    def on_mission_request_list(self, message: Any, sender: tuple[int, int]) -> None:
        if self.upload is not None:
            self.ack(sender, Result.DENIED, message.mission_type)
            return
        self._mav.mission_count_send(*sender, len(self.held(message.mission_type)), message.mission_type)

    def on_mission_request_int(self, message: Any, sender: tuple[int, int]) -> None:
        items = self.held(message.mission_type)
        if self.upload is not None:
            self.ack(sender, Result.DENIED, message.mission_type)
        elif message.seq >= len(items):
            self.ack(sender, Result.INVALID_SEQUENCE, message.mission_type)
        else:
            self.item_message(items[message.seq], message.seq, sender, message.mission_type)


class Px4(FakeVehicle):
    """Asks by MISSION_REQUEST_INT, ignores what it did not expect, keeps the old list until the end."""

    autopilot = 12
    repeat_s = 0.25
    give_up_s = 5.0

    def __init__(self, home: tuple[float, float, float] | None = None, **how: Any) -> None:
        super().__init__(**how)
        self.home = home
        self.partner: tuple[int, int] = (0, 0)
        self.sending: int | None = None  # kind of a download
        self.next = 0  # item of an upload or a download
        self.heard_at = 0.0
        self._home_at = 0.0

    def tick(self, now: float) -> None:
        super().tick(now)
        if self.home is not None and now - self._home_at >= 2 * self.heartbeat_s:
            self._home_at = now
            lat, lon, alt = self.home
            place = round(lat * 1e7), round(lon * 1e7), round(alt * 1e3)
            self._mav.home_position_send(*place, 0, 0, 0, (1, 0, 0, 0), 0, 0, 0)
        if self.sending is not None and now - self.heard_at > self.give_up_s:
            self.sending = None

    def on_mission_count(self, message: Any, sender: tuple[int, int]) -> None:
        kind, upload = message.mission_type, self.upload
        if self.sending is not None or (upload is not None and upload.sender != sender):
            self.ack(sender, Result.ERROR, kind)
            return
        if upload is not None:
            upload.received_at = self.now
            if upload.expected > 0:
                self.ack(sender, Result.ERROR, kind)
                return
        elif message.count == 0:
            self.stored[kind] = []
            self.ack(sender, Result.ACCEPTED, kind)
            return
        else:
            self.partner, self.next = sender, 0
            self.upload = Upload(sender, kind, message.count, self.now)
        self.request()

    def on_mission_item_int(self, message: Any, sender: tuple[int, int]) -> None:
        self.currents.add(message.current)
        upload, kind = self.upload, message.mission_type
        if sender != self.partner:
            return
        if upload is None:
            again = self.sending is None and self.next == message.seq + 1
            self.ack(sender, Result.ACCEPTED if again else Result.ERROR, kind)
            return
        if kind != upload.kind:
            self.ack(sender, Result.ERROR, kind)
            return
        upload.received_at = self.now
        if message.seq != upload.expected:
            return
        if (result := self.check(message)) != Result.ACCEPTED:
            self.ack(sender, result, kind)
            self.upload = None
            return
        upload.items.append(self.keep(Item.of(message)))
        upload.expected = self.next = message.seq + 1
        if upload.expected == upload.count:
            self.stored[kind] = upload.items
            self.upload = None
            self.ack(sender, Result.ACCEPTED, kind)
        else:
            self.request()

    def check(self, message: Any) -> int:
        if message.frame not in (0, 3, 5, 6, 2):
            return Result.UNSUPPORTED_FRAME
        if (message.frame == 2) == (message.command in LOCATED or message.command >= 5000):
            return Result.UNSUPPORTED
        return super().check(message)

    def keep(self, item: Item) -> Item:
        """Frames without INT come back with it; headings lie in 0 to 360, and param3 is not kept."""
        if item.frame == 2 or item.command >= 5000:
            return item
        first, second, _, fourth = item.params
        heading = fourth % 360 if not math.isnan(fourth) else fourth
        frame = {0: 5, 3: 6}.get(item.frame, item.frame)
        return replace(item, frame=frame, params=(first, second, 0.0, heading))

    def on_mission_request_list(self, message: Any, sender: tuple[int, int]) -> None:
        if self.sending is not None and self.next == len(self.stored[self.sending]):
            self.sending = None
        is_again = self.sending == message.mission_type and sender == self.partner
        if self.upload is not None or (self.sending is not None and not is_again):
            self.text("Mission download request ignored, already active")
            return
        self.sending, self.next, self.partner, self.heard_at = message.mission_type, 0, sender, self.now
        self._mav.mission_count_send(*sender, len(self.stored[message.mission_type]), message.mission_type)

    def on_mission_request_int(self, message: Any, sender: tuple[int, int]) -> None:
        kind = message.mission_type
        if sender != self.partner or self.sending != kind:
            return
        self.heard_at = self.now
        items = self.stored[kind]
        if message.seq == self.next < len(items):
            self.next += 1
        elif message.seq != self.next - 1:
            self.sending = None
            self.ack(sender, Result.ERROR, kind)
            return
        self.item_message(items[message.seq], message.seq, sender, kind)

    def on_mission_ack(self, message: Any, sender: tuple[int, int]) -> None:
        if sender != self.partner:
            return
        if self.sending == message.mission_type:
            self.sending = None
        elif self.upload is not None and message.type == Result.OPERATION_CANCELLED:
            self.upload = None


class Generic(Px4):
    """A vehicle of no known autopilot, which keeps items as they are sent."""

    autopilot = 0

    def check(self, message: Any) -> int:
        return self.refused.get(message.seq, Result.ACCEPTED)

    def keep(self, item: Item) -> Item:
        return item
