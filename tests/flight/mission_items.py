"""Items of small missions."""

from typing import Any

from uavseg.flight.mission.items import (
    FRAME_RELATIVE,
    WAYPOINT,
    MissionItem,
)


def waypoint(lat: float = 47.001, lon: float = 8.0, altitude_m: float = 50.0, **changes: Any) -> MissionItem:
    return MissionItem(
        **{"command": WAYPOINT, "frame": FRAME_RELATIVE, "lat": lat, "lon": lon, "altitude_m": altitude_m}
        | changes
    )
