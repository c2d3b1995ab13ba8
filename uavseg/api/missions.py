"""Planning of missions over regions."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

from uavseg.access import Folders, allowing
from uavseg.api._values import warn
from uavseg.arguments import checked
from uavseg.errors import ParameterError
from uavseg.flight.camera.camera import Camera
from uavseg.flight.fence import RallyPoint
from uavseg.flight.limits import LimitParams, SafetyParams
from uavseg.jobs.open_source import open_source
from uavseg.jobs.plan import Home, MissionPlan, PlanRequest, flight_params, photos_of
from uavseg.jobs.plan import plan as run_plan
from uavseg.jobs.plan_regions import open_regions, zone_polygons
from uavseg.plain_text import shown

if TYPE_CHECKING:
    from geopandas import GeoDataFrame


@checked
def plan(
    regions: str | os.PathLike[str] | bytes | GeoDataFrame,
    *,
    altitude: float | None = None,
    home: Sequence[float] | str,
    pattern: str | None = None,
    spacing: float | None = None,
    angle: float | Literal["auto"] = "auto",
    speed: float = 5.0,
    autopilot: str = "ardupilot",
    tolerance: float | None = None,
    ids: Sequence[int] | None = None,
    largest: int | None = None,
    where: str | None = None,
    layer: str | None = None,
    camera: str | os.PathLike[str] | Camera | None = None,
    gsd: float | None = None,
    overlap: Sequence[float] = (75.0, 70.0),
    gimbal_pitch: float = -90.0,
    avoid: Any = (),
    avoid_margin: float = 10.0,
    raster: Any = None,
    endurance: float | None = None,
    reserve: float = 20.0,
    max_items: int | None = None,
    max_altitude: float = 120.0,
    max_distance: float | None = None,
    fence: float | None = 50.0,
    rally: Sequence[Sequence[float]] = (),
    allow_path: Folders = (),
    allow_network: bool = False,
) -> MissionPlan:
    """Missions over regions: take off, fly to or over them in a short order, return.

    Parameters
    ----------
    regions : path, bytes or GeoDataFrame
        A file of polygons, the content of one such as GeoJSON, or what `extract` gives.
    altitude : float, optional
        Height of the whole flight above home, in metres; with a camera, `gsd` may take its place.
    home : (lat, lon), (lat, lon, altitude_m) or "auto"
        Where the vehicle starts, in degrees; the altitude is above the sea. With "auto", near the
        chosen regions and outside of all regions and keep-out zones.
    pattern : {"visit", "perimeter", "survey"}, optional
        A point in each region, its outline, or lines over it; by default "visit", or "survey" with a spacing.
    spacing : float, optional
        Metres between the lines of a survey.
    angle : float or "auto"
        Azimuth of the lines, clockwise from north; with "auto" the one that needs the fewest lines.
    speed : float
        Metres per second.
    autopilot : {"ardupilot", "px4", "generic"}
        What the mission is for; generic: any, with what ArduPilot and PX4 both accept.
    tolerance : float, optional
        Metres by which outlines may be moved to save corners; by default 1, or a pixel where that is larger.
    ids : sequence of int, optional
        Only the regions with these ids.
    largest : int, optional
        Only so many, the largest.
    where : str, optional
        Only those that fulfil a condition, such as "mean > 0.7 and area_m2 > 500".
    layer : str, optional
        The layer of a file that has several.
    camera : str, path or Camera, optional
        Photograph with this camera: a name that `uavseg cameras` lists, or a JSON file. The spacing of lines,
        the distance between photographs and the highest speed follow from it.
    gsd : float, optional
        Ground sampling distance in centimetres per pixel.
    overlap : (float, float)
        Of photographs, along the lines and between them, in per cent.
    gimbal_pitch : float
        Where the camera looks, in degrees; -90 is straight down.
    avoid : path, GeoDataFrame, (low, high), or a sequence of these
        Keep-out zones, which no leg enters: polygons, or a range of intensity that is looked for in `raster`.
    avoid_margin : float
        Least distance to keep-out zones in metres.
    raster : path, sequence of paths, array or DataArray, optional
        Where the ranges of `avoid` are looked for.
    endurance : float, optional
        Minutes in the air on a full battery: the mission is divided into flights that fit.
    reserve : float
        Per cent of the endurance that are left at the end of each flight.
    max_items : int, optional
        Items of a flight at most; by default 650 for "ardupilot", else 500.
    max_altitude, max_distance : float
        Metres; a mission that leads higher above home, or above the ground where it is known, or farther
        from home is refused.
    fence : float, optional
        Metres around each flight at which a fence is written, which excludes keep-out zones; None: no fence.
    rally : sequence of (lat, lon, altitude_m)
        Places to return to in an emergency, with heights above home.
    allow_path, allow_network
        As of `extract`.

    Returns
    -------
    plan : MissionPlan
        `plan.missions`, one for each flight; `plan.write("fly.plan")` writes them. Its `warnings` are
        warnings too.

    Raises
    ------
    RegionError
        If the regions cannot be read, or none is chosen.
    MissionError
        If they are not near home, or the mission would not be safe.
    UavsegError
        If a parameter is wrong.

    Examples
    --------
    >>> import uavseg
    >>> regions = uavseg.extract("tile.tif", range=(0.55, 1))  # doctest: +SKIP
    >>> plan = uavseg.plan(regions, altitude=60, home="auto", spacing=25)  # doctest: +SKIP
    >>> plan.write("fly.plan")  # doctest: +SKIP
    """
    flight = flight_params(
        altitude,
        pattern=pattern,
        spacing=spacing,
        angle=_angle(angle),
        speed=speed,
        autopilot=autopilot,
        tolerance=tolerance,
        photos=photos_of(camera, overlap, gimbal_pitch),
        gsd=gsd,
        limits=LimitParams(endurance, reserve, max_items),
        safety=SafetyParams(
            avoid_margin, fence, max_altitude, max_distance, tuple(RallyPoint(*place) for place in rally)
        ),
    )
    request = PlanRequest(flight, _home(home), ids, largest, where)
    with allowing(allow_path, allow_network):
        found = open_regions(regions, layer)
        zones = zone_polygons(_listed(avoid), None if raster is None else open_source(raster))
        planned = run_plan(found, request, zones)
    warn(planned.warnings)
    return planned


def _listed(avoid: Any) -> Sequence[Any]:
    """Keep-out zones as a sequence; two numbers are one range."""
    if not isinstance(avoid, list | tuple):
        return [avoid]
    numbers = len(avoid) == 2 and all(isinstance(end, int | float) for end in avoid)
    return [avoid] if numbers else avoid


def _angle(given: float | str) -> float | None:
    if not isinstance(given, str):
        return float(given)
    if given != "auto":
        raise ParameterError(f'angle is a number of degrees or "auto", not {shown(given)}')
    return None


def _home(given: Sequence[float] | str) -> Home:
    if isinstance(given, str):
        if given == "auto":
            return "auto"
    elif len(given) in (2, 3):
        return tuple(map(float, given))
    raise ParameterError(f'home is (lat, lon), (lat, lon, altitude_m) or "auto", not {shown(given)}')
