"""Uploads to fake vehicles, as several files of tests begin with them."""

from typing import Any

from tests.flight.link.network import GROUND, Network, linked, messages
from tests.flight.link.vehicles import (
    ArduPilot,
    FakeVehicle,
    Generic,
    Px4,
)
from uavseg.flight.link.missions import upload_mission
from uavseg.flight.mission.mission import Mission

VEHICLES: list[type[FakeVehicle]] = [ArduPilot, Px4, Generic]
AUTOPILOTS = {ArduPilot: "ardupilot", Px4: "px4", Generic: "px4"}
LOSSES = [
    {"loss": 0.0},
    {"loss": 0.05, "duplicates": 0.05, "reordered": 0.05},
    {"loss": 0.2, "duplicates": 0.2, "reordered": 0.2},
]


def sent_to(make: type[FakeVehicle], mission: Mission, **how: Any) -> tuple[FakeVehicle, tuple[str, ...]]:
    """A vehicle after an upload, and the warnings."""
    vehicle = make()
    return vehicle, upload_mission(linked(Network([vehicle], **how)), mission)


def rows(vehicle: FakeVehicle, kind: int = 0) -> list[tuple[int, int, int, float]]:
    return [(item.command, item.x, item.y, item.z) for item in vehicle.stored[kind]]


def during_upload(network: Network, act: Any, after: int = 4) -> None:
    """Call something when the link has sent so many items."""
    seen = [0]

    def count(to: str, data: bytes) -> bool:
        seen[0] += to != GROUND and any(one.get_type() == "MISSION_ITEM_INT" for one in messages(data))
        if seen[0] == after:
            seen[0] += 1000
            act()
        return True

    network.before_delivery = count
