"""Vehicles behind sockets of the loopback: those of `vehicles`, and MAVSDK's."""

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np
import pytest

from tests.flight.link.vehicles import FakeVehicle

LOOPBACK = "127.0.0.1"
HEARTBEAT_S = 0.1


def free_port(kind: int = socket.SOCK_DGRAM) -> int:
    """A port that nobody has bound."""
    with socket.socket(socket.AF_INET, kind) as free:
        free.bind((LOOPBACK, 0))
        return int(free.getsockname()[1])


def wait_until(holds: Callable[[], bool]) -> None:
    """Wait for what another thread or process does, however busy the machine is."""
    until = time.monotonic() + 60
    while not holds():
        assert time.monotonic() < until, "it never came"
        time.sleep(0.01)


@contextmanager
def running(turn: Any) -> Iterator[None]:
    """Call something again and again in a thread."""
    stopped = threading.Event()

    def run() -> None:
        while not stopped.is_set():
            turn()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        yield
    finally:
        stopped.set()
        thread.join(5)


@contextmanager
def udp_vehicle(vehicle: FakeVehicle, ground: int | None = None) -> Iterator[str]:
    """Address of a vehicle that answers who spoke last, or speaks to a port of the ground first."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as port:
        port.bind((LOOPBACK, 0))
        port.settimeout(0.01)
        vehicle.heartbeat_s = HEARTBEAT_S
        peer: list[Any] = [] if ground is None else [(LOOPBACK, ground)]

        def turn() -> None:
            with suppress(TimeoutError, ConnectionError):
                data, peer[:] = (found := port.recvfrom(65535))[0], found[1:]
                vehicle.handle(data, time.monotonic())
            vehicle.tick(time.monotonic())
            sent, vehicle.outbox = vehicle.outbox, []
            for data in sent:
                if peer:
                    port.sendto(data, peer[0])

        with running(turn):
            number = port.getsockname()[1]
            yield f"udpout:{LOOPBACK}:{number}" if ground is None else f"udpin:{LOOPBACK}:{ground}"


@contextmanager
def tcp_vehicle(vehicle: FakeVehicle, closes_after: int | None = None) -> Iterator[str]:
    """Address of a vehicle behind a TCP port, which it may close after so many messages."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as server:
        server.bind((LOOPBACK, 0))
        server.listen()
        server.settimeout(0.05)
        vehicle.heartbeat_s = HEARTBEAT_S
        open_: list[socket.socket] = []

        def turn() -> None:
            if not open_:
                with suppress(TimeoutError):
                    open_.append(server.accept()[0])
                    open_[0].settimeout(0.01)
                    open_[0].setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                return
            with suppress(TimeoutError, ConnectionError):
                vehicle.handle(open_[0].recv(65535), time.monotonic())
            vehicle.tick(time.monotonic())
            sent, vehicle.outbox = vehicle.outbox, []
            with suppress(ConnectionError):
                # in pieces, as a stream may deliver them
                for data in sent:
                    open_[0].sendall(data[:7])
                    open_[0].sendall(data[7:])
            if closes_after is not None and vehicle.handled >= closes_after:
                open_[0].close()
                open_.clear()
                vehicle.handled = 0

        try:
            with running(turn):
                yield f"tcp:{LOOPBACK}:{server.getsockname()[1]}"
        finally:
            for one in open_:
                one.close()


@contextmanager
def lossy_proxy(port: int, loss: float, duplicates: float, reordered: float, seed: int) -> Iterator[str]:
    """Address of a proxy in front of a UDP port that loses, duplicates and holds back datagrams."""
    random = np.random.default_rng(seed)
    held: list[tuple[float, Any, bytes, Any]] = []
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as near,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as far,
    ):
        near.bind((LOOPBACK, 0))
        far.connect((LOOPBACK, port))
        near.setblocking(False)
        far.setblocking(False)
        ground: list[Any] = []

        def forward(data: bytes, to: socket.socket, where: Any) -> None:
            for _ in range(int(random.random() >= loss) * (1 + int(random.random() < duplicates))):
                late = 0.02 * random.random() if random.random() < reordered else 0.0
                held.append((time.monotonic() + late, to, data, where))

        def turn() -> None:
            with suppress(BlockingIOError, ConnectionError):
                data, source = near.recvfrom(65535)
                ground[:] = [source]
                forward(data, far, None)
            with suppress(BlockingIOError, ConnectionError):
                data = far.recv(65535)
                if ground:
                    forward(data, near, ground[0])
            now = time.monotonic()
            for one in sorted((one for one in held if one[0] <= now), key=lambda one: one[0]):
                held.remove(one)
                _, to, data, where = one
                with suppress(ConnectionError):
                    to.send(data) if where is None else to.sendto(data, where)
            time.sleep(0.0005)

        with running(turn):
            yield f"udpout:{LOOPBACK}:{near.getsockname()[1]}"


@contextmanager
def mavsdk_vehicle(address: str) -> Iterator[list[Any]]:
    """MAVSDK as a vehicle at an address such as udpin://127.0.0.1:14540; the lists that it took in."""
    mavsdk = pytest.importorskip("mavsdk", reason="mavsdk, the independent vehicle, is not installed")
    raw = pytest.importorskip("mavsdk.plugins.mission_raw_server", reason="this mavsdk has no such server")
    mavsdk.log_subscribe(lambda *_: True)
    sdk = mavsdk.Mavsdk(mavsdk.Configuration.create_with_component_type(mavsdk.ComponentType.AUTOPILOT))
    taken: list[Any] = []
    try:
        sdk.add_any_connection(address)
        server = raw.MissionRawServer(sdk.server_component())

        def take(result: Any, plan: Any, *_: Any) -> None:
            if result == raw.MissionRawServerResult.SUCCESS:
                taken.append(plan.mission_items)

        server.subscribe_incoming_mission(take)
        yield taken
    finally:
        sdk.destroy()
