"""Check of a mission: what it holds, who would refuse it, whether it is safe, what its photographs show."""

import math
import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from uavseg.arrays import GeoDataFrame, Path_
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError, ParameterError
from uavseg.execution.executors import decided, phase, steps_done
from uavseg.flight.camera.camera import BLUR_PX, Camera, camera_named
from uavseg.flight.formats import kmz, litchi, wpml
from uavseg.flight.formats.files import MAX_BYTES, check_mission_format, read_mission, station_refusals
from uavseg.flight.formats.wayline import wayline_of
from uavseg.flight.link.logs import shots_of_log
from uavseg.flight.mission import items as mav
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.vehicle import Wind, default_vehicle
from uavseg.flight.params.plan import SafetyParams
from uavseg.flight.safety.check import Clearance, SafetyCheck
from uavseg.flight.terrain.altitude_profile import climbs_early
from uavseg.inputs import read_bytes
from uavseg.jobs.flights.request import in_degrees, open_regions, safety_params, wind_of, zone_polygons
from uavseg.options.missions import CheckOptions
from uavseg.photographs.coverage import Coverage, coverage
from uavseg.photographs.ground import Ground
from uavseg.photographs.read import Photograph, read_photographs
from uavseg.plain_text import first_of, shown
from uavseg.raster.elevation.dem import Dem
from uavseg.raster.geodesy.globe import WGS84, define_crs, wrap_lon_beyond_180
from uavseg.regions.formats.export import check_region_path, write_regions
from uavseg.regions.table import Regions

CLEARANCE_M = 5.0  # least height above the ground of a DEM
ANY_HEIGHT = SafetyParams(max_altitude_m=mav.MAX_HEIGHT_M)
LOGS = (".bin", ".log", ".ulg", ".tlog")
LISTED = 5  # legs and names in a note
OWN_AUTOPILOT = frozenset({".plan", ".kml", ".geojson"})  # formats that hold it


@dataclass(frozen=True, slots=True)
class CheckRequest:
    """What a mission is checked for; ParameterError if the autopilot is not known."""

    autopilot: str | None = None  # None: the one that the file is for, if its format says so
    safety: SafetyParams = ANY_HEIGHT  # by default any height and distance is accepted
    zones: Sequence[Any] = ()  # keep-out zones: polygons in degrees (lon, lat; WGS 84)
    wind: Wind | None = None  # that the flight is estimated for
    dem: Dem | None = None  # no leg is nearer to it than `CLEARANCE_M`, and heights are those above it
    photographs: tuple[Photograph, ...] = ()  # that came back from the flight
    area: tuple[Any, ...] = ()  # what they should show: polygons in degrees; by default what is planned
    camera: Camera | None = None  # of what is planned; by default that of most photographs
    home: tuple[float, ...] | None = None  # where the flight took off, by default home of the mission
    notes: tuple[str, ...] = ()  # on the zones and photographs

    def __post_init__(self) -> None:
        if self.autopilot is not None and self.autopilot not in mav.AUTOPILOTS:
            raise ParameterError(
                f"an autopilot is one of {', '.join(mav.AUTOPILOTS)}, not {shown(self.autopilot)}"
            )


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether an autopilot, a program or an aircraft takes a mission; the reason, if it does not."""

    who: str
    reason: str = ""

    @property
    def accepts(self) -> bool:
        """Whether it takes the mission."""
        return not self.reason


@dataclass(frozen=True)
class MissionCheck:
    """What a check for an autopilot found: verdicts of autopilots, programs and aircraft, and problems.

    These are why the mission must not be flown with that autopilot, or that its photographs have gaps; there
    are none if it may, or is done. With photographs, `coverage` is what they show.
    """

    mission: Mission
    autopilot: str
    verdicts: tuple[Verdict, ...]
    problems: tuple[str, ...]
    coverage: Coverage | None = None

    @property
    def gaps(self) -> "GeoDataFrame":
        """What photographs do not show, as regions that `plan` takes; none without photographs."""
        return gap_regions(self.coverage).frame()

    def write_gaps(self, path: str, overwrite: bool = False) -> None:
        """Write them to a file, as `uavseg check --gaps` does."""
        write_regions(gap_regions(self.coverage), path, overwrite)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the person who flies it should know."""
        notes = list(self.mission.warnings)
        if unknown := sorted({item.command for item in self.mission.items} - mav.KNOWN):
            listed = ", ".join(map(str, unknown))
            notes.append(f"commands that are not known here are kept and not checked: {listed}")
        notes += _not_followed(self.mission)
        ends = [item.command for item in self.mission.items]
        if not mav.TAKEOFFS & set(ends):
            notes.append("the mission has no takeoff: a multirotor has to be in the air before it starts")
        if not {mav.RETURN, *mav.LANDINGS} & set(ends):
            notes.append("the mission has no return and no landing: it ends in the air")
        return (*notes, *(_findings(self.coverage) if self.coverage else ()))

    def as_dict(self) -> dict[str, Any]:
        """Return the check as plain values, for JSON."""
        mission = self.mission
        heights = mission.path[2][1:]
        inclusions = sum(shape.inclusion for shape in mission.fence)
        return {
            "ok": not self.problems,
            "problems": list(self.problems),
            "autopilot": self.autopilot,
            "items": len(mission.items),
            "waypoints": sum(item.command == mav.WAYPOINT for item in mission.items),
            "commands": {
                str(n): count for n, count in sorted(Counter(i.command for i in mission.items).items())
            },
            "distance_m": round(mission.distance_m, 1),
            "duration_s": round(mission.duration_s, 1) if math.isfinite(mission.duration_s) else None,
            "photographs": mission.estimate.photographs,
            "lowest_m": round(float(heights.min()), 3),
            "highest_m": round(float(heights.max()), 3),
            "speed_m_s": mission.speed_m_s,
            "slowest_m_s": mission.speed_range_m_s[0],
            "fastest_m_s": mission.speed_range_m_s[1],
            "home": asdict(mission.home),
            "fence": {"inclusions": inclusions, "exclusions": len(mission.fence) - inclusions},
            "rally_points": len(mission.rally),
            "verdicts": [
                {"who": one.who, "accepts": one.accepts, "reason": one.reason} for one in self.verdicts
            ],
            "warnings": list(self.warnings),
            **({"coverage": self.coverage.as_dict()} if self.coverage else {}),
        }


def gap_regions(found: Coverage | None) -> Regions:
    """Return the gaps of photographs as regions."""
    gaps = np.array([*(found.gaps if found else ()), None], object)[:-1]
    lon, lat = shapely.get_coordinates(shapely.point_on_surface(gaps)).T
    ids, area_m2 = np.arange(1, len(gaps) + 1), np.array(found.gap_areas_m2 if found else (), float)
    columns = {"id": ids, "area_m2": area_m2, "lon": wrap_lon_beyond_180(lon), "lat": lat}
    wkt = define_crs(WGS84).wkt2
    return replace(in_degrees(Regions(columns, gaps, wkt)), wkt=wkt)


def _findings(found: Coverage) -> Iterator[str]:
    """Yield what the person who flew a mission should know of its photographs."""
    yield from found.notes
    if found.missing:
        legs = Counter(one.item for one in found.missing)
        counts = [f"{count:,} on the leg to item {item}" for item, count in legs.items()]
        listed = first_of(counts, LISTED, " legs")
        yield f"{len(found.missing):,} of {found.planned:,} photographs are missing: {listed}"
    if found.others:
        yield f"{found.others:,} photographs are not near any that the mission takes"
    if found.blurred:
        names = first_of([shown(Path(name).name, quoted=False) for name in found.blurred], LISTED)
        yield f"{names}: blurred by motion, over more than {BLUR_PX:g} pixel"


def check(source: Path_ | Mission, request: CheckRequest) -> MissionCheck:
    """Read a mission back, and say what it is and who would refuse it.

    A MissionError says that the file cannot be read, or holds a mission that would not be safe: which item,
    and why.
    """
    refused: dict[str, str] = {}
    own = None
    if isinstance(source, Mission):
        mission, own = source, source.autopilot
    else:
        suffix = check_mission_format(source)
        with phase("reading"):
            mission = read_mission(source)
        refused = station_refusals(read_bytes(source, MissionError, MAX_BYTES), suffix)
        own = mission.autopilot if suffix in OWN_AUTOPILOT else None
    mission = replace(mission, wind=request.wind or mission.wind)
    requested = request.autopilot or own
    decided("checked for %s, %d keep-out zones", requested or "any autopilot", len(request.zones))
    pilots = {key: _reason(partial(replace, mission, autopilot=key)) for key in mav.AUTOPILOT_NAMES}
    verdicts = [Verdict(mav.AUTOPILOT_NAMES[key], reason) for key, reason in pilots.items()]
    verdicts += [Verdict(who, reason) for who, reason in refused.items()]
    verdicts += [
        Verdict("DJI (.kmz)", _reason(lambda: wpml.check_wayline(wayline_of(mission, kmz.NAME), kmz.NAME))),
        Verdict("Litchi (.csv)", _reason(lambda: litchi.check_wayline(wayline_of(mission, litchi.NAME)))),
    ]
    needed = list(mav.AUTOPILOT_NAMES) if requested == "generic" else [requested] if requested else []
    problems = [f"{mav.AUTOPILOT_NAMES[key]} refuses it: {pilots[key]}" for key in needed if pilots[key]]
    with phase("paper check"):
        problems += _paper_check(mission, request, requested).problems(mission)
        if mission.fence or request.zones or request.dem or request.safety.max_distance_m:
            problems += _not_followed(mission)
    found = None
    if request.photographs:
        with phase("coverage"):
            ground = ground_below(request, mission)
            found = coverage(mission, request.photographs, ground, request.camera, request.area)
        if not found.is_whole:
            problems.append(
                f"the photographs show {100 * found.as_dict()['covered']:.2f} % of the area: "
                f"{sum(found.gap_areas_m2):,.0f} m2 in {len(found.gaps):,} gaps are left for the next flight "
                "(--gaps gaps.geojson, then uavseg plan gaps.geojson)"
            )
    mission = replace(mission, notes=(*request.notes, *mission.notes))
    return MissionCheck(mission, requested or mission.autopilot, tuple(verdicts), tuple(problems), found)


def ground_below(request: CheckRequest, mission: Mission) -> Ground:
    """Return the ground that photographs show, as high as home of the mission where that is known (not 0)."""
    home = mission.home
    level = (home.altitude_m,) if home.altitude_m and request.dem is None else ()
    return Ground(request.dem, request.home or (home.lat, home.lon, *level))


def _not_followed(mission: Mission) -> list[str]:
    """Return a sentence about the items after which the vehicle is elsewhere than on straight legs."""
    items = [
        f"item {number} (command {item.command})"
        for number, item in enumerate(mission.items, start=1)
        if item.command in mav.ELSEWHERE or (item.command < mav.LAST_NAV and item.command not in mav.KNOWN)
    ]
    unknown = "where the vehicle flies there is not known here, so it is neither checked nor counted"
    return [f"{first_of(items, 1)}: {unknown}"] if items else []


def check_request(options: CheckOptions) -> CheckRequest:
    """Return what a mission is checked for: zones, elevation model, photographs and their regions are read.

    A ParameterError says that options go with photographs alone; a PhotographError that none can be placed.
    """
    limits, dem = options.safety, options.terrain.dem
    photos, poses = options.photos, options.poses
    if photos is None:
        alone = {"gaps": options.gaps, "regions": options.regions, "camera": poses.camera, "home": poses.home}
        for name, given in alone.items():
            if given is not None:
                raise ParameterError(f"--{name} is for photographs of the flight; give them with --photos")
    if options.gaps is not None:
        check_region_path(options.gaps, options.files.overwrite)
    if limits.max_altitude is None:
        limits = replace(limits, max_altitude=mav.MAX_HEIGHT_M)
    camera = None if poses.camera is None else camera_named(poses.camera)
    zones, notes = zone_polygons(limits)
    area = () if options.regions is None else tuple(open_regions(options.regions).polygons)
    photographs: tuple[Photograph, ...] = ()
    if photos is not None:
        sources = [photos] if isinstance(photos, str | os.PathLike) else photos
        logs = [one for one in sources if Path(one).suffix.lower() in LOGS]
        with phase("reading of photographs"):
            photographs = tuple(shot for one in logs for shot in _logged(one, camera))
            if images := [one for one in sources if one not in logs]:
                taken = read_photographs(images, steps_done, camera)
                photographs, notes = (*photographs, *taken.photographs), [*notes, *taken.notes]
        if logs:
            notes.append("logs hold no angles of the camera: it is taken to look straight down, ahead")
    return CheckRequest(
        autopilot=options.autopilot,
        safety=safety_params(limits),
        zones=tuple(zones),
        wind=wind_of(options.wind),
        dem=None if dem is None else Dem.open(dem),
        photographs=photographs,
        area=area,
        camera=camera,
        home=None if poses.home is None else tuple(poses.home),
        notes=tuple(notes),
    )


def _logged(path: Path_, camera: Camera | None) -> Iterator[Photograph]:
    """Yield the photographs of a flight log, straight down, with the top of the image ahead."""
    if camera is None:
        raise ParameterError(f"{os.fspath(path)} does not say which camera the vehicle has: give --camera")
    for number, shot in enumerate(shots_of_log(path), 1):
        yield Photograph(
            path=f"{Path(path).name} {number}",
            image_px=camera.image_px,
            focal_px=camera.focal_px,
            camera=camera.name,
            **asdict(shot),
        )


def _paper_check(mission: Mission, request: CheckRequest, autopilot: str | None) -> SafetyCheck:
    if request.dem is None:
        return SafetyCheck(request.safety, request.zones)
    above_sea = any(item.has_position and item.frame == mav.FRAME_AMSL for item in mission.items)
    if above_sea and not request.dem.is_above_sea:
        raise ParameterError(
            f"{request.dem.name} has heights above the ellipsoid and the mission has heights above the sea, "
            "up to 100 m from them: check it with a model whose heights are above the sea"
        )
    early = None  # DJI's aircraft and ArduPilot follow the straight line
    if autopilot is not None and climbs_early(autopilot):
        flyer = default_vehicle(autopilot)
        early = (flyer.climb_m_s, flyer.descent_m_s)
    return SafetyCheck(request.safety, request.zones, Clearance(request.dem, CLEARANCE_M, early))


def _reason(test: Callable[[], Any]) -> str:
    """Tell why a test fails; empty if it passes."""
    try:
        test()
    except MissionError as error:
        return str(error)
    return ""
