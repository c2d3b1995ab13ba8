"""A network in virtual time between a link and vehicles, which loses, duplicates and reorders datagrams."""

import heapq
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import common

from tests.flight.link.vehicles import FakeVehicle
from uavseg.flight.link.link import Link

STEP_S = 0.01
GROUND = "ground"


class Network:
    """Transport of a link; `now` is its clock, which `receive` moves on.

    Parameters
    ----------
    vehicles : sequence of FakeVehicle
    loss, duplicates, reordered : float
        Probabilities of each datagram, in each direction.
    latency_s : float
    seed : int
    """

    is_datagram = True
    trouble = ""

    def __init__(
        self,
        vehicles: Sequence[FakeVehicle],
        loss: float = 0.0,
        duplicates: float = 0.0,
        reordered: float = 0.0,
        latency_s: float = 0.01,
        seed: int = 0,
    ) -> None:
        self.vehicles = list(vehicles)
        self.loss, self.duplicates, self.reordered, self.latency_s = loss, duplicates, reordered, latency_s
        self.time = max((vehicle.now for vehicle in vehicles), default=0.0) + 10 * bool(vehicles)
        self.closed = False
        self.before_delivery: Callable[[str, bytes], bool] = lambda to, data: True  # False drops it
        self._random = np.random.default_rng(seed)
        self._flying: list[tuple[float, int, Any, bytes, Any]] = []
        self._count = 0
        self._ticked_at = -1.0

    def now(self) -> float:
        return self.time

    def send(self, data: bytes) -> None:
        self.post("vehicles", data, GROUND)

    def post(self, to: str, data: bytes, source: Any) -> None:
        """Put a datagram on its way, if it is not lost."""
        copies = int(self._random.random() >= self.loss) * (1 + int(self._random.random() < self.duplicates))
        for _ in range(copies):
            late = float(self._random.random() * 10 * self.latency_s)
            delay = self.latency_s + (late if self._random.random() < self.reordered else 0.0)
            self._count += 1
            heapq.heappush(self._flying, (self.time + delay, self._count, to, data, source))

    def receive(self, timeout_s: float) -> tuple[bytes, Any] | None:
        until = self.time + timeout_s
        while True:
            self._tick()
            if self._flying and self._flying[0][0] <= self.time:
                _, _, to, data, source = heapq.heappop(self._flying)
                if not self.before_delivery(to, data):
                    continue
                if to == GROUND:
                    return data, source
                for vehicle in self.vehicles:
                    vehicle.handle(data, self.time)
                self._collect()
                continue
            following = min(
                self._ticked_at + STEP_S, until, *(self._flying[0][:1] if self._flying else (until,))
            )
            if self.time >= until:
                return None
            self.time = max(following, self.time + 1e-9)

    def _tick(self) -> None:
        if self.time - self._ticked_at >= STEP_S:
            self._ticked_at = self.time
            for vehicle in self.vehicles:
                vehicle.tick(self.time)
            self._collect()

    def _collect(self) -> None:
        for vehicle in self.vehicles:
            sent, vehicle.outbox = vehicle.outbox, []
            for data in sent:
                self.post(GROUND, data, "vehicles")

    def answer(self, source: Any) -> None:
        pass

    def close(self) -> None:
        self.closed = True


def linked(network: Network, timeout_s: float = 10.0) -> Link:
    """A link through a network to its vehicle."""
    link = Link(network, timeout_s, network.now)
    link.find_vehicle("a network")
    return link


def messages(data: bytes) -> list[Any]:
    """The messages of a datagram."""
    return common.MAVLink(None).parse_buffer(data) or []


class GroundStation:
    """Another ground station, which sends what it is told."""

    def __init__(self, network: Network, system: int = 254, component: int = 190) -> None:
        self._network = network
        self.mav = common.MAVLink(self, system, component)
        self.is_seen = True  # by the link, as through a router

    def write(self, data: bytes) -> None:
        self._network.post("vehicles", bytes(data), "station")
        if self.is_seen:
            self._network.post(GROUND, bytes(data), "station")
