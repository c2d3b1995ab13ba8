"""Planning of missions over regions."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

from uavseg.access import Folders, allowing
from uavseg.api._values import warn
from uavseg.arguments import checked
from uavseg.errors import ParameterError
from uavseg.flight.camera.camera import Camera
from uavseg.flight.estimate.vehicle import Vehicle
from uavseg.flight.mission import Mission
from uavseg.jobs.plan import Home, PlanRequest, flight_params, open_regions, photos_of
from uavseg.jobs.plan import plan as run_plan
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
    vehicle: str | os.PathLike[str] | Vehicle | None = None,
    allow_path: Folders = (),
    allow_network: bool = False,
) -> Mission:
    """A mission over regions: take off, fly to or over them in a short order, return.

    Parameters
    ----------
    regions : path, bytes or GeoDataFrame
        A file of polygons, the content of one such as GeoJSON, or what `extract` gives.
    altitude : float, optional
        Height of the whole flight above home, in metres; with a camera, `gsd` may take its place.
    home : (lat, lon), (lat, lon, altitude_m) or "auto"
        Where the vehicle starts, in degrees; the altitude is above the sea. With "auto", inside the first
        chosen region.
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
    vehicle : path or Vehicle, optional
        What flies, for the estimates of time and energy: a JSON file with parameters of
        `uavseg.flight.estimate.vehicle.Vehicle`. By default a multirotor with those of its autopilot.
    allow_path, allow_network
        As of `extract`.

    Returns
    -------
    mission : Mission
        `uavseg.flight.files.write_mission(mission, "fly.plan")` writes it. Its `warnings` are warnings too;
        its `estimate` has time, photographs and energy.

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
    >>> from uavseg.flight.files import write_mission
    >>> regions = uavseg.extract("tile.tif", range=(0.55, 1))  # doctest: +SKIP
    >>> mission = uavseg.plan(regions, altitude=60, home="auto", spacing=25)  # doctest: +SKIP
    >>> write_mission(mission, "fly.plan")  # doctest: +SKIP
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
        vehicle=vehicle,
    )
    request = PlanRequest(flight, _home(home), ids, largest, where)
    with allowing(allow_path, allow_network):
        planned = run_plan(open_regions(regions, layer), request)
    warn(planned.warnings)
    return planned.mission


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
