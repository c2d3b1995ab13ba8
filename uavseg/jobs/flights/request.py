"""Requests of missions from their options: how to fly, from where, over which regions, around which zones."""

import math
import os
from collections.abc import Sequence
from dataclasses import asdict, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from uavseg.arrays import GeoDataFrame, Path_
from uavseg.errors import ParameterError
from uavseg.execution.executors import phase
from uavseg.flight.camera.camera import SHUTTER_S, Camera, Overlap, Photos, camera_named
from uavseg.flight.formats import litchi
from uavseg.flight.mission.items import RallyPoint
from uavseg.flight.mission.vehicle import Wind, read_vehicle
from uavseg.flight.params import plan
from uavseg.jobs.flights.plan import Home, PlanRequest
from uavseg.options.flights import MissionOptions, PatternOptions, PhotoOptions, PlanOptions, SafetyOptions
from uavseg.plain_text import shown
from uavseg.regions.formats.read import Widths, read_regions, regions_of_frame
from uavseg.regions.table import Regions
from uavseg.regions.wgs84.to_wgs84 import wgs84_geometries

if TYPE_CHECKING:
    from uavseg.jobs.source.source import Source

MAX_GSD_CM = 100.0
POINT_M = 1.0  # diameter of the region that a point is, for visits
MIN_ZONE_M, MAX_ZONE_M = 0.1, 10_000.0  # width of points and lines that are zones


def plan_request(options: PlanOptions) -> PlanRequest:
    """Return the request of a plan, checked before any work: ParameterError as of `mission_request`."""
    chosen = {name: getattr(options, name) for name in ("ids", "largest", "where")}
    chosen |= {"classes": _names(options.classes), "avoid_classes": _names(options.avoid_classes) or ()}
    return mission_request(options.mission, options.output, **chosen)


def mission_request(options: MissionOptions, output: str | None, **chosen: Any) -> PlanRequest:
    """Return the request of a mission over regions, which fields of `PlanRequest` choose.

    Flights have no more waypoints than the program that reads `output` flies, if that is known.
    ParameterError is raised if a value is out of bounds, or values do not go together.
    """
    if options.limits.max_waypoints is None and output is not None and output.lower().endswith(".csv"):
        limits = replace(options.limits, max_waypoints=litchi.MAX_WAYPOINTS)
        options = replace(options, limits=limits)
    flight = flight_params(options)
    home = options.flight.home
    if home is None:
        raise ParameterError("a mission needs --home LAT,LON, where the vehicle starts (or --home auto)")
    return PlanRequest(flight, _home(home), allow_edge=options.safety.allow_edge, **chosen)


def _home(given: Any) -> Home:
    if isinstance(given, str):
        if given == "auto":
            return "auto"
    elif len(given) in (2, 3):
        return tuple(map(float, given))
    raise ParameterError(f'home is (lat, lon), (lat, lon, altitude_m) or "auto", not {shown(given)}')


def flight_params(options: MissionOptions) -> plan.PlanParams:
    """Return how to fly; without a pattern, regions are visited, or surveyed with a spacing or a camera.

    With a camera, the height follows from the ground sampling distance where that is given, and the spacing
    from the overlap.
    """
    flight = options.flight
    photos = photos_of(options.photos, flight.pattern)
    altitude = _altitude(flight.altitude, options.photos.gsd, photos)
    pattern, spacing = flight.pattern, flight.spacing
    if pattern is None:
        pattern = "visit" if spacing is None and photos is None else "survey"
    if photos is not None and pattern in plan.COVERING and 0 < altitude < math.inf:
        spacing = photos.spacing_m(altitude) if spacing is None else spacing
    vehicle = flight.vehicle
    limits, terrain = asdict(options.limits), options.terrain
    return plan.PlanParams(
        altitude_m=altitude,
        pattern=pattern,
        spacing_m=spacing,
        angle_deg=_angle(flight.angle),
        speed_m_s=flight.speed,
        wind=wind_of(flight.wind),
        autopilot=flight.autopilot,
        tolerance_m=flight.tolerance,
        photos=photos,
        vehicle=read_vehicle(vehicle, flight.autopilot)
        if isinstance(vehicle, str | os.PathLike)
        else vehicle,
        how=_pattern_params(pattern, options.pattern),
        limits=plan.LimitParams(limits.pop("endurance"), **limits),
        safety=safety_params(options.safety),
        terrain=plan.terrain_params(
            terrain.dem or None, terrain.terrain, terrain.terrain_tolerance, terrain.climb, terrain.descent
        ),
    )


def wind_of(given: float | Sequence[float] | None) -> Wind | None:
    """Return a wind of a speed, perhaps with the azimuth that it comes from."""
    if given is None:
        return None
    numbers = [float(given)] if isinstance(given, int | float) else [float(one) for one in given]
    if len(numbers) not in (1, 2):
        raise ParameterError(
            f"a wind is a speed in m/s, perhaps with the azimuth that it comes from, not {shown(given)}"
        )
    return Wind(numbers[0], numbers[1] if len(numbers) == 2 else None)


def _angle(given: float | str) -> float | None:
    if not isinstance(given, str):
        return float(given)
    if given != "auto":
        raise ParameterError(f'angle is a number of degrees or "auto", not {shown(given)}')
    return None


def _altitude(altitude: float | None, gsd_cm: float | None, photos: Photos | None) -> float:
    if gsd_cm is not None:
        if photos is None:
            raise ParameterError("a ground sampling distance needs a camera (--camera)")
        if altitude is not None:
            raise ParameterError("the height follows from the ground sampling distance; give one of the two")
        if not 0 < gsd_cm <= MAX_GSD_CM:
            raise ParameterError(f"a ground sampling distance is above 0 and at most 100 cm, not {gsd_cm:g}")
        altitude = photos.camera.height_m(gsd_cm / 100, (photos.pitch_deg, *photos.flatter_deg)[-1])
    if altitude is None:
        raise ParameterError("a mission needs --altitude, in metres above home, or --camera and --gsd")
    return altitude


_FIELDS = {  # of an option about a pattern: the field of its parameters, and the patterns that have it
    "hold": ("hold_s", ("visit",)),
    "offset": ("offset_m", ("perimeter",)),
    "min_leg": ("min_leg_m", ("perimeter",)),
    "holes": ("holes", ("perimeter",)),
    "width": ("width_m", ("corridor",)),
    "margin": ("margin_m", ("survey", "corridor", "orbit")),
    "crosshatch": ("crosshatch", ("survey",)),
    "turnaround": ("turnaround_m", ("survey",)),
}


def _pattern_params(pattern: str, options: PatternOptions) -> plan.PatternParams | None:
    """Return the parameters of a pattern; None for an unknown one, which is refused elsewhere."""
    if pattern not in plan.PARAMS_OF:
        return None
    named = {}
    for one in fields(options):
        value = getattr(options, one.name)
        if value is None or value is False:
            continue
        name, patterns = _FIELDS[one.name]
        if pattern not in patterns:
            raise ParameterError(
                f"--{one.name.replace('_', '-')} is for the pattern {' or '.join(patterns)}, not for "
                f"{pattern}; leave it out"
            )
        named[name] = value
    params: plan.PatternParams = plan.PARAMS_OF[pattern](**named)
    return params


def safety_params(options: SafetyOptions) -> plan.SafetyParams:
    """Return the margins and limits of a flight."""
    return plan.SafetyParams(
        avoid_margin_m=options.avoid_margin,
        fence_margin_m=options.fence,
        max_altitude_m=options.max_altitude,  # type: ignore[arg-type]
        max_distance_m=options.max_distance,
        rally=tuple(RallyPoint(*place) for place in options.rally),
        zone_height_m=options.zone_height,
    )


def photos_of(options: PhotoOptions, pattern: str | None = None) -> Photos | None:
    """Return how to photograph with a camera that is named or described; None without one.

    With the pattern "visit", photographs are by default taken in hover. ParameterError is raised if the
    camera is not known, a number is out of bounds, or options do not go together.
    """
    camera = _camera(options)
    if camera is None:
        for name in ("trigger", "shutter", "gimbal_pitch", "overlap"):
            if not np.array_equal(np.ravel(getattr(options, name)), np.ravel(getattr(PhotoOptions(), name))):
                raise ParameterError(
                    f"--{name.replace('_', '-')} needs a camera (--camera, or --sensor, --image and --focal)"
                )
        return None
    overlap = options.overlap
    if len(overlap) != 2:
        raise ParameterError(f"an overlap is two numbers, along the lines and between them, not {overlap!r}")
    trigger = options.trigger or ("hover" if pattern == "visit" else "distance")
    shutter = SHUTTER_S if options.shutter is None else float(options.shutter)
    both = Overlap(float(overlap[0]), float(overlap[1]))
    pitches = sorted(map(float, np.ravel(options.gimbal_pitch)))
    if not pitches:
        raise ParameterError("a gimbal pitch is a number of degrees, or several, not none")
    return Photos(camera, both, pitches[0], trigger, shutter, flatter_deg=tuple(pitches[1:]))


def _camera(options: PhotoOptions) -> Camera | None:
    described = ("sensor", "image", "focal", "min_interval")
    given = [name for name in described if getattr(options, name) is not None]
    if options.camera is not None:
        if given:
            raise ParameterError(
                f"--camera knows its sensor, image and focal length; leave --{given[0].replace('_', '-')} out"
            )
        return camera_named(options.camera)
    if not given:
        return None
    sensor, image, focal = options.sensor, options.image, options.focal
    if sensor is None or image is None or focal is None:
        raise ParameterError("a camera of your own needs all of --sensor WxH, --image WxH and --focal MM")
    if len(sensor) != 2 or len(image) != 2:
        raise ParameterError(f"sensor and image are width and height, not {sensor!r} and {image!r}")
    return Camera(
        name=f"camera of {sensor[0]:g} x {sensor[1]:g} mm",
        sensor_mm=(float(sensor[0]), float(sensor[1])),
        image_px=(_whole(image[0]), _whole(image[1])),
        focal_mm=float(focal),
        min_interval_s=float(options.min_interval or 0.0),
    )


def _whole(side: float) -> int:
    if not float(side).is_integer():
        raise ParameterError(f"an image is whole numbers of pixels, such as 5472x3648, not {side}")
    return int(side)


def _names(given: Any) -> Any:
    """Return one name as a sequence of it."""
    return (given,) if isinstance(given, str) else None if given is None else tuple(given)


def open_regions(
    source: "Path_ | bytes | GeoDataFrame | Regions", layer: str | None = None, widths: Widths | None = None
) -> Regions:
    """Return regions in degrees from a file (a layer of it), the content of one, a frame or another job.

    With `widths`, points and lines are areas or left out, which "notes" of the metadata say. A RegionError
    says that the file cannot be read, has no polygons or not only polygons, or no coordinate system.
    """
    if isinstance(source, Regions):
        return in_degrees(source)
    if isinstance(source, str | os.PathLike | bytes):
        with phase("reading of regions"):
            return read_regions(source, layer, widths=widths)
    if not hasattr(source, "geometry") or not hasattr(source, "columns"):
        raise ParameterError(f"regions is a file of polygons or a GeoDataFrame, not {shown(source)}")
    return regions_of_frame(source, widths=widths)


def widths_of(flight: plan.PlanParams) -> Widths:
    """Return what points and lines of a file of regions are for a flight: visited, followed or left out."""
    how, spacing_m = flight.how, flight.spacing_m or 0.0
    line_m = (how.width_m or spacing_m / 2) if isinstance(how, plan.CorridorParams) else None
    use = "visited" if line_m is None else f"flown along, {line_m:g} m wide (--width)"
    left_out = "not flown, as --pattern visit is for points and --pattern corridor for lines"
    return Widths(POINT_M if flight.pattern == "visit" else None, line_m, use, left_out)


def in_degrees(regions: Regions) -> Regions:
    """Return regions in WGS 84 as GeoJSON has them; OutputError if they have no place on the Earth."""
    polygons: Any = wgs84_geometries(regions)
    return replace(regions, polygons=polygons, wkt="EPSG:4326")


def zone_polygons(options: SafetyOptions, raster: "Source | None" = None) -> tuple[list[Any], list[str]]:
    """Return polygons in degrees of keep-out zones, with notes: of files, frames, or ranges of intensity.

    A range stands for its regions in the raster. A RegionError says that a file cannot be read, a
    ParameterError that the width of points and lines is out of bounds, there is a range and no raster, or it
    finds nothing to keep out of, an OutputError that the raster has no place on the Earth.
    """
    width_m = options.zone_width
    if not MIN_ZONE_M <= width_m <= MAX_ZONE_M:
        raise ParameterError(
            f"the width of zones (--zone-width) is {MIN_ZONE_M:g} to {MAX_ZONE_M:,.0f} m, not {width_m:g}"
        )
    widths = Widths(width_m, width_m, f"kept out of, {width_m:g} m wide (--zone-width)")
    polygons: list[Any] = []
    notes: list[str] = []
    for zone in options.avoid:
        is_file = not isinstance(zone, tuple | list)
        found = open_regions(zone, widths=widths) if is_file else _in_range(zone, raster)
        polygons += list(found.polygons)
        notes += found.metadata.get("notes", [])
    return polygons, notes


def _in_range(ends: Sequence[Any], raster: "Source | None") -> Regions:
    from uavseg.jobs.extract import ExtractRequest, extract
    from uavseg.segmentation.params.segment import IntensityRange

    if len(ends) != 2:
        raise ParameterError(f"a range of intensity is two numbers, such as 0,0.2, not {shown(ends)}")
    if raster is None:
        raise ParameterError(
            f"the keep-out zones {ends[0]:g},{ends[1]:g} are a range of intensity; name the raster in which "
            "they are looked for (--raster)"
        )
    interval = IntensityRange(float(ends[0]), float(ends[1]))
    found = extract(raster, ExtractRequest(interval)).regions
    if not len(found):
        raise ParameterError(
            f"no region of {raster.name} has a mean v in the range {interval.low:g},{interval.high:g} of "
            "--avoid, so there is nothing to keep out of; uavseg info shows which v there are"
        )
    return in_degrees(found)
