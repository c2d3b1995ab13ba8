"""Survey items (ComplexItem) of .plan files, as QGroundControl reads and writes them.

A survey item holds the items that are flown besides the outline and the camera from which QGroundControl
plans them again after an edit. Its keys are those that QGroundControl requires of version 5.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from uavseg.errors import MissionError
from uavseg.flight.mission.items import (
    CAMERA_DISTANCE,
    FRAME_AMSL,
    FRAME_RELATIVE,
    FRAME_TERRAIN,
    WAYPOINT,
    MissionItem,
)
from uavseg.flight.mission.mission import Mission, Position, SurveyBlock
from uavseg.plain_text import shown

ALTITUDE_MODES = {
    FRAME_RELATIVE: 1,
    FRAME_AMSL: 2,
    FRAME_TERRAIN: 4,
}  # QGroundControl's enum, by MAV_FRAME
SURVEY_VERSION = 5
MANUAL_CAMERA, CUSTOM_CAMERA = "Manual (no camera specs)", "Custom Camera"


@dataclass(frozen=True, slots=True)
class BlockItems:
    """Survey block, and the range of the items of a mission that fly it: `first` to before `stop`."""

    block: SurveyBlock
    first: int
    stop: int


def find_blocks(mission: Mission) -> list[BlockItems]:
    """Find the blocks whose waypoints are all in the mission, one after another, with nothing but triggers.

    Returns
    -------
    list of BlockItems
        In the order of the items, without overlap; of convex cells alone.
    """
    visits = [number for number, item in enumerate(mission.items) if item.command == WAYPOINT]
    at = [(mission.items[number].lat, mission.items[number].lon) for number in visits]
    result = []
    for block in mission.blocks:
        if not block.is_editable:
            continue
        for positions in (block.waypoints, block.waypoints[::-1]):
            begin = _position_of(list(positions), at)
            if begin is not None:
                result += _matching(mission, block, visits[begin], visits[begin + len(positions) - 1])
                break
    result.sort(key=lambda one: one.first)
    return [one for k, one in enumerate(result) if not k or one.first >= result[k - 1].stop]


def _position_of(part: list[Position], whole: list[Position]) -> int | None:
    for begin, position in enumerate(whole[: len(whole) - len(part) + 1]):
        if position == part[0] and whole[begin : begin + len(part)] == part:
            return begin
    return None


def _matching(mission: Mission, block: SurveyBlock, first: int, last: int) -> list[BlockItems]:
    """Return the range of items with the trigger that ends it, if it holds only waypoints and triggers."""
    stop = last + 1
    if stop < len(mission.items) and mission.items[stop].command == CAMERA_DISTANCE:
        stop += 1
    plain = all(
        item.command == CAMERA_DISTANCE or (item.command == WAYPOINT and item.frame == FRAME_RELATIVE)
        for item in mission.items[first:stop]
    )
    return [BlockItems(block, first, stop)] if plain else []


def survey_item(
    block: SurveyBlock, items: Sequence[MissionItem], written: Sequence[dict[str, Any]]
) -> dict[str, Any]:
    """Write a block as a ComplexItem of version 5.

    Parameters
    ----------
    block : SurveyBlock
    items : sequence of MissionItem
        That fly it.
    written : sequence of dict
        The same as SimpleItems.
    """
    flown = [(item.lat, item.lon) for item in items if item.command == WAYPOINT]
    return {
        "type": "ComplexItem",
        "complexItemType": "survey",
        "version": SURVEY_VERSION,
        "angle": _grid_angle(block.angle_deg),
        "entryLocation": _entry_location(block.outline, flown[0]),
        "flyAlternateTransects": False,
        "splitConcavePolygons": False,
        "polygon": [list(position) for position in block.outline],
        "TransectStyleComplexItem": {
            "version": 2,
            "TurnAroundDistance": 0,
            "CameraTriggerInTurnAround": False,
            "HoverAndCapture": False,
            "Refly90Degrees": False,
            "CameraShots": sum(item.command == CAMERA_DISTANCE and bool(item.params[2]) for item in items),
            "VisualTransectPoints": [list(position) for position in flown],
            "Items": list(written),
            "CameraCalc": _camera_calc(block, items),
        },
    }


def _grid_angle(angle_deg: float) -> float:
    """Return an azimuth as QGroundControl's angle of transects, from -90 to 90."""
    return round((angle_deg + 90) % 180 - 90, 6)


def _entry_location(outline: Sequence[Position], entry: Position) -> int:
    """Return the corner at which the lines begin: 0 top left, 1 top right, 2 bottom left, 3 bottom right."""
    lat, lon = (sum(values) / len(outline) for values in zip(*outline, strict=True))
    return 2 * int(entry[0] < lat) + int(entry[1] >= lon)


def _camera_calc(block: SurveyBlock, items: Sequence[MissionItem]) -> dict[str, Any]:
    """Write spacing, trigger distance and camera as QGroundControl's CameraCalc."""
    triggers = [float(item.params[0] or 0) for item in items if item.command == CAMERA_DISTANCE]
    calc = {
        "version": 2,
        "CameraName": MANUAL_CAMERA,
        "DistanceMode": ALTITUDE_MODES[FRAME_RELATIVE],
        "DistanceToSurface": block.height_m,
        "AdjustedFootprintSide": block.spacing_m,
        "AdjustedFootprintFrontal": max(triggers, default=0.0),
    }
    if block.photos is None:
        return calc
    photos, camera = block.photos, block.photos.camera
    return calc | {
        "CameraName": CUSTOM_CAMERA,
        "AdjustedFootprintFrontal": photos.trigger_m(block.height_m),
        "ValueSetIsDistance": True,
        "ImageDensity": 100 * camera.gsd_m(block.height_m),
        "FrontalOverlap": photos.overlap.front,
        "SideOverlap": photos.overlap.side,
        "SensorWidth": camera.sensor_mm[0],
        "SensorHeight": camera.sensor_mm[1],
        "ImageWidth": camera.image_px[0],
        "ImageHeight": camera.image_px[1],
        "FocalLength": camera.focal_mm,
        "Landscape": True,
        "FixedOrientation": False,
        "MinTriggerInterval": camera.min_interval_s,
    }


def items_of_survey(item: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the simple items that a survey item holds, which are what is flown.

    Raises
    ------
    MissionError
        If it is another complex item than a survey of version 5, or holds no items.
    """
    item_type = shown(item.get("complexItemType", item["type"]), quoted=False)
    if item_type != "survey" or item.get("version") != SURVEY_VERSION:
        version = f" of version {shown(item.get('version'))}" if item_type == "survey" else ""
        raise MissionError(
            f"it holds a {item_type} item{version}; only simple items and surveys of version 5 can be read"
        )
    items: list[Mapping[str, Any]] = item["TransectStyleComplexItem"]["Items"]
    if not items:
        raise MissionError("it holds a survey item without waypoints; open and save it in QGroundControl")
    return items
