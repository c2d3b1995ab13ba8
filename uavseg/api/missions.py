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
from uavseg.flight.mission import Mission
from uavseg.flight.terrain.params import terrain_params
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
    firmware: str = "ardupilot",
    tolerance: float | None = None,
    ids: Sequence[int] | None = None,
    largest: int | None = None,
    where: str | None = None,
    layer: str | None = None,
    camera: str | os.PathLike[str] | Camera | None = None,
    gsd: float | None = None,
    overlap: Sequence[float] = (75.0, 70.0),
    gimbal_pitch: float = -90.0,
    dem: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] | None = None,
    terrain: str | None = None,
    terrain_tolerance: float | None = None,
    climb: float = 2.5,
    descent: float = 1.5,
    allow_path: Folders = (),
    allow_network: bool = False,
) -> Mission:
    """A mission over regions: take off, fly to or over them in a short order, return.

    Parameters
    ----------
    regions : path, bytes or GeoDataFrame
        A file of polygons, the content of one such as GeoJSON, or what `extract` gives.
    altitude : float, optional
        Height of the whole flight above home, or with `dem` above the ground, in metres; with a camera, `gsd`
        may take its place.
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
    firmware : {"ardupilot", "px4"}
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
    dem : path or sequence of paths, optional
        Elevation model: the flight keeps its height above the ground. Several files are one mosaic.
    terrain : {"absolute", "relative", "frame"}, optional
        Heights above the sea (the default with `dem`) or above home, with points added where the ground
        bends; or above the terrain that the vehicle itself knows (ArduPilot), for which `dem` may be missing.
    terrain_tolerance : float, optional
        Metres by which the height above the ground may differ; by default 5, or a quarter of the height
        where that is less.
    climb, descent : float
        How fast the vehicle climbs and descends in forward flight, in metres per second; legs that are too
        steep are flown slower.
    allow_path, allow_network
        As of `extract`.

    Returns
    -------
    mission : Mission
        `uavseg.flight.files.write_mission(mission, "fly.plan")` writes it. Its `warnings` are warnings too.

    Raises
    ------
    RegionError
        If the regions cannot be read, or none is chosen.
    MissionError
        If they are not near home, the elevation model does not cover the flight, or the mission would not be
        safe.
    RasterError
        If the elevation model is not one.
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
    with allowing(allow_path, allow_network):
        flight = flight_params(
            altitude,
            pattern=pattern,
            spacing=spacing,
            angle=_angle(angle),
            speed=speed,
            firmware=firmware,
            tolerance=tolerance,
            photos=photos_of(camera, overlap, gimbal_pitch),
            gsd=gsd,
            terrain=terrain_params(dem, terrain, terrain_tolerance, climb, descent),
        )
        request = PlanRequest(flight, _home(home), ids, largest, where)
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
