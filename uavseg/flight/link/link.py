"""Link to one vehicle: finds it, keeps the heartbeat, passes on its messages, notices others in between."""

import os
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any

from pymavlink.dialects.v20 import common

from uavseg.errors import LinkError
from uavseg.flight.link.address import parse_address
from uavseg.flight.link.patience import Patience
from uavseg.flight.link.results import Result
from uavseg.flight.link.transport import Source, Transport, open_transport
from uavseg.flight.link.vehicle import ARMED, GROUND_STATION, INVALID_AUTOPILOT, Vehicle, is_vehicle

TIMEOUT_S = 10.0  # ArduPilot asks again after 1 s and gives up after 8 s; PX4 after 0.25 and 5 s
HEARTBEAT_S = 1.0
LISTEN_S = 1.2  # for a second vehicle, after the heartbeat of the first
POLL_S = 0.2
SYSTEM = 255  # of ground stations
FIRST_COMPONENT, COMPONENTS = 25, 75  # MAV_COMP_ID_USER1 to 75: two processes seldom have the same

_REQUESTS = frozenset({"MISSION_REQUEST", "MISSION_REQUEST_INT"})
_FOR_US = frozenset({*_REQUESTS, "MISSION_ACK", "MISSION_COUNT", "MISSION_ITEM_INT"})
_WRITES = frozenset(
    {
        *("MISSION_COUNT", "MISSION_ITEM", "MISSION_ITEM_INT"),
        *("MISSION_CLEAR_ALL", "MISSION_WRITE_PARTIAL_LIST"),
    }
)
_READ = _FOR_US | _WRITES | {"HEARTBEAT", "STATUSTEXT", "HOME_POSITION"}


class Link:
    """Connection to one vehicle.

    It sends heartbeats of a ground station and messages of the mission protocol, nothing else: no command
    can arm, start or move the vehicle.

    Parameters
    ----------
    transport : Transport
    timeout_s : float
        How long to wait without progress.
    now : callable
        Seconds of a clock that only goes forward.
    """

    def __init__(
        self, transport: Transport, timeout_s: float = TIMEOUT_S, now: Callable[[], float] = time.monotonic
    ) -> None:
        self.timeout_s = timeout_s
        self.now = now
        self.patience = Patience()
        self.texts: list[str] = []  # STATUSTEXT of the vehicle
        self.home: tuple[float, float, float] | None = None  # lat, lon, metres above the sea
        self.component = FIRST_COMPONENT + os.getpid() % COMPONENTS
        self._transport = transport
        self._mav = common.MAVLink(_Sender(transport), SYSTEM, self.component)
        self._parser = _parser()
        self._vehicle: Vehicle | None = None
        self._arrived: deque[tuple[Any, Source]] = deque()
        self._heartbeat_at = -HEARTBEAT_S + now()
        self._heard = 0

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle that was found."""
        assert self._vehicle is not None, "find_vehicle comes first"
        return self._vehicle

    def find_vehicle(self, address: object) -> None:
        """Wait for the heartbeat of an autopilot, and then for that of a second one.

        Raises
        ------
        LinkError
            If there is none in time, or more than one.
        """
        deadline = self.now() + self.timeout_s
        while self._vehicle is None and self.now() < deadline:
            self.next_message(min(self.now() + POLL_S, deadline))
        if self._vehicle is None:
            raise LinkError(f"no vehicle answers at {address} within {self.timeout_s:g} s{self._trouble()}")
        self.next_message(self.now() + LISTEN_S, none_expected=True)

    def _trouble(self) -> str:
        if self._heard:
            return ": messages arrive, but no heartbeat of an autopilot"
        if self._transport.trouble:
            return f" ({self._transport.trouble}); is it switched on, and is this its address?"
        return ": nothing arrives; is it switched on, and is this its address?"

    # Sending

    def count(self, kind: int, count: int) -> None:
        """Send MISSION_COUNT: offer so many items."""
        self._send("mission_count", count, mission_type=kind)

    def item(self, kind: int, fields: tuple[Any, ...]) -> None:
        """Send MISSION_ITEM_INT; the fields are those after the target."""
        self._send("mission_item_int", *fields, mission_type=kind)

    def request_list(self, kind: int) -> None:
        """Send MISSION_REQUEST_LIST: ask how many items there are."""
        self._send("mission_request_list", mission_type=kind)

    def request_item(self, kind: int, number: int) -> None:
        """Send MISSION_REQUEST_INT: ask for an item."""
        self._send("mission_request_int", number, mission_type=kind)

    def acknowledge(self, kind: int, result: Result) -> None:
        """Send MISSION_ACK: end a transfer."""
        self._send("mission_ack", int(result), mission_type=kind)

    def cancel(self, kind: int) -> None:
        """End a transfer that failed, so that the vehicle does not wait for more, if it can be reached."""
        with suppress(LinkError):
            self.acknowledge(kind, Result.OPERATION_CANCELLED)

    def _send(self, name: str, *fields: Any, mission_type: int) -> None:
        encode = getattr(self._mav, f"{name}_encode")
        target = self.vehicle.system, self.vehicle.component
        self._mav.send(encode(*target, *fields, mission_type=int(mission_type)))

    def _beat(self) -> None:
        if self.now() - self._heartbeat_at >= HEARTBEAT_S:
            self._heartbeat_at = self.now()
            self._mav.heartbeat_send(GROUND_STATION, INVALID_AUTOPILOT, 0, 0, 0)

    # Receiving

    def next_message(self, until: float, none_expected: bool = False) -> Any | None:
        """The next message of the mission protocol from the vehicle to us, or None if none comes in time.

        Parameters
        ----------
        until : float
            Time of the clock.
        none_expected : bool
            Drop such messages: they are late ones of an earlier transfer.

        Raises
        ------
        LinkError
            If another vehicle or another transfer is noticed, or the connection is lost.
        """
        while True:
            while self._arrived:
                found = self._examine(*self._arrived.popleft())
                if found is not None and not none_expected:
                    return found
            left = until - self.now()
            if left <= 0:
                return None
            self._beat()
            piece = self._transport.receive(min(left, POLL_S))
            if piece is not None:
                self._parse(*piece)

    def _parse(self, data: bytes, source: Source) -> None:
        if self._transport.is_datagram:
            self._parser = _parser()  # no rest of a broken datagram before the next one
        for message in self._parser.parse_buffer(data) or []:
            if message.get_type() in _READ:
                self._heard += 1
                self._arrived.append((message, source))

    def _examine(self, message: Any, source: Source) -> Any | None:
        """The message, if it is one of the transfer; notes what else matters."""
        name, system = message.get_type(), message.get_srcSystem()
        if name == "HEARTBEAT":
            if is_vehicle(message):
                self._hear_vehicle(message, source)
            return None
        if self._vehicle is None:
            return None
        if (system, source) != (self._vehicle.system, self._vehicle.source):
            self._check_other(message, system)
            return None
        if name == "STATUSTEXT":
            self.texts.append(str(message.text).strip())
        elif name == "HOME_POSITION":
            self.home = (message.latitude / 1e7, message.longitude / 1e7, message.altitude / 1e3)
        elif name in _FOR_US:
            if self._is_for_us(message):
                return message
            self._check_other_transfer(message)
        return None

    def _is_for_us(self, message: Any) -> bool:
        return message.target_system == SYSTEM and message.target_component in (self.component, 0)

    def _hear_vehicle(self, heartbeat: Any, source: Source) -> None:
        system, component = heartbeat.get_srcSystem(), heartbeat.get_srcComponent()
        armed = bool(heartbeat.base_mode & ARMED)
        if self._vehicle is None:
            self._vehicle = Vehicle(system, component, heartbeat.autopilot, armed, source)
            self._transport.answer(source)
            return
        known = self._vehicle
        if system != known.system:
            raise LinkError(
                f"two vehicles are on the link, systems {known.system} and {system}; "
                "give an address where only one answers"
            )
        if source != known.source or (
            component == known.component and heartbeat.autopilot != known.mav_autopilot
        ):
            raise LinkError(
                f"two vehicles on the link have the system id {system}; "
                "give an address where only one answers, or another id to one of them"
            )
        if component == known.component:  # a gimbal or a camera of the system says nothing of the motors
            self._vehicle = replace(known, is_armed=armed)

    def _check_other(self, message: Any, system: int) -> None:
        """Another ground station that writes, or another system that answers us."""
        name = message.get_type()
        if name in _WRITES and message.target_system in (self.vehicle.system, 0):
            raise LinkError(_conflict(system))
        if name in _FOR_US and self._is_for_us(message):
            raise LinkError(f"another system ({system}) answers on the link; give an address of one vehicle")

    def _check_other_transfer(self, message: Any) -> None:
        """The vehicle takes a mission from another ground station."""
        name = message.get_type()
        if name in _REQUESTS or (name == "MISSION_ACK" and message.type == Result.ACCEPTED):
            raise LinkError(_conflict(message.target_system))

    def close(self) -> None:
        """Release the port."""
        self._transport.close()

    def __enter__(self) -> "Link":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def connect(address: str, timeout_s: float = TIMEOUT_S) -> Link:
    """Connect to the vehicle at an address and wait for its heartbeat.

    Parameters
    ----------
    address : str
        udpout:HOST:PORT, udpin:HOST:PORT, tcp:HOST:PORT or serial:DEVICE[:BAUD].
    timeout_s : float
        How long to wait for an answer.

    Raises
    ------
    ParameterError
        If the address is none.
    LinkError
        If it cannot be reached, no vehicle answers, or more than one.
    """
    where = parse_address(address)
    link = Link(open_transport(where, timeout_s), timeout_s)
    try:
        link.find_vehicle(where)
    except BaseException:
        link.close()
        raise
    return link


class _Sender:
    """What pymavlink writes to."""

    def __init__(self, transport: Transport) -> None:
        self._transport = transport

    def write(self, data: bytes) -> None:
        self._transport.send(bytes(data))


def _parser() -> Any:
    parser = common.MAVLink(None)
    parser.robust_parsing = True
    return parser


def _conflict(system: int) -> str:
    return (
        f"another ground station (system {system}) transfers a mission to the vehicle at the same time; "
        "end that, and transfer again"
    )
