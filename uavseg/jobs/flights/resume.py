"""The rest of a mission whose flight was cut: the cut by place, by item or from a log, and what is left."""

import math
import os
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely

from uavseg.arrays import Path_
from uavseg.errors import MissionError, ParameterError
from uavseg.execution.executors import decided, phase
from uavseg.flight.formats.files import read_mission
from uavseg.flight.link.logs import LogEnd, end_of_log
from uavseg.flight.mission.estimate import FlownPath
from uavseg.flight.mission.items import MAX_HEIGHT_M, MAX_ITEMS, check_position
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.track import Plane
from uavseg.flight.params.plan import SafetyParams
from uavseg.flight.planning.resume import item_number, path_of, rest_of, stops_of
from uavseg.flight.safety.check import SafetyCheck
from uavseg.jobs.flights.plan import MissionPlan
from uavseg.plain_text import shown

FARTHEST_M = 100.0  # of a place from the path
APART_M = 20.0  # along the path: nearer parts of it are one and the same
UNSURE_M = 3.0  # of a position by satellite
SAME_M = 1.0  # of a place in a log from legs: of these, it is on that to its item
_WHOLE = 1 - 1e-5  # of a leg, at its end
CHECK = SafetyCheck(SafetyParams(max_altitude_m=MAX_HEIGHT_M))  # of the fence


def resume(source: Path_ | Mission, start: Path_ | float | Sequence[float]) -> MissionPlan:
    """Return the rest of a mission whose flight ended at `start`: an item, a place in degrees, or a log.

    Its notes say where the flight goes on. A MissionError says that mission or log cannot be read, the cut is
    not on one part of the path, or nothing is left; a ParameterError that `start` is none of these.
    """
    with phase("reading"):
        mission = source if isinstance(source, Mission) else read_mission(source)
    path, is_photo, notes = path_of(mission), False, [*mission.notes]
    with phase("cut"):
        if isinstance(start, str | os.PathLike):
            end = end_of_log(start)
            cut, note = _cut_of_log(mission, path, end)
            is_photo, what = end.is_photo, "last photograph" if end.is_photo else "end in mission mode"
            notes.append(f"{os.fspath(start)}: its {what} is at {note}")
        elif (given := np.asarray(start, np.float64)).ndim == 0:
            cut = _cut_at_item(mission, given.item())
        elif given.shape == (2,):
            cut, note = _nearest(mission, path, given.tolist())
            notes.append(note)
        else:
            place = shown(tuple(given.tolist()))
            raise ParameterError(f"--from is LAT,LON in degrees, an item or a log, not {place}")
    decided("cut on leg %d, at %.3f of it", *divmod(cut, 1))
    rest, more = rest_of(mission, path, cut, is_photo)
    with phase("paper check"):
        CHECK.check(rest)
    return MissionPlan((replace(rest, notes=(*notes, *more)),), 0, CHECK)


def _leg_to(mission: Mission, number: int) -> int:
    """Return the leg to an item, or to the next one with a position; MissionError if there is no item."""
    first, last = (item_number(mission, k) for k in (0, len(mission.items) - 1))
    if not first <= number <= last:
        raise MissionError(
            f"there is no item {number}: the vehicle counts items {first} to {last} in this mission"
        )
    return bisect_left(stops_of(mission), number - first)


def _cut_at_item(mission: Mission, number: float) -> float:
    if not abs(number) < MAX_ITEMS + 1:
        raise ParameterError(f"--from is the number of an item, such as 12 or 12.4, not {number:g}")
    whole = math.floor(number)
    leg, share = _leg_to(mission, whole), round(number - whole, 9)
    item = mission.items[whole - item_number(mission, 0)]
    if share and not item.has_position:
        raise MissionError(
            f"item {whole} (command {item.command}) is not flown to, so {number:g} is no share of a leg; "
            f"give {whole}, or the number of a waypoint"
        )
    return leg + share


def _nearest(
    mission: Mission, path: FlownPath, place: Sequence[float], item: int | None = None
) -> tuple[float, str]:
    """Return the cut nearest to a place, by an item if given, and how far off; refuse two that are near."""
    lat, lon = place
    check_position(lat, lon, "the place of --from")
    stops, xy = stops_of(mission), path.xyz_m[:, :2]
    legs = shapely.linestrings(np.stack([xy[:-1], xy[1:]], axis=1)[: len(stops)])
    point = shapely.points(*Plane(mission.home.lat, mission.home.lon).xy_from_lonlat(lon, lat))
    lengths = path.length_m[: len(stops)]
    away, flown = shapely.distance(legs, point), shapely.line_locate_point(legs, point)
    share = np.minimum(flown / np.maximum(lengths, 1e-6), _WHOLE)
    best, where = int(away.argmin()), "the path"
    if item is not None:
        to_item, where = _leg_to(mission, item), f"the leg to item {item}"
        near = [k for k in (to_item, to_item - 1, to_item + 1) if 0 <= k < len(stops)]
        best = next(k for k in near if away[k] <= min(away[near]) + SAME_M)
    text = f"{lat:.7f},{lon:.7f} lies {away[best]:.1f} m from {where} of the mission"
    if away[best] > FARTHEST_M:
        raise MissionError(
            f"{text}, and at most {FARTHEST_M:g} m are taken for a place on it: is it of another flight, or "
            "is the log of another mission?"
        )
    along = lengths.cumsum() - lengths + flown
    other = (away < 2 * away[best] + UNSURE_M) & (np.abs(along - along[best]) > APART_M)
    if item is None and other.any():
        second = int(np.where(other, away, np.inf).argmin())
        names = [
            f"{item_number(mission, stops[k]) + min(share[k], 0.99):.2f}" for k in sorted((best, second))
        ]
        raise MissionError(
            f"{text}, and {away[second]:.1f} m from another part of it; name the item that was flown to: "
            f"--from {' or --from '.join(names)}"
        )
    return best + float(share[best]), text


def _cut_of_log(mission: Mission, path: FlownPath, end: LogEnd) -> tuple[float, str]:
    """Return where the last photograph of a log was taken, or where it left the mission."""
    to_item, to_last = (0 if one is None else _leg_to(mission, one) for one in (end.item, end.last_item))
    if end.finished or to_last == len(stops_of(mission)):
        raise MissionError("the log shows that the mission was flown to its end: nothing is left")
    if to_last < to_item:
        raise MissionError(
            "the log shows that the mission was begun again after its last photograph: name the place or item"
        )
    return _nearest(mission, path, end.place, end.item)
