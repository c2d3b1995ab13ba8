"""The rest of a mission whose flight was cut: the cut by place, by item or from a log, and what is left."""

import math
import os
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from uavseg.arrays import Floats
from uavseg.errors import MissionError, ParameterError
from uavseg.execution.executors import decided, phase
from uavseg.flight.formats.files import read_mission
from uavseg.flight.link.logs import end_of_log
from uavseg.flight.mission.estimate import FlownPath
from uavseg.flight.mission.items import MAX_HEIGHT_M, MAX_ITEMS, check_position
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.track import Plane
from uavseg.flight.params.plan import SafetyParams
from uavseg.flight.planning.resume import Cut, Rest, path_of, rest_of, stops_of
from uavseg.flight.safety.check import SafetyCheck
from uavseg.jobs.flights.plan import MissionPlan
from uavseg.plain_text import shown

FARTHEST_M = 100.0  # of a place from the path
APART_M = 20.0  # along the path: nearer parts of it are one and the same
UNSURE_M = 3.0  # of a position by satellite
CHECK = SafetyCheck(SafetyParams(max_altitude_m=MAX_HEIGHT_M))  # of the fence


def resume(
    source: str | os.PathLike[str] | Mission, start: str | os.PathLike[str] | float | Sequence[float]
) -> MissionPlan:
    """Return the rest of a mission whose flight ended at `start`: an item, a place in degrees, or a log.

    Its notes say where the flight goes on. A MissionError says that the mission or the log cannot be read,
    that the cut is not on its path or on several parts of it, or that nothing is left; a ParameterError that
    `start` is none of these.
    """
    mission = source
    if not isinstance(mission, Mission):
        with phase("reading"):
            mission = read_mission(mission)
    path = path_of(mission)
    with phase("cut"):
        if isinstance(start, str | os.PathLike):
            cut, notes = _cut_of_log(mission, path, start)
        else:
            given = np.asarray(start, np.float64)
            if given.ndim == 0:
                cut, notes = _cut_at_item(mission, path, given.item()), []
            else:
                cut, notes = _cut_at_place(mission, path, given.tolist())
    decided("cut on leg %d, at %.3f of it", cut.leg, cut.share)
    rest = rest_of(mission, path, cut)
    notes = [*mission.notes, *notes, *_notes(mission, path, rest)]
    with phase("paper check"):
        CHECK.check(rest.mission)
    return MissionPlan((replace(rest.mission, notes=tuple(notes)),), 0, CHECK)


def _notes(mission: Mission, path: FlownPath, rest: Rest) -> Iterator[str]:
    if rest.mission is mission:
        yield "the flight was cut before it passed its first waypoint: the rest is all of it"
        return
    xy = path.xyz_m[rest.leg] + rest.share * (path.xyz_m[rest.leg + 1] - path.xyz_m[rest.leg])
    lon, lat = map(float, Plane(mission.home.lat, mission.home.lon).lonlat_from_xy(*xy[:2]))
    number, total = _number(mission, stops_of(mission)[rest.leg]), int(path.photographs.sum())
    photos = f"; {rest.taken} of about {total} photographs were taken before" if total else ""
    yield f"the flight goes on at {lat:.7f},{lon:.7f}, on the leg to item {number}{photos}"
    heights = rest.mission.path[2]
    yield (
        f"the way there is {math.hypot(*xy[:2]):.0f} m, up to {heights.max():.1f} m above home, and known to "
        "be clear of the zones in the fence alone: check it with uavseg check, --avoid and --dem"
    )
    if mission.autopilot == "generic":
        yield "items are counted as ArduPilot does, from home as 0; PX4 counts one less"


def _number(mission: Mission, index: int) -> int:
    """Return the number of an item as the vehicle counts it: of ArduPilot, home is item 0."""
    return index + (mission.autopilot != "px4")


def _leg_to(mission: Mission, number: int) -> int:
    """Return the leg to an item, or to the next one with a position; MissionError if there is no item."""
    index, last = number - _number(mission, 0), len(mission.items) - 1
    if not 0 <= index <= last:
        raise MissionError(
            f"there is no item {number}: the vehicle counts items {_number(mission, 0)} to "
            f"{_number(mission, last)} in this mission"
        )
    return bisect_left(stops_of(mission), index)


def _cut_at_item(mission: Mission, path: FlownPath, number: float) -> Cut:
    if not abs(number) < MAX_ITEMS + 1:
        raise ParameterError(f"--from is the number of an item, such as 12 or 12.4, not {number:g}")
    whole = math.floor(number)
    leg, share = _leg_to(mission, whole), round(number - whole, 9)
    item = mission.items[whole - _number(mission, 0)]
    if share and not item.has_position:
        raise MissionError(
            f"item {whole} (command {item.command}) is not flown to, so {number:g} is no share of a leg; "
            f"give {whole}, or the number of a waypoint"
        )
    return Cut(leg, share)


def _cut_at_place(mission: Mission, path: FlownPath, place: Sequence[float]) -> tuple[Cut, list[str]]:
    """Return the nearest cut to a place, and how far off it is; refuse one that is near to two parts."""
    if len(place) != 2:
        raise ParameterError(f"--from is LAT,LON in degrees, an item or a log, not {shown(tuple(place))}")
    lat, lon = map(float, place)
    check_position(lat, lon, "the place of --from")
    away, share = _distances(mission, path, lat, lon)
    leg = int(away.argmin())
    text = f"{lat:.7f},{lon:.7f} lies {away[leg]:.1f} m from the path of the mission"
    if away[leg] > FARTHEST_M:
        raise MissionError(
            f"{text}, and at most {FARTHEST_M:g} m are taken for a place on it: is it of another flight?"
        )
    lengths = path.length_m[: len(away)]
    along = np.cumsum(lengths) - (1 - share) * lengths
    other = (away < 2 * away[leg] + UNSURE_M) & (np.abs(along - along[leg]) > APART_M)
    if other.any():
        second = int(np.where(other, away, np.inf).argmin())
        stops = stops_of(mission)
        names = [
            f"{_number(mission, stops[k]) + min(float(share[k]), 0.99):.2f}" for k in sorted((leg, second))
        ]
        raise MissionError(
            f"{text}, and {away[second]:.1f} m from another part of it; name the item that was flown to: "
            f"--from {names[0]} or --from {names[1]}"
        )
    return Cut(leg, float(share[leg])), [text]


def _distances(mission: Mission, path: FlownPath, lat: float, lon: float) -> tuple[Floats, Floats]:
    """Return the distance of a place from each leg but those of a return, and its share of the leg."""
    count = len(stops_of(mission))
    place = np.array(Plane(mission.home.lat, mission.home.lon).xy_from_lonlat(lon, lat))
    start, leg = path.xyz_m[:count, :2], np.diff(path.xyz_m[: count + 1, :2], axis=0)
    squares = (leg**2).sum(axis=1)
    share = ((place - start) * leg).sum(axis=1) / np.where(squares > 0, squares, 1.0)
    share = np.where(squares > 0, np.clip(share, 0, 1), 1.0)
    return np.hypot(*(start + share[:, None] * leg - place).T), share


def _cut_of_log(mission: Mission, path: FlownPath, log: str | os.PathLike[str]) -> tuple[Cut, list[str]]:
    """Return where the last photograph of a log was taken, or where it left the mission."""
    end, name = end_of_log(log), os.fspath(log)
    if end.finished:
        raise MissionError(f"{name} shows that the mission was flown to its end: nothing is left")
    what = "its last photograph" if end.is_photo else "its end in mission mode, without photographs"
    notes = [f"{name}: {what} is at {end.place[0]:.7f},{end.place[1]:.7f}"]
    try:
        if end.item is None:
            cut, more = _cut_at_place(mission, path, end.place)
            return replace(cut, is_photo=end.is_photo), notes + more
        leg = _leg_to(mission, end.item)
        last = leg if end.last_item is None else _leg_to(mission, end.last_item)
        check_position(*end.place, "the end of the flight")
    except MissionError as error:
        raise MissionError(f"{name}: {error}") from error
    away, share = _distances(mission, path, *end.place)
    if last >= len(away):
        raise MissionError(f"{name} shows that the mission was flown to its end: nothing is left")
    if last < leg:
        raise MissionError(
            f"{name} shows that the mission was begun again after its last photograph: name the place or item"
        )
    near = [k for k in (leg, leg - 1, leg + 1) if 0 <= k < len(away)]
    least = min(away[k] for k in near)
    leg = next(k for k in near if away[k] <= least + 1)
    if least > FARTHEST_M:
        raise MissionError(
            f"{name}: {what} is {least:.0f} m from the leg to item {end.item} of the mission, and at most "
            f"{FARTHEST_M:g} m are taken for on it: is the log of another mission?"
        )
    return Cut(leg, float(share[leg]), end.is_photo), notes
