"""MAVSDK as an independent reader of missions, connected by the heartbeat of a simulated vehicle."""

import socket
import time
from collections.abc import Iterator
from typing import Any

import pytest

GENERIC = 0  # MAV_AUTOPILOT: one for which MAVSDK adds no home of its own
TRIES = 50


@pytest.fixture(scope="session")
def mavsdk_reader() -> Iterator[Any]:
    """MAVSDK's `MissionRaw`, connected on the loopback to heartbeats of a generic vehicle."""
    mavsdk = pytest.importorskip("mavsdk", reason="mavsdk, the independent reader, is not installed")
    raw = pytest.importorskip("mavsdk.plugins.mission_raw", reason="this mavsdk has no mission_raw")
    from pymavlink import mavutil

    mavsdk.log_subscribe(lambda *_: True)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    sdk = mavsdk.Mavsdk(mavsdk.Configuration.create_with_component_type(mavsdk.ComponentType.GROUND_STATION))
    sdk.add_any_connection(f"udpin://127.0.0.1:{port}")
    link = mavutil.mavlink_connection(f"udpout:127.0.0.1:{port}", source_system=1, source_component=1)
    try:
        system = None
        for _ in range(TRIES):
            link.mav.heartbeat_send(mavutil.mavlink.MAV_TYPE_QUADROTOR, GENERIC, 0, 0, 4)
            time.sleep(0.02)
            system = sdk.first_autopilot(0.1)
            if system is not None:
                break
        if system is None:
            pytest.skip("MAVSDK heard no heartbeat on the loopback")
        yield raw.MissionRaw(system)
    finally:
        link.close()
        sdk.destroy()
