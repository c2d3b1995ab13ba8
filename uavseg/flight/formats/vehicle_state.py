"""Items as ArduPilot reads them: altitude 0 is the height that the vehicle has, position 0, 0 where it is.

As `Mode::loc_from_cmd` of ArduCopter does (ArduCopter/mode_auto.cpp); frames as `AP_Mission` stores them.
"""

from collections.abc import Iterator
from dataclasses import field
from typing import Any

from uavseg.dataclass import dataclass
from uavseg.errors import MissionError
from uavseg.flight.mission.items import (
    FRAME_AMSL,
    FRAME_MISSION,
    FRAME_RELATIVE,
    FRAME_TERRAIN,
    LANDINGS,
    LAST_NAV,
    LOITER_TO_ALTITUDE,
    POSITION_COMMANDS,
    RETURN,
    TAKEOFFS,
    HomePosition,
    MissionItem,
)

HOME_UNKNOWN = (
    "the file does not hold home: the position of the first waypoint is taken, at 0 m above the sea"
)
# Frames of integer coordinates are those of floats; without a frame, heights are above the sea.
_FRAMES = {FRAME_MISSION: FRAME_AMSL, 5: FRAME_AMSL, 6: FRAME_RELATIVE, 11: FRAME_TERRAIN}


@dataclass(slots=True)
class VehicleState:
    """Position and height of a vehicle with ArduPilot at each item of a mission that is read in order."""

    home: HomePosition
    lat: float = field(init=False)
    lon: float = field(init=False)
    height: tuple[int, float] | None = None  # frame and metres; None while no item has said them
    kept: list[str] = field(default_factory=list)  # which items keep which height
    here: list[str] = field(default_factory=list)  # which items are where the vehicle is

    def __post_init__(self) -> None:
        self.lat, self.lon = self.home.lat, self.home.lon

    def item(self, number: int, **given: Any) -> MissionItem:
        """Return the item with this number, of which fields of `MissionItem` are given.

        A MissionError says that it has no height of its own, and no item before it has one.
        """
        command, landing = given["command"], given["command"] in LANDINGS
        at_vehicle = given["lat"] == 0 and given["lon"] == 0
        if command == RETURN:
            self.lat, self.lon = self.home.lat, self.home.lon
        elif not at_vehicle and command <= LAST_NAV and command not in TAKEOFFS:  # these climb straight up
            self.lat, self.lon = given["lat"], given["lon"]
        if command not in POSITION_COMMANDS:
            return MissionItem(**given)
        given["frame"] = _FRAMES.get(given["frame"], given["frame"])
        if at_vehicle and not landing and command not in TAKEOFFS:
            given |= {"lat": self.lat, "lon": self.lon}
            self.here.append(str(number))
        if given["altitude_m"] == 0 and landing:
            given["frame"] = given["frame"] if given["frame"] != FRAME_AMSL else FRAME_RELATIVE
        elif given["altitude_m"] == 0 and command not in {*TAKEOFFS, LOITER_TO_ALTITUDE}:
            if self.height is None:
                raise MissionError(
                    "altitude 0 means the height that the vehicle has, which no item before it says; give "
                    "it a height, or a takeoff before it"
                )
            given["frame"], given["altitude_m"] = self.height
            self.kept.append(f"{number} ({self.height[1]:g} m)")
        item = MissionItem(**given)
        if not landing:
            self.height = item.frame, item.altitude_m
        return item

    def notes(self) -> Iterator[str]:
        """Yield what was taken from the state of the vehicle."""
        for numbers, what in (
            (self.kept, "altitude 0, which ArduPilot reads as the height that the vehicle has"),
            (self.here, "position 0,0, which ArduPilot reads as where the vehicle is"),
        ):
            if numbers:
                more = f" and {len(numbers) - 5} more" if len(numbers) > 5 else ""
                items = "items" if len(numbers) > 1 else "item"
                yield f"{items} {', '.join(numbers[:5])}{more}: {what}; it is written out"
