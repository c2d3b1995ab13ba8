"""MAVLink connection to one vehicle: heartbeats, messages of the mission protocol, other senders noticed."""

import os
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any

from pymavlink.dialects.v20 import common

from uavseg.dataclass import dataclass
from uavseg.errors import LinkError
from uavseg.flight.link.messages import MissionType, Result
from uavseg.flight.link.transport import Source, Transport, open_transport, parse_address
from uavseg.flight.mission.items import AUTOPILOT_NAMES, AUTOPILOTS

TIMEOUT_S = 10.0  # ArduPilot asks again after 1 s and gives up after 8 s; PX4 after 0.25 and 5 s
HEARTBEAT_S = 1.0
LISTEN_S = 1.2  # for a second vehicle, after the heartbeat of the first
POLL_S = 0.2
SYSTEM = 255  # of ground stations
FIRST_COMPONENT, COMPONENTS = 25, 75  # MAV_COMP_ID_USER1 to 75: two processes seldom have the same

_REQUESTS = frozenset({"MISSION_REQUEST", "MISSION_REQUEST_INT"})
_FOR_US = frozenset({*_REQUESTS, "MISSION_ACK", "MISSION_COUNT", "MISSION_ITEM_INT"})
_WRITES = frozenset(
    f"MISSION_{it}" for it in ("COUNT", "ITEM", "ITEM_INT", "CLEAR_ALL", "WRITE_PARTIAL_LIST")
)
_READ = _FOR_US | _WRITES | {"HEARTBEAT", "STATUSTEXT", "HOME_POSITION"}

INITIAL_TIMEOUT_S, MIN_TIMEOUT_S, MAX_TIMEOUT_S = 0.5, 0.1, 1.5  # before a message is repeated
QUICK_REPEATS = 4
_ROUND_TRIPS = 3.0
_SMOOTHING = 0.2

INVALID_AUTOPILOT = 8  # MAV_AUTOPILOT of what is not a vehicle
ARMED = 128  # MAV_MODE_FLAG_SAFETY_ARMED
# MAV_TYPE of what has a heartbeat but flies no mission
TRACKER, GROUND_STATION, COMPANION, GIMBAL, ADSB, CAMERA = 5, 6, 18, 26, 27, 30
NOT_VEHICLES = frozenset({TRACKER, GROUND_STATION, COMPANION, GIMBAL, ADSB, CAMERA})


@dataclass(frozen=True, slots=True)
class LinkedVehicle:
    """Vehicle at the other end of a link."""

    system: int  # MAVLink ids
    component: int
    mav_autopilot: int  # MAV_AUTOPILOT
    is_armed: bool = False  # whether its motors are armed, by its last heartbeat
    source: Source = None  # where its messages come from

    @property
    def autopilot(self) -> str:
        """Name of the autopilot: "ardupilot", "px4", or "generic" for any other."""
        return next((name for name, number in AUTOPILOTS.items() if number == self.mav_autopilot), "generic")

    @property
    def has_home_row(self) -> bool:
        """True if its missions begin with home as item 0."""
        return self.autopilot == "ardupilot"

    def __str__(self) -> str:
        name = AUTOPILOT_NAMES.get(self.autopilot, f"autopilot {self.mav_autopilot}")
        return f"{name}, system {self.system}"


class RetransmissionTimer:
    """Timeout that follows the round trips of a link, and doubles after the fourth repetition.

    The first repetitions are quick, because a vehicle may give up after few (MAVSDK after five, or 2.5 s). A
    fixed time does not fit all links: 250 ms repeat a third of all messages over a telemetry radio, and are
    long over a network. Round trips of repeated messages are not measured, because the answer may be to any
    of them (Karn and Partridge, 1987, "Improving Round-Trip Time Estimates in Reliable Transport Protocols").

    Examples
    --------
    >>> timer = RetransmissionTimer()
    >>> timer.timeout_s
    0.5
    >>> timer.answered(0.06)
    >>> round(timer.timeout_s, 3)
    0.18
    >>> for _ in range(6):
    ...     timer.repeated()
    >>> round(timer.timeout_s, 3)
    0.72
    """

    def __init__(self) -> None:
        self._round_trip_s: float | None = None
        self._repeats = 0

    @property
    def timeout_s(self) -> float:
        """Seconds to wait for an answer."""
        first = INITIAL_TIMEOUT_S if self._round_trip_s is None else _ROUND_TRIPS * self._round_trip_s
        doublings = min(max(self._repeats - QUICK_REPEATS, 0), 10)
        return float(min(max(first, MIN_TIMEOUT_S) * 2**doublings, MAX_TIMEOUT_S))

    def repeated(self) -> None:
        """Count a repetition."""
        self._repeats += 1

    def answered(self, seconds: float) -> None:
        """Measure a round trip; `seconds` since the message was sent last."""
        if not self._repeats:
            mean = self._round_trip_s
            self._round_trip_s = seconds if mean is None else mean + _SMOOTHING * (seconds - mean)
        self._repeats = 0


class Link:
    """Connection to one vehicle.

    It sends heartbeats of a ground station and messages of the mission protocol, nothing else: no command can
    arm, start or move the vehicle. `timeout_s` is how long to wait without progress, `now` the seconds of a
    clock that only goes forward.
    """

    def __init__(
        self, transport: Transport, timeout_s: float = TIMEOUT_S, now: Callable[[], float] = time.monotonic
    ) -> None:
        self.timeout_s, self.now = timeout_s, now
        self.timer = RetransmissionTimer()
        self.texts: list[str] = []  # STATUSTEXT of the vehicle
        self.home: tuple[float, float, float] | None = None  # lat, lon, metres above the sea
        self.component = FIRST_COMPONENT + os.getpid() % COMPONENTS
        self._transport = transport
        self._mav = common.MAVLink(_Writer(transport), SYSTEM, self.component)
        self._parser = _parser()
        self._vehicle: LinkedVehicle | None = None
        self._arrived: deque[tuple[Any, Source]] = deque()
        self._heartbeat_at = -HEARTBEAT_S + now()
        self._heard = 0

    @property
    def vehicle(self) -> LinkedVehicle:
        """Vehicle whose heartbeat `find_vehicle` heard."""
        assert self._vehicle is not None, "find_vehicle comes first"
        return self._vehicle

    def find_vehicle(self, address: object) -> None:
        """Wait for the heartbeat of an autopilot; LinkError without one in time, or with a second one."""
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

    def send(self, message: str, list_type: MissionType, *fields: Any) -> None:
        """Send a message, such as "mission_count", with its fields after the target."""
        encode = getattr(self._mav, f"{message}_encode")
        target = self.vehicle.system, self.vehicle.component
        self._mav.send(encode(*target, *fields, mission_type=int(list_type)))

    def acknowledge(self, list_type: MissionType, result: Result) -> None:
        """Send MISSION_ACK: end a transfer."""
        self.send("mission_ack", list_type, int(result))

    def cancel(self, list_type: MissionType) -> None:
        """End a transfer that failed, so that the vehicle does not wait for more, if it can be reached."""
        with suppress(LinkError):
            self.acknowledge(list_type, Result.OPERATION_CANCELLED)

    def next_message(self, until: float, none_expected: bool = False) -> Any | None:
        """Return the next message of the mission protocol from the vehicle to us; None if none comes in time.

        `until` is a time of the clock. With `none_expected` such messages are dropped: they are late ones of
        an earlier transfer. A LinkError says that another vehicle or another transfer is noticed, or that the
        connection is lost.
        """
        while True:
            while self._arrived:
                message = self._examine(*self._arrived.popleft())
                if message is not None and not none_expected:
                    return message
            left = until - self.now()
            if left <= 0:
                return None
            if self.now() - self._heartbeat_at >= HEARTBEAT_S:
                self._heartbeat_at = self.now()
                self._mav.heartbeat_send(GROUND_STATION, INVALID_AUTOPILOT, 0, 0, 0)
            piece = self._transport.receive(min(left, POLL_S))
            if piece is None:
                continue
            if self._transport.is_datagram:
                self._parser = _parser()  # a broken datagram leaves no rest before the next one
            read = [one for one in self._parser.parse_buffer(piece[0]) or [] if one.get_type() in _READ]
            self._heard += len(read)
            self._arrived.extend((one, piece[1]) for one in read)

    def _examine(self, message: Any, source: Source) -> Any | None:
        """Return a message of the transfer, else None; take note of what else matters."""
        name, system = message.get_type(), message.get_srcSystem()
        if name == "HEARTBEAT":
            if message.autopilot != INVALID_AUTOPILOT and message.type not in NOT_VEHICLES:
                self._hear_vehicle(message, source)
            return None
        if self._vehicle is None:
            return None
        if (system, source) != (self._vehicle.system, self._vehicle.source):
            if name in _WRITES and message.target_system in (self.vehicle.system, 0):
                raise LinkError(_conflict(system))
            if name in _FOR_US and self._is_for_us(message):
                raise LinkError(
                    f"another system ({system}) answers on the link; give an address of one vehicle"
                )
            return None
        if name == "STATUSTEXT":
            self.texts.append(str(message.text).strip())
        elif name == "HOME_POSITION":
            self.home = (message.latitude / 1e7, message.longitude / 1e7, message.altitude / 1e3)
        elif name in _FOR_US:
            if self._is_for_us(message):
                return message
            if name in _REQUESTS or (name == "MISSION_ACK" and message.type == Result.ACCEPTED):
                raise LinkError(_conflict(message.target_system))  # which sends the vehicle a mission
        return None

    def _is_for_us(self, message: Any) -> bool:
        return message.target_system == SYSTEM and message.target_component in (self.component, 0)

    def _hear_vehicle(self, heartbeat: Any, source: Source) -> None:
        system, component = heartbeat.get_srcSystem(), heartbeat.get_srcComponent()
        armed = bool(heartbeat.base_mode & ARMED)
        if self._vehicle is None:
            heard = LinkedVehicle(system=system, component=component, mav_autopilot=heartbeat.autopilot)
            self._vehicle = replace(heard, is_armed=armed, source=source)
            self._transport.answer(source)
            return
        current = self._vehicle
        if system != current.system:
            raise LinkError(
                f"two vehicles are on the link, systems {current.system} and {system}; "
                "give an address where only one answers"
            )
        if source != current.source or (
            component == current.component and heartbeat.autopilot != current.mav_autopilot
        ):
            raise LinkError(
                f"two vehicles on the link have the system id {system}; "
                "give an address where only one answers, or another id to one of them"
            )
        if component == current.component:  # a gimbal or a camera of the system says nothing of the motors
            self._vehicle = replace(current, is_armed=armed)

    def close(self) -> None:
        """Release the port."""
        self._transport.close()

    def __enter__(self) -> "Link":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def connect(address: str, timeout_s: float = TIMEOUT_S) -> Link:
    """Connect to the vehicle at an address and wait for its heartbeat.

    `address` is udpout:HOST:PORT, udpin:HOST:PORT, tcp:HOST:PORT or serial:DEVICE[:BAUD], else a
    ParameterError; `timeout_s` is how long to wait for an answer. A LinkError says that it cannot be reached,
    or that no vehicle answers, or more than one.
    """
    where = parse_address(address)
    link = Link(open_transport(where, timeout_s), timeout_s)
    try:
        link.find_vehicle(where)
    except BaseException:
        link.close()
        raise
    return link


class _Writer:
    """File to which pymavlink writes."""

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
