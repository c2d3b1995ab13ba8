"""Uploads and downloads over UDP and TCP on the loopback: MAVSDK's vehicle, and errors of connections."""

import math
import signal
import socket
import threading
import time
from collections.abc import Sequence
from contextlib import nullcontext
from typing import Any

import pytest

from tests.flight.link.link_missions import fenced, survey
from tests.flight.link.served import (
    LOOPBACK,
    free_port,
    lossy_proxy,
    mavsdk_vehicle,
    running,
    tcp_vehicle,
    udp_vehicle,
    wait_until,
)
from tests.flight.link.vehicles import ArduPilot, Generic, Px4
from uavseg.errors import LinkError
from uavseg.flight.link import link
from uavseg.flight.link.messages import LinkItem, items_of_fence, items_of_mission, items_of_rally
from uavseg.flight.mission.mission import Mission
from uavseg.jobs.flights.link import download, upload

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Do not wait for a second vehicle, which test_transfers.py has in virtual time."""
    monkeypatch.setattr(link, "LISTEN_S", 0.05)


def as_link_items(taken: Sequence[Any]) -> list[LinkItem]:
    """MAVSDK's items as ours."""
    found = []
    for number, one in enumerate(taken):
        params = tuple(None if math.isnan(p) else p for p in (one.param1, one.param2, one.param3, one.param4))
        assert (one.seq, one.autocontinue) == (number, 1)
        assert one.current == int(number == 0 and one.mission_type == 0)
        found.append(LinkItem(one.command, one.frame, params, one.x, one.y, one.z))  # type: ignore[arg-type]
    return found


def assert_alike(found: Sequence[LinkItem], expected: Sequence[LinkItem]) -> None:
    assert len(found) == len(expected)
    for one, other in zip(found, expected, strict=True):
        assert (one.command, one.frame, one.x, one.y) == (other.command, other.frame, other.x, other.y)
        assert one.z == pytest.approx(other.z, rel=1e-6)
        for value, known in zip(one.params, other.params, strict=True):
            assert (value is None) == (known is None) and (value or 0.0) == pytest.approx(
                known or 0.0, rel=1e-6
            )


def sent_and_read(mission: Mission, address: str, taken: list[Any]) -> None:
    """Upload, compare what MAVSDK took in, download, compare with the mission."""
    done = upload(mission, address)
    assert done.vehicle == "autopilot 0, system 1"
    assert done.warnings == mission.warnings
    lists = [items_of_fence(mission.fence), items_of_rally(mission.rally), items_of_mission(mission, False)]
    lists = [items for items in lists if items]
    wait_until(lambda: len(taken) >= len(lists))  # MAVSDK tells of a list after it has acknowledged it
    for items in lists:
        assert_alike(as_link_items(next(one for one in taken if len(one) == len(items))), items)
    found = download(address).mission
    assert found.fence == mission.fence and found.rally == mission.rally
    assert_alike(items_of_mission(found, False), items_of_mission(mission, False))


def test_mavsdk_takes_a_mission_and_a_fence_over_udp() -> None:
    port = free_port()
    with mavsdk_vehicle(f"udpin://{LOOPBACK}:{port}") as taken:
        sent_and_read(fenced(survey(30, "px4")), f"udpout:{LOOPBACK}:{port}", taken)


def test_mavsdk_takes_a_mission_and_a_fence_over_tcp() -> None:
    port = free_port(socket.SOCK_STREAM)
    with mavsdk_vehicle(f"tcpin://{LOOPBACK}:{port}") as taken:
        sent_and_read(fenced(survey(30)), f"tcp:{LOOPBACK}:{port}", taken)


@pytest.mark.parametrize(
    ("loss", "count"),
    [(0.0, 500), pytest.param(0.05, 200, marks=pytest.mark.thorough), (0.2, 40)],
)
def test_mavsdk_takes_all_items_whatever_is_lost(loss: float, count: int) -> None:
    port = free_port()
    with (
        mavsdk_vehicle(f"udpin://{LOOPBACK}:{port}") as taken,
        lossy_proxy(port, loss, loss, loss, seed=5) as address,
    ):
        mission = survey(count)
        upload(mission, address, 60.0)  # which reads back
        wait_until(lambda: bool(taken))
        assert_alike(as_link_items(taken[-1]), items_of_mission(mission, False))


def test_mavsdk_takes_500_items_over_tcp() -> None:
    port = free_port(socket.SOCK_STREAM)
    with mavsdk_vehicle(f"tcpin://{LOOPBACK}:{port}") as taken:
        sent_and_read(survey(500), f"tcp:{LOOPBACK}:{port}", taken)


@pytest.mark.parametrize("kind", ["udpout", "udpin", "tcp"])
def test_every_kind_of_address_reaches_a_vehicle(kind: str) -> None:
    vehicle, mission = ArduPilot(), fenced(survey())
    ground = free_port() if kind == "udpin" else None
    with tcp_vehicle(vehicle) if kind == "tcp" else udp_vehicle(vehicle, ground) as address:
        assert address.startswith(kind)
        done = upload(mission, address)
        assert done.vehicle == "ArduPilot, system 1"
    assert [len(vehicle.stored[n]) for n in range(3)] == [13, 8, 2]


# Connections that fail


def test_an_address_where_nothing_listens_says_so() -> None:
    with pytest.raises(LinkError, match=r"answers at udpout:.* within 0\.5 s \(connection refused\)"):
        download(f"udpout:{LOOPBACK}:{free_port()}", 0.5)
    with pytest.raises(LinkError, match=r"cannot open tcp:.*: connection refused"):
        download(f"tcp:{LOOPBACK}:{free_port(socket.SOCK_STREAM)}", 0.5)
    with pytest.raises(LinkError, match=r"no vehicle answers at udpin:.*: nothing arrives"):
        download(f"udpin:{LOOPBACK}:{free_port()}", 0.5)


def test_a_port_that_is_taken_says_so() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind((LOOPBACK, 0))
        with pytest.raises(LinkError, match=r"cannot open udpin:.*: address already in use"):
            download(f"udpin:{LOOPBACK}:{taken.getsockname()[1]}", 0.5)


def test_a_host_that_is_not_known_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*how: Any, **words: Any) -> Any:
        raise socket.gaierror(-2, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", fail)
    with pytest.raises(LinkError, match=r"the host 'drone\.invalid' is not known"):
        download("udpout:drone.invalid:14550", 0.5)


def test_a_resolver_that_hangs_does_not_hold_up(monkeypatch: pytest.MonkeyPatch) -> None:
    waiting = threading.Event()
    monkeypatch.setattr(socket, "getaddrinfo", lambda *how, **words: [][: waiting.wait(20)])
    with pytest.raises(LinkError, match=r"'slow\.invalid' is not known \(no answer within 0\.2 s\)"):
        download("tcp:slow.invalid:5760", 0.2)
    waiting.set()


def test_a_host_that_takes_a_connection_and_says_nothing_is_no_vehicle() -> None:
    with socket.socket() as server:
        server.bind((LOOPBACK, 0))
        server.listen()
        with pytest.raises(LinkError, match="nothing arrives"):
            download(f"tcp:{LOOPBACK}:{server.getsockname()[1]}", 0.5)


@pytest.mark.parametrize(
    "content", [b"HTTP/1.1 400 Bad Request\r\n\r\n", bytes(range(256)) * 40, b"\xfd" * 999]
)
def test_what_is_not_mavlink_is_no_vehicle(content: bytes) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as server:
        server.bind((LOOPBACK, 0))
        server.settimeout(0.05)

        def turn() -> None:
            try:
                server.sendto(content, server.recvfrom(999)[1])
            except TimeoutError:
                return

        with running(turn), pytest.raises(LinkError, match="no vehicle answers"):
            download(f"udpout:{LOOPBACK}:{server.getsockname()[1]}", 0.5)


def test_a_connection_that_closes_during_an_upload_says_so() -> None:
    with (
        tcp_vehicle(Px4(), closes_after=5) as address,
        pytest.raises(LinkError, match=r"the connection to tcp:.* (was closed by the other side|is lost)"),
    ):
        upload(survey(100, "px4"), address)


def test_a_serial_device_that_is_not_there_says_so() -> None:
    with pytest.raises(LinkError, match=r"cannot open serial:/dev/none:57600|serial lines need pyserial"):
        download("serial:/dev/none", 0.5)


def test_a_vehicle_on_a_serial_line_is_reached() -> None:
    pytest.importorskip("serial", reason="pyserial is not installed")
    os = pytest.importorskip("os")
    pty, tty = pytest.importorskip("pty"), pytest.importorskip("tty")
    controller, device = pty.openpty()
    tty.setraw(device)
    os.set_blocking(controller, False)
    vehicle = ArduPilot()

    def turn() -> None:
        try:
            vehicle.handle(os.read(controller, 65535), time.monotonic())
        except BlockingIOError:
            time.sleep(0.002)
        vehicle.tick(time.monotonic())
        sent, vehicle.outbox = vehicle.outbox, []
        for data in sent:
            os.write(controller, data)

    with running(turn):
        upload(survey(40), f"serial:{os.ttyname(device)}:57600")
    os.close(controller)
    os.close(device)
    assert len(vehicle.stored[0]) == 41


@pytest.mark.parametrize("when", [0.2, 0.6])
def test_an_interruption_ends_a_wait(when: float) -> None:
    vehicle = Generic()
    vehicle.silent_after = 3

    def press() -> None:
        time.sleep(when)
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)

    with udp_vehicle(vehicle) if when > 0.5 else nullcontext(f"udpin:{LOOPBACK}:{free_port()}") as address:
        presser = threading.Thread(target=press, daemon=True)
        with pytest.raises(KeyboardInterrupt):
            presser.start()
            upload(survey(), address, 600.0)
        presser.join()
