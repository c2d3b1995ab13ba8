"""Rest of a mission that was cut: from home to its last photograph, then on as it was planned."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError
from uavseg.flight.avoid.free_space import FreeSpace
from uavseg.flight.mission import items as mav
from uavseg.flight.mission.estimate import FlownPath, flown_path
from uavseg.flight.mission.items import MissionItem
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.track import Plane
from uavseg.flight.mission.vehicle import default_vehicle
from uavseg.flight.planning.split import MIN_LEG_M
from uavseg.flight.safety.check import area_of, fence_problems

CERTAIN_M = 10.0
"""So far past a photograph, on a leg without any, it was taken; nearer, it is taken again."""
DETOUR_M = 3.0  # from the fence, on a way round: a corner is cut by less
_SAME_HEIGHT_M = 0.01
_SLACK = 1e-6  # of a leg

# What a command sets until another one sets it again; the last of each is done again before the flight goes
# on. Servos, relays and grippers are set each by its number.
_GIMBAL, _LOOK, _TRIGGER, _YAW, _SPEED = "gimbal", "look", "trigger", "yaw", "speed"
_OTHERS = ("relay", "servo", "gripper", "camera mode", "zoom", "focus")
_SETS = {
    204: "mount",
    115: _YAW,
    mav.CHANGE_SPEED: _SPEED,
    **dict.fromkeys((mav.MOUNT_CONTROL, 1000), _GIMBAL),
    **dict.fromkeys((mav.ROI_LOCATION, mav.ROI_NONE, 201), _LOOK),
    **dict.fromkeys((mav.CAMERA_DISTANCE, mav.CAMERA_INTERVAL, mav.IMAGE_START, mav.IMAGE_STOP), _TRIGGER),
    **dict.fromkeys((2500, 2501), "video"),
    **dict(zip((181, 183, 211, 530, 531, 532), _OTHERS, strict=True)),
}
_NUMBERED = frozenset(_OTHERS[:3])
_EARLY = frozenset({"mount", _GIMBAL, _LOOK, *_OTHERS[3:]})  # set after takeoff, as by plan
_ONCE = frozenset({93, 189, 203, 600})  # a wait, marks and a photograph: nothing of them lasts


@dataclass(frozen=True, slots=True)
class Cut:
    """Where a flight ended: a leg of its `flown_path`, and the share of the leg that was flown."""

    leg: int
    share: float
    is_photo: bool = False  # whether the last photograph was taken there; else it is that of the estimate


@dataclass(frozen=True, slots=True)
class Rest:
    """The rest of a mission: on which leg and at which share of it the flight goes on, and the photographs.

    Those before the cut are counted by the estimate; the last of them may be taken again.
    """

    mission: Mission
    leg: int
    share: float
    taken: int


def path_of(mission: Mission) -> FlownPath:
    """Return the legs of a mission that can be resumed; MissionError if it cannot be, with the reason."""
    ended = flown = False
    for number, item in enumerate(mission.items, start=1):
        reason = ""
        if item.command in mav.ELSEWHERE or (item.command < mav.LAST_NAV and item.command not in mav.KNOWN):
            reason = "where the vehicle flies there is not known here"
        elif item.command in mav.TAKEOFFS and flown:
            reason = "it takes off once more"
        elif item.has_position and ended:
            reason = "it flies on after a return, a landing or a wait without end"
        if reason:
            raise MissionError(
                f"item {number} (command {item.command}) cannot be resumed: {reason}; "
                "edit the mission in its ground station"
            )
        flown = flown or item.has_position
        ended = ended or item.command in {mav.RETURN, mav.LOITER, *mav.LANDINGS}
    return flown_path(mission, mission.vehicle or default_vehicle(mission.autopilot))


def stops_of(mission: Mission) -> list[int]:
    """Return the index of the item at the end of each leg; a return has none."""
    return [k for k, item in enumerate(mission.items) if item.has_position]


def rest_of(mission: Mission, path: FlownPath, cut: Cut) -> Rest:
    """Return what is left of a mission after a cut; all of it where that was before the first waypoint.

    It takes off as the mission does, flies level to the last photograph, in line with it, takes it again and
    goes on. A MissionError says that nothing is left, that what was set before the cut cannot be set again,
    or that there is no way to the last photograph within the fence.
    """
    shots = _photographs(path)
    at = _along(path, cut.leg, cut.share)
    slack_m = _photo_step_m(path, cut.leg) / 2 if cut.is_photo else 0.0
    taken = [shot for shot in shots if shot <= (cut.leg, cut.share + _SLACK)]
    stops = stops_of(mission)
    is_left = cut.leg < len(stops) and mission.items[stops[cut.leg]].command not in mav.LANDINGS
    if shots:
        is_left &= any(_along(path, *shot) > at + slack_m for shot in shots[len(taken) :])
    if not is_left:
        raise MissionError("nothing is left of the mission: what it photographs or flies to was done")
    leg, share = _resume_place(path, cut, taken)
    if not leg or mission.items[stops[leg - 1]].command in mav.TAKEOFFS:  # on the way to the first waypoint
        return Rest(mission, leg, share, len(taken))
    return Rest(_rest(mission, path, leg, share), leg, share, len(taken))


def _photographs(path: FlownPath) -> list[tuple[int, float]]:
    """Return the leg and the share of it of each photograph, in their order."""
    return sorted(
        (run.leg, min(max(run.first + k * run.step, 0.0), 1.0))
        for run in path.shots
        for k in range(run.count)
    )


def _along(path: FlownPath, leg: int, share: float) -> float:
    length = path.length_m
    return float(length[:leg].sum() + share * length[leg : leg + 1].sum())


def _photo_step_m(path: FlownPath, leg: int) -> float:
    """Return the distance between photographs on a leg; 0 where it has one at most."""
    steps = [run.step * path.length_m[leg] for run in path.shots if run.leg == leg]
    return float(max(steps, default=0.0))


def _resume_place(path: FlownPath, cut: Cut, taken: Sequence[tuple[int, float]]) -> tuple[int, float]:
    """Return the leg and the share where the flight goes on.

    On a line it is the last photograph of the line, or else its start; on a leg without photographs its end,
    unless the last photograph is near. Without photographs in the mission it is the cut.
    """
    if cut.is_photo or not path.photographs.any():
        return cut.leg, cut.share
    if path.is_line[cut.leg]:
        first = cut.leg
        while first and path.is_line[first - 1]:
            first -= 1
        return max((first, 0.0), *taken)
    if taken and _along(path, cut.leg, cut.share) - _along(path, *taken[-1]) < CERTAIN_M:
        return taken[-1]
    return cut.leg, 1.0


def _rest(mission: Mission, path: FlownPath, leg: int, share: float) -> Mission:
    items, stops, plane = mission.items, stops_of(mission), Plane(mission.home.lat, mission.home.lon)
    length_m = float(path.length_m[leg])
    if (1 - share) * length_m < MIN_LEG_M:
        share = 1.0
    first = stops[leg - 1] if share == 0 else stops[leg]  # of the items that are flown as they are
    ahead = items[stops[leg]]
    flown = [items[k] for k in stops[: leg + 1]]
    if len({item.frame == mav.FRAME_TERRAIN for item in flown if item.command not in mav.TAKEOFFS}) > 1:
        raise MissionError("heights above the terrain and others before the cut cannot be compared")

    def zero_m(item: MissionItem) -> float:
        return mission.home.altitude_m if item.frame == mav.FRAME_AMSL else 0.0

    def height_m(item: MissionItem) -> float:
        return item.altitude_m - zero_m(item)

    def waypoint(lat: float, lon: float, above_m: float) -> MissionItem:
        altitude_m = round(above_m + zero_m(ahead), 3)
        heading = ahead.params[3] if ahead.command == mav.WAYPOINT else None
        lat, lon = round(lat, mav.DEGREE_DECIMALS), round(lon, mav.DEGREE_DECIMALS)
        return MissionItem(mav.WAYPOINT, ahead.frame, (0.0, 0.0, 0.0, heading), lat, lon, altitude_m)

    def on_leg(k: int, part: float) -> MissionItem:
        xy = path.xyz_m[k, :2] + part * (path.xyz_m[k + 1] - path.xyz_m[k])[:2]
        lon, lat = plane.lonlat_from_xy(*xy)
        low, high = height_m(items[stops[k - 1]]), height_m(items[stops[k]])
        return waypoint(float(lat), float(lon), low + part * (high - low))

    is_between = 0 < share < 1
    kept = list(items[first:]) if is_between else list(items[first + 1 :])
    entry = [on_leg(leg, share) if is_between else items[first]]
    last, end = (leg, share) if share else (leg - 1, 1.0)
    back_m = 0.0  # of a way in line with the flight, so that the first photograph looks as it would have
    if share and path.is_line[leg]:
        back_m = _photo_step_m(path, leg)
    elif last and not is_between and path.has_shot[last + 1] and not path.is_line[last + 1 : last + 2].any():
        back_m = CERTAIN_M
    back_m = min(back_m, end * float(path.length_m[last]))
    if back_m >= MIN_LEG_M:
        entry.insert(0, on_leg(last, end - back_m / float(path.length_m[last])))
    level_m = max(map(height_m, flown))
    if level_m - height_m(entry[0]) > _SAME_HEIGHT_M:
        entry.insert(0, waypoint(entry[0].lat, entry[0].lon, level_m))
    head = [item for item in items[:first] if item.command in mav.TAKEOFFS]
    start = next((item for item in head if not item.is_at_vehicle), mission.home)
    is_low = any(level_m - height_m(item) > _SAME_HEIGHT_M for item in head)
    up = [waypoint(start.lat, start.lon, level_m)] * is_low
    lasting = _lasting(items[:first])
    begin = _lasting(items[: stops[len(head)]]).get(_SPEED)
    early = [item for key, item in lasting.items() if key in _EARLY and item.command != mav.ROI_NONE]
    there = [item for key, item in lasting.items() if key not in {*_EARLY, _TRIGGER} and item != begin]
    trigger = _started(lasting.get(_TRIGGER))
    head += [*([] if begin is None else [begin]), *early, *up]

    def with_way(corners: Sequence[MissionItem]) -> Mission:
        return replace(mission, items=(*head, *corners, *entry, *there, *trigger, *kept), ground=None)

    straight = with_way(())
    if not fence_problems(straight):
        return straight
    ends = np.column_stack(plane.xy_from_lonlat([start.lon, entry[0].lon], [start.lat, entry[0].lat]))
    lon, lat = plane.lonlat_from_xy(*_way_round(mission, plane, ends).T)
    return with_way([waypoint(*place, level_m) for place in zip(lat.tolist(), lon.tolist(), strict=True)])


def _lasting(items: Sequence[MissionItem]) -> dict[str, MissionItem]:
    """Return the last item of each setting that lasts, in their order; refuse what is not known to last."""
    found: dict[str, MissionItem] = {}
    for number, item in enumerate(items, start=1):
        first, second, third, fourth = (value or 0.0 for value in item.params)
        setting = _SETS.get(item.command)
        if item.has_position:
            found.pop(_YAW, None)  # it holds up to the next waypoint
        elif setting is None and item.command in _ONCE:
            continue
        elif (
            setting is None
            or (setting, fourth) == (_YAW, 1)
            or (item.command == mav.IMAGE_START and third > 1)
        ):
            raise MissionError(
                f"item {number} (command {item.command}) comes before the cut, and whether it has to be done "
                "again is not known here; edit the mission in its ground station"
            )
        elif (setting == _SPEED and second <= 0) or (item.command == mav.IMAGE_START and third == 1):
            continue
        else:
            if setting in _NUMBERED or (setting == _SPEED and first > 1):
                setting = f"{setting} {first:g}"
            found.pop(setting, None)
            found[setting] = item
    return found


def _started(trigger: MissionItem | None) -> list[MissionItem]:
    """Return the item that starts photographs again, with one at once; nothing where they were stopped."""
    if trigger is None or trigger.command == mav.IMAGE_STOP:
        return []
    if trigger.command == mav.IMAGE_START:
        return [trigger]
    every, shutter, _, last = trigger.params
    if (every or 0.0) <= 0:
        return []
    at_once = 1.0 if trigger.command == mav.CAMERA_DISTANCE else trigger.params[2]
    return [replace(trigger, params=(every, shutter, at_once, last))]


def _way_round(mission: Mission, plane: Plane, ends: Floats) -> Floats:
    """Return the corners (n, 2) of the shortest way within the fence, in metres, without its ends."""
    areas = [(one.inclusion, area_of(one, plane)) for one in mission.fence]
    within = [shapely.buffer(area, -DETOUR_M) for inclusion, area in areas if inclusion]
    without = [shapely.buffer(area, DETOUR_M) for inclusion, area in areas if not inclusion]
    inside = shapely.intersection_all(within) if within else None
    try:
        obstacles = list(shapely.get_parts(shapely.union_all(without)))
        return FreeSpace(inside, obstacles).path(*ends.tolist())[1:-1]
    except MissionError as error:
        raise MissionError(
            "the straight way from home to where the flight goes on leaves the fence or enters a zone to "
            f"keep out of, and no way round is {DETOUR_M:g} m from them: fly there by hand"
        ) from error
