"""Rest of a mission that was cut: from home to its last photograph, then on as it was planned."""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import replace
from typing import NoReturn

import numpy as np
import shapely

from uavseg.errors import MissionError
from uavseg.flight.avoid.free_space import FreeSpace
from uavseg.flight.mission import items as mav
from uavseg.flight.mission.estimate import FlownPath, flown_path
from uavseg.flight.mission.items import MissionItem
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.track import Plane
from uavseg.flight.planning.split import MIN_LEG_M
from uavseg.flight.safety.check import area_of, fence_problems

CERTAIN_M = 10.0  # so far past a photograph, on a leg without any, it was taken; nearer, it is taken again
DETOUR_M = 3.0  # from the fence, on a way round: a corner is cut by less
_SAME_M = 0.01  # of heights, and of places along the flight
_LOGGED_M = 1.0  # from where a photograph was planned to where it was taken
_SLACK = 1e-6  # of a leg

# Commands whose setting lasts until they, or others for the same, set it again. Numbered ones set one of
# several; early ones are done after takeoff, as by plan, the others where the flight goes on.
_SAME = {1000: mav.MOUNT_CONTROL, mav.ROI_NONE: mav.ROI_LOCATION, 201: mav.ROI_LOCATION, 2501: 2500}
_TRIGGERS = (mav.CAMERA_DISTANCE, mav.CAMERA_INTERVAL, mav.IMAGE_START, mav.IMAGE_STOP)
_SAME |= dict.fromkeys(_TRIGGERS, mav.CAMERA_DISTANCE)
_NUMBERED = frozenset({181, 183, 211})  # relay, servo, gripper
_EARLY = frozenset({204, mav.MOUNT_CONTROL, mav.ROI_LOCATION, 530, 531, 532})  # with mode, zoom, focus
_YAW, _ONCE = 115, frozenset({93, 189, 203, 600})  # a wait, marks and a photograph: nothing of them lasts
_LASTING = frozenset({*_NUMBERED, *_EARLY, _YAW, mav.CHANGE_SPEED, mav.CAMERA_DISTANCE, 2500})


def path_of(mission: Mission) -> FlownPath:
    """Return the legs of a mission that can be resumed; MissionError if it cannot be, with the reason."""
    ended = flown = False
    for number, item in enumerate(mission.items, start=1):
        if item.command in mav.ELSEWHERE or (item.command < mav.LAST_NAV and item.command not in mav.KNOWN):
            _refuse(number, item, "cannot be resumed: where the vehicle flies there is not known here")
        if (item.command in mav.TAKEOFFS and flown) or (item.has_position and ended):
            _refuse(
                number, item, "cannot be resumed: it takes off once more, or flies on after a return or wait"
            )
        flown |= item.has_position
        ended |= item.command in {mav.RETURN, mav.LOITER, *mav.LANDINGS}
    return flown_path(replace(mission, ground=None))


def _refuse(number: int, item: MissionItem, why: str) -> NoReturn:
    raise MissionError(
        f"item {number} (command {item.command}) {why}; edit the mission in its ground station"
    )


def stops_of(mission: Mission) -> list[int]:
    """Return the index of the item at the end of each leg; a return has none."""
    return [k for k, item in enumerate(mission.items) if item.has_position]


def item_number(mission: Mission, index: int) -> int:
    """Return the number of an item as the vehicle counts it: of ArduPilot, home is item 0."""
    return index + (mission.autopilot != "px4")


def rest_of(mission: Mission, path: FlownPath, cut: float, is_photo: bool) -> tuple[Mission, list[str]]:
    """Return what is left of a mission after a cut, with notes; all of it before the first waypoint.

    The cut is the number of a leg and the share of it that was flown, such as 3.4; the last photograph was
    taken there, or else is that of the estimate. A MissionError says that nothing is left, that what was set
    before cannot be set again, or that there is no way to the last photograph within the fence.
    """
    items, stops = mission.items, stops_of(mission)
    shots = sorted(
        run.leg + min(max(run.first + k * run.step, 0.0), 1.0) for run in path.shots for k in range(run.count)
    )
    taken = bisect_right(shots, cut + _SLACK)
    slack_m = _photo_step_m(path, int(cut)) / 2 + _LOGGED_M if is_photo else _SAME_M
    was_last = shots and _point(path, shots[-1])[3] <= _point(path, cut)[3] + slack_m
    if was_last or cut >= len(stops) or items[stops[int(cut)]].command in mav.LANDINGS:
        raise MissionError("nothing is left of the mission: it was flown to its end, or all was photographed")
    place = _last_photograph(path, cut, shots[:taken]) if shots and not is_photo else cut
    leg = math.ceil(place) - 1
    if leg < 1 or items[stops[leg - 1]].command in mav.TAKEOFFS:
        return mission, ["the flight was cut before it passed its first waypoint: the rest is all of it"]
    if (leg + 1 - place) * path.length_m[leg] < MIN_LEG_M:
        place = leg + 1.0
    rest = _rest(mission, path, cut, place)
    x, y, *_ = _point(path, place)
    lon, lat = map(float, Plane(mission.home.lat, mission.home.lon).lonlat_from_xy(x, y))
    photos = f"; {taken} of about {len(shots)} photographs were taken before" if shots else ""
    number = item_number(mission, stops[leg])
    notes = [
        f"the flight goes on at {lat:.7f},{lon:.7f}, on the leg to item {number}{photos}",
        f"the way there is {math.hypot(x, y):.0f} m, up to {rest.path[2].max():.1f} m above home, and known "
        "to be clear of the zones in the fence alone: check it with uavseg check, --avoid and --dem",
    ]
    if mission.autopilot == "generic":
        notes.append("items are counted as ArduPilot does, from home as 0; PX4 counts one less")
    return rest, notes


def _point(path: FlownPath, place: float) -> list[float]:
    """Return x, y and height of a place of a path, and the length over ground up to there, in metres."""
    columns = [*path.xyz_m.T, np.append(0.0, path.length_m.cumsum())]
    return [float(np.interp(place, range(len(one)), one)) for one in columns]


def _photo_step_m(path: FlownPath, leg: int) -> float:
    """Return the distance between photographs on a leg; 0 where it has one at most."""
    return max((run.step * float(path.length_m[leg]) for run in path.shots if run.leg == leg), default=0.0)


def _last_photograph(path: FlownPath, cut: float, taken: Sequence[float]) -> float:
    """Return its place, at least the start of the line; on a leg far past it, the end of the leg."""
    leg = int(cut)
    if path.is_line[leg]:
        while leg and path.is_line[leg - 1]:
            leg -= 1
        return max(leg, *taken[-1:])
    is_near = taken and _point(path, cut)[3] - _point(path, taken[-1])[3] < CERTAIN_M
    return taken[-1] if is_near else leg + 1.0


def _rest(mission: Mission, path: FlownPath, cut: float, place: float) -> Mission:
    items, stops, plane = mission.items, stops_of(mission), Plane(mission.home.lat, mission.home.lon)
    leg = math.ceil(place) - 1
    share, length_m, first = place - leg, float(path.length_m[leg]), stops[leg]
    ahead = items[first]
    head = [item for item in items[:first] if item.command in mav.TAKEOFFS]
    if len({items[k].frame == mav.FRAME_TERRAIN for k in stops[len(head) : int(cut) + 1]}) > 1:
        raise MissionError("heights above the terrain and others before the cut cannot be compared")
    level_m = float(path.xyz_m[1 : int(cut) + 2, 2].max())

    def waypoint(x: float, y: float, above_m: float) -> MissionItem:
        lon, lat = (round(float(one), mav.DEGREE_DECIMALS) for one in plane.lonlat_from_xy(x, y))
        altitude_m = above_m + (mission.home.altitude_m if ahead.frame == mav.FRAME_AMSL else 0.0)
        params = (0.0, 0.0, 0.0, ahead.params[3] if ahead.command == mav.WAYPOINT else None)
        return MissionItem(mav.WAYPOINT, ahead.frame, params, lat, lon, round(altitude_m, 3))

    back_m = 0.0  # of a way in line with the flight, so that the first photograph looks as it would have
    if path.is_line[leg]:
        back_m = _photo_step_m(path, leg)
    elif share == 1 and path.has_shot[leg + 1] and not path.is_line[leg + 1 : leg + 2].any():
        back_m = CERTAIN_M
    back = min(back_m / length_m, share) if min(back_m, share * length_m) >= MIN_LEG_M else 0.0
    x, y, z, _ = _point(path, place - back)
    entry = [waypoint(x, y, level_m)] if level_m - z > _SAME_M else []
    entry += [waypoint(x, y, z)] if back else []
    entry += [ahead if share == 1 else waypoint(*_point(path, place)[:3])]
    start_x, start_y, start_z = path.xyz_m[len(head)].tolist()
    climb = [waypoint(start_x, start_y, level_m)] if head and level_m - start_z > _SAME_M else []

    lasting = _lasting(items[:first])
    begin = [item for item in items[: stops[len(head)]] if item.command == mav.CHANGE_SPEED]
    early = [item for (setting, _), item in lasting.items() if setting in _EARLY]
    there = [item for item in lasting.values() if item not in [*early, *begin[-1:]]]
    there.sort(key=lambda item: item.command in _TRIGGERS)  # when all is set

    def with_way(corners: list[list[float]]) -> Mission:
        way = [waypoint(east, north, level_m) for east, north in corners]
        flown = (*head, *begin, *early, *climb, *way, *entry, *there, *items[first + (share == 1) :])
        return replace(mission, items=flown, ground=None)

    straight = with_way([])
    if not fence_problems(straight):
        return straight
    world = shapely.box(*[-mav.MAX_DISTANCE_M] * 2, *[mav.MAX_DISTANCE_M] * 2)
    areas = [(area_of(one, plane), one.inclusion) for one in mission.fence]
    free = [area.buffer(-DETOUR_M) if within else world - area.buffer(DETOUR_M) for area, within in areas]
    try:
        corners = FreeSpace(shapely.intersection_all(free)).path((start_x, start_y), (x, y))[1:-1]
    except MissionError as error:
        raise MissionError(
            "the straight way from home to where the flight goes on leaves the fence or enters a zone to "
            f"keep out of, and no way round is {DETOUR_M:g} m from them: fly there by hand"
        ) from error
    return with_way(corners.tolist())


def _lasting(items: Sequence[MissionItem]) -> dict[tuple[int, float], MissionItem]:
    """Return the last item of each setting that lasts, in their order; refuse what is not known to last."""
    found: dict[tuple[int, float], MissionItem] = {}
    for number, item in enumerate(items, start=1):
        first, second, third, fourth = (value or 0.0 for value in item.params)
        setting = _SAME.get(item.command, item.command)
        shots = third if item.command == mav.IMAGE_START else 0.0  # 0 without end
        is_off = item.command in _TRIGGERS[:2] and first <= 0
        if item.has_position:
            found.pop((_YAW, 0.0), None)  # it holds up to the next waypoint
        elif item.command in _ONCE or shots == 1 or (setting == mav.CHANGE_SPEED and second <= 0):
            continue
        elif setting not in _LASTING or shots > 1 or (setting == _YAW and fourth == 1):
            _refuse(
                number, item, "comes before the cut, and whether it has to be done again is not known here"
            )
        else:
            is_one = setting in _NUMBERED or (setting == mav.CHANGE_SPEED and first > 1)
            found.pop(key := (setting, first if is_one else 0.0), None)
            if item.command == mav.CAMERA_DISTANCE:  # with a photograph at once
                item = replace(item, params=(first, second, 1.0, fourth))
            if not is_off and item.command != mav.IMAGE_STOP:
                found[key] = item
    return found
