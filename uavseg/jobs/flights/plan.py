"""Planning of missions over regions, their files, and the rest of a mission whose flight was cut."""

import math
import os
import warnings
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from uavseg.arrays import Path_
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError, ParameterError
from uavseg.execution.executors import decided, phase
from uavseg.flight.formats.files import read_mission, write_mission
from uavseg.flight.formats.options import DEFAULT_DJI_MODEL, TURN_STOP, TURN_THROUGH
from uavseg.flight.formats.wpml import TURN_M
from uavseg.flight.link.logs import LogEnd, end_of_log
from uavseg.flight.mission.estimate import FlownPath
from uavseg.flight.mission.features import as_html, explore
from uavseg.flight.mission.items import MAX_HEIGHT_M, MAX_ITEMS, check_position
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.track import Plane
from uavseg.flight.params.plan import PlanParams, SafetyParams
from uavseg.flight.planning.planner import check_regions, plan_missions
from uavseg.flight.planning.resume import item_number, path_of, rest_of, stops_of
from uavseg.flight.safety.check import SafetyCheck, clearance_of
from uavseg.flight.safety.keep_out import home_outside
from uavseg.options.flights import Home as Home
from uavseg.output.atomic import transaction
from uavseg.plain_text import shown
from uavseg.regions.select.choose import of_classes, select_regions
from uavseg.regions.table import Regions

if TYPE_CHECKING:
    from uavseg.jobs.source.source import Source

FARTHEST_M = 100.0  # of a place from the path
APART_M = 20.0  # along the path: nearer parts of it are one and the same
UNSURE_M = 3.0  # of a position by satellite
SAME_M = 1.0  # of a place in a log from legs: of these, it is on that to its item
_WHOLE = 1 - 1e-5  # of a leg, at its end
CHECK = SafetyCheck(SafetyParams(max_altitude_m=MAX_HEIGHT_M))  # of the fence


@dataclass(frozen=True, slots=True)
class PlanRequest:
    """How to fly, from where, and over what; ParameterError if a class is flown over and kept out of."""

    flight: PlanParams
    home: Home  # "auto": near the chosen regions, outside of all of them and of keep-out zones
    ids: Sequence[int] | None = None  # only the regions with these
    largest: int | None = None  # only so many
    where: str | None = None  # a condition, see `uavseg.regions.select.choose`
    allow_edge: bool = False  # fly over regions that touch the edge of their raster too
    classes: Sequence[str] | None = None  # only regions of these
    avoid_classes: Sequence[str] = ()  # whose regions are keep-out zones

    def __post_init__(self) -> None:
        for name in self.avoid_classes:
            if self.classes is not None and name in self.classes:
                raise ParameterError(f"the class {name} is to be flown over and kept out of; choose one")


@dataclass(frozen=True)
class MissionPlan:
    """Missions over regions.

    Parameters
    ----------
    missions : tuple of Mission
        One for each flight, in the order in which they are flown.
    regions : int
        How many regions they lead over.
    check : SafetyCheck
        What they are checked against.
    """

    missions: tuple[Mission, ...]
    regions: int
    check: SafetyCheck = field(compare=False)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the person who flies them should know, each once; of which flights, if not of all."""
        flights: dict[str, list[int]] = {}
        for number, mission in enumerate(self.missions, start=1):
            for text in dict.fromkeys(mission.warnings):
                flights.setdefault(text, []).append(number)
        everywhere = len(self.missions)
        return tuple(
            text if len(numbers) == everywhere else f"{_flights_text(numbers)}: {text}"
            for text, numbers in flights.items()
        )

    def explore(self, **words: Any) -> Any:
        """Draw an interactive map (folium.Map) of all flights; arguments as of `Mission.explore`."""
        return explore(*self.missions, **words)

    def _repr_html_(self) -> str:
        count = len(self.missions)
        titles = ["" if count == 1 else f"<p>flight {k} of {count}</p>" for k in range(1, count + 1)]
        drawn = zip(titles, self.missions, strict=True)
        return f"<div>{''.join(title + as_html(mission) for title, mission in drawn)}</div>"

    def write(
        self,
        path: Path_,
        overwrite: bool = False,
        *,
        editable: bool = False,
        dji_model: str = DEFAULT_DJI_MODEL,
        lens: str | None = None,
        turn: str = TURN_STOP,
    ) -> list[Path]:
        """Write the missions, read them back and check them; several are numbered: fly-1.plan, fly-2.plan.

        Parameters
        ----------
        path : path
            Its extension selects the format, see `uavseg.flight.formats.files`.
        overwrite : bool
            Whether existing files may be replaced.
        editable, dji_model, lens, turn
            As of `uavseg.flight.formats.files.write_mission`.

        Returns
        -------
        paths : list of Path

        Raises
        ------
        MissionError
            If the extension is none of a mission, or what was written is not safe.
        ParameterError
            If the aircraft is not known or has no such lens, or the format has no such option.
        OutputError
            If a file exists, or cannot be written.
        """
        corner_m = TURN_M / 2
        if turn == TURN_THROUGH and self.check.zones and self.check.safety.avoid_margin_m < corner_m:
            raise MissionError(
                f"with --turn through the aircraft leaves the legs by up to {corner_m:g} m at corners; keep "
                "at least that from zones (--avoid-margin), or stop at waypoints"
            )
        base, count = Path(path), len(self.missions)
        numbered = [base.with_name(f"{base.stem}-{k}{base.suffix}") for k in range(1, count + 2)]
        paths, others = ([base], numbered[:1]) if count == 1 else (numbered[:-1], [numbered[-1], base])
        stale = next((file for file in others if file.exists()), None)  # like a flight of this plan
        how: dict[str, Any] = {"editable": editable, "dji_model": dji_model, "lens": lens, "turn": turn}
        with transaction():
            for mission, one in zip(self.missions, paths, strict=True):
                write_mission(mission, one, overwrite, self.check.check, **how)
        if stale is not None:
            warnings.warn(f"{stale} is of another plan; do not fly it with this one", stacklevel=2)
        return paths


def plan(
    regions: Regions,
    request: PlanRequest,
    zones: Sequence[Any] = (),
    raster: "Source | None" = None,
    zone_notes: Sequence[str] = (),
) -> MissionPlan:
    """Plan missions over regions: take off, fly their pattern in a short order, return.

    Regions and keep-out zones are in degrees (lon, lat; WGS 84), see `uavseg.jobs.flights.request`. With
    the raster that the regions are of, those that touch its edge are left out, and a home that is found lies
    on one of its valid pixels. A RegionError says that none of the regions is chosen, none is of a class, or
    one that touches the edge is chosen by its id; a MissionError that there are no regions, that they are not
    near home, that zones make one unreachable, or that the mission would not be safe.
    """
    chosen: Regions = regions
    notes: list[str] = []
    if request.classes is not None:
        chosen = regions.select(np.flatnonzero(of_classes(regions, request.classes)))
    if request.avoid_classes:
        avoided = np.flatnonzero(of_classes(regions, request.avoid_classes))
        zones = [*zones, *regions.select(avoided).polygons]
    if raster is not None:
        from uavseg.jobs.flights.under_raster import valid_ground, without_edge_regions
    if raster is not None and not request.allow_edge and len(chosen):
        chosen, notes = without_edge_regions(chosen, raster, request.ids, request.where)
    if any(choice is not None for choice in (request.ids, request.largest, request.where)):
        chosen = select_regions(chosen, request.ids, request.largest, request.where)
    polygons, points = list(chosen.polygons), _points(chosen)
    flight, home = request.flight, request.home
    check_regions(len(polygons), flight)
    if home == "auto":
        everywhere = list(regions.polygons)
        margin_m = flight.safety.avoid_margin_m
        is_ground = None if raster is None else valid_ground(raster)
        with phase("place for home"):
            home = home_outside(everywhere, points or _points(regions), zones, margin_m, is_ground)
        notes.append(
            f"home is {home[0]:.7f},{home[1]:.7f}, outside of all regions and keep-out zones; look at the "
            "place before the flight: the plan knows nothing of trees, water or roads there"
        )
    decided("%d of %d regions, %d keep-out zones", len(chosen), len(regions), len(zones))
    check = SafetyCheck(flight.safety, tuple(zones), clearance_of(flight))
    with phase("route and flights"):
        missions = plan_missions(polygons, points, flight, home, zones)
    notes = [*zone_notes, *regions.metadata.get("notes", ()), *notes]
    missions = tuple(replace(mission, notes=(*notes, *mission.notes)) for mission in missions)
    with phase("paper check"):
        for mission in missions:
            check.check(mission)
    items = ", ".join(str(len(mission.items)) for mission in missions)
    start = missions[0].home
    decided("pattern %s from %.7f,%.7f: %s items", flight.pattern, start.lat, start.lon, items)
    return MissionPlan(missions, len(chosen), check)


def _flights_text(numbers: Sequence[int]) -> str:
    """Return numbers of flights in words.

    Examples
    --------
    >>> _flights_text([1, 2, 3, 5])
    'flights 1-3, 5'
    """
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1] = [runs[-1][0], number]
        else:
            runs.append([number])
    return f"flight{'s' * (len(numbers) > 1)} {', '.join('-'.join(map(str, run)) for run in runs)}"


def _points(regions: Regions) -> list[tuple[float, float]]:
    # The 12 digits that GeoJSON keeps, so that no format decides between orders of almost the same length.
    lon, lat = ([float(f"{x:.12g}") for x in regions.columns[name].tolist()] for name in ("lon", "lat"))
    return list(zip(lon, lat, strict=True))


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
