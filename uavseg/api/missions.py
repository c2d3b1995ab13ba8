"""Missions: plan over regions, check a file, upload to a vehicle and download from it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any, Literal

from uavseg.access import Folders
from uavseg.api._values import job_function, listed_zones, progress_of, warn
from uavseg.arguments import checked
from uavseg.arrays import GeoDataFrame
from uavseg.flight.camera.camera import Camera
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.vehicle import Vehicle
from uavseg.jobs.flights.check import MissionCheck, check as run_check, check_request
from uavseg.jobs.flights.link import Progress, download as run_download, upload as run_upload
from uavseg.jobs.flights.plan import MissionPlan, plan as run_plan, resume as run_resume
from uavseg.jobs.flights.request import open_regions, plan_request, widths_of, zone_polygons
from uavseg.jobs.source.open_source import open_source
from uavseg.options.flights import PlanOptions
from uavseg.options.missions import CheckOptions
from uavseg.options.option import build


@job_function
def plan(
    regions: str | os.PathLike[str] | bytes | GeoDataFrame,
    *,
    altitude: float | None = None,
    home: Sequence[float] | str,
    pattern: str | None = None,
    spacing: float | None = None,
    angle: float | Literal["auto"] = "auto",
    speed: float = 5.0,
    wind: float | Sequence[float] | None = None,
    autopilot: str = "ardupilot",
    tolerance: float | None = None,
    ids: Sequence[int] | None = None,
    largest: int | None = None,
    where: str | None = None,
    classes: str | Sequence[str] | None = None,
    layer: str | None = None,
    camera: str | os.PathLike[str] | Camera | None = None,
    gsd: float | None = None,
    overlap: Sequence[float] = (75.0, 70.0),
    gimbal_pitch: float | Sequence[float] = -90.0,
    vehicle: str | os.PathLike[str] | Vehicle | None = None,
    sensor: Sequence[float] | None = None,
    image: Sequence[float] | None = None,
    focal: float | None = None,
    min_interval: float | None = None,
    trigger: str | None = None,
    shutter: float | None = None,
    margin: float | None = None,
    width: float | None = None,
    crosshatch: bool = False,
    turnaround: float | None = None,
    offset: float | None = None,
    min_leg: float | None = None,
    holes: str | None = None,
    hold: float | None = None,
    avoid: Any = (),
    avoid_classes: str | Sequence[str] = (),
    avoid_margin: float = 10.0,
    zone_width: float = 10.0,
    zone_height: float | None = None,
    raster: Any = None,
    allow_edge: bool = False,
    endurance: float | None = None,
    reserve: float = 20.0,
    max_items: int | None = None,
    max_waypoints: int | None = None,
    flights: int | None = None,
    vehicles: int = 1,
    max_altitude: float = 120.0,
    max_distance: float | None = None,
    fence: float | None = 50.0,
    rally: Sequence[Sequence[float]] = (),
    dem: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] | None = None,
    terrain: str | None = None,
    terrain_tolerance: float | None = None,
    climb: float | None = None,
    descent: float | None = None,
    allow_path: Folders = (),
    allow_network: bool = False,
) -> MissionPlan:
    """Missions over regions: take off, fly to or over them in a short order, return.

    Parameters
    ----------
    regions : path, bytes or GeoDataFrame
        A file of polygons, the content of one such as GeoJSON, or what `extract` gives. With the pattern
        "visit" points are flown to as well, with "corridor" lines are followed.
    altitude : float, optional
        Height of the whole flight above home, or with `dem` above the ground, in metres; with a camera, `gsd`
        may take its place.
    home : (lat, lon), (lat, lon, altitude_m) or "auto"
        Where the vehicle starts, in degrees; the altitude is above the sea. With "auto", near the
        chosen regions and outside of all regions and keep-out zones.
    pattern : {"visit", "perimeter", "survey", "corridor", "orbit"}, optional
        A point in each region, its outline, parallel lines over it, lines along its middle, or a circle
        around it; by default "visit", or "survey" with a spacing or a camera.
    spacing : float, optional
        Metres between the lines of a survey or corridor.
    angle : float or "auto"
        Azimuth of the lines, clockwise from north; with "auto" the one of the least time.
    speed : float
        Metres per second.
    wind : float or (float, float), optional
        Wind to plan and estimate for, in metres per second, and the azimuth that it comes from; by default
        the direction in which the flight takes longest. Without it, estimates are for calm air, and with an
        endurance flights are divided for 5 m/s from any direction.
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
    classes : str or sequence of str, optional
        Only regions of these classes, see `extract`.
    layer : str, optional
        The layer of a file that has several.
    camera : str, path or Camera, optional
        Photograph with this camera: a name that `uavseg cameras` lists, or a JSON file. The spacing of lines,
        the distance between photographs and the highest speed follow from it.
    gsd : float, optional
        Ground sampling distance in centimetres per pixel.
    overlap : (float, float)
        Of photographs, along the lines and between them, in per cent.
    gimbal_pitch : float or sequence of float
        Where the camera looks, in degrees; -90 is straight down. A survey with several, such as (-90, -60),
        is flown once for -90, and for each that is tilted from four sides, on lines that begin outside.
    vehicle : path or Vehicle, optional
        What flies, for the estimates of time and energy: a JSON file with parameters of
        `uavseg.flight.mission.vehicle.Vehicle`. By default a multirotor with those of its autopilot.
    sensor, image : (float, float), optional
        In place of a camera: width and height of its sensor in millimetres and of its image in pixels.
    focal, min_interval : float, optional
        With them: the focal length in millimetres, and the shortest time between photographs in seconds.
    trigger : {"distance", "interval", "hover", "none"}, optional
        Photographs by distance, by time, in hover at a waypoint for each, or not by the mission; by default
        by distance, and in hover on a visit.
    shutter : float, optional
        Exposure time in seconds, by which motion blur limits the speed; by default 1/1000.
    margin : float, optional
        Metres by which a survey or corridor grows regions before it covers them, or between a region and the
        circle of an orbit around it.
    width : float, optional
        For a corridor: the width of lines of the file in metres; by default half of the spacing.
    crosshatch : bool
        For a survey: once more, in lines at a right angle to the first.
    turnaround : float, optional
        For a survey: metres straight on without photographs before and after each line, for fixed wings.
    offset : float, optional
        For a perimeter: metres outward from the outline, negative inward.
    min_leg : float, optional
        For a perimeter: no leg is shorter; by default what is flown in a second.
    holes : {"skip", "fly"}, optional
        For a perimeter: whether the outlines of holes are flown.
    hold : float, optional
        For a visit: seconds over each region.
    avoid : path, GeoDataFrame, (low, high), or a sequence of these
        Keep-out zones, which no leg enters: polygons, lines, points, or a range of intensity in `raster`.
    avoid_classes : str or sequence of str
        Regions of these classes are keep-out zones too.
    avoid_margin : float
        Least distance of the vehicle to them in metres; legs keep farther away, see `Vehicle.deviation_m`.
    zone_width : float
        Metres: the width of lines and the diameter of points in `avoid`.
    zone_height : float, optional
        Metres above home of all zones: a flight that is higher by the margin, and 5 m at least, may pass over
        them. By default they reach to the sky, as they have to where the flight follows the ground.
    raster : path, sequence of paths, array, DataArray or open raster of rasterio, optional
        Where the ranges of `avoid` are looked for, and home "auto" lies on a valid pixel. Regions that touch
        its edge are left out: they may go on beyond it, or be a collar.
    allow_edge : bool
        Whether regions that touch the edge of `raster` are flown over all the same.
    endurance : float, optional
        Minutes in the air on a full battery: the mission is divided into flights that fit.
    reserve : float
        Per cent of the endurance that are left at the end of each flight.
    max_items : int, optional
        Items of a flight at most; by default 650 for "ardupilot", else 500.
    max_waypoints : int, optional
        Waypoints of a flight at most, for files that are read by waypoints: 99 for Litchi.
    flights : int, optional
        Divide into so many flights of like length; by default the fewest that fit.
    vehicles : int
        Divide for so many vehicles in the air at once: each has its own part of the area and its own height,
        5 m above the one before, and all take about as long.
    max_altitude, max_distance : float
        Metres; a mission that leads higher above home, or above the ground where it is known, or farther
        from home is refused.
    fence : float, optional
        Metres around each flight at which a fence is written, which excludes keep-out zones; None: no fence.
    rally : sequence of (lat, lon, altitude_m)
        Places to return to in an emergency, with heights above home.
    dem : path or sequence of paths, optional
        Elevation model: the flight keeps its height above the ground. Several files are one mosaic.
    terrain : {"absolute", "relative", "frame"}, optional
        Heights above the sea (the default with `dem`) or above home, with points added where the ground
        bends; or above the terrain that the vehicle itself knows (ArduPilot), for which `dem` may be missing.
    terrain_tolerance : float, optional
        Metres by which the height above the ground may differ; by default 5, or a quarter of the height
        where that is less.
    climb, descent : float, optional
        How fast the vehicle climbs and descends in forward flight, in metres per second; legs that are too
        steep are flown slower. By default as the autopilot has it, 2.5 (3 for "px4") and 1.5.
    allow_path, allow_network
        As of `extract`.

    Returns
    -------
    plan : MissionPlan
        `plan.missions`, one for each flight; `plan.write("fly.plan")` writes them. Its `warnings` are
        warnings too; the `estimate` of each has time, photographs and energy.

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
    >>> regions = uavseg.extract("tile.tif", range=(0.55, 1))  # doctest: +SKIP
    >>> plan = uavseg.plan(regions, altitude=60, home="auto", spacing=25)  # doctest: +SKIP
    >>> plan.write("fly.plan")  # doctest: +SKIP
    """
    options = build(PlanOptions, locals() | {"avoid": listed_zones(avoid)})
    request = plan_request(options)
    found = open_regions(regions, layer, widths_of(request.flight))
    source = None if raster is None else open_source(raster)
    zones, notes = zone_polygons(options.mission.safety, source)
    return run_plan(found, request, zones, source, notes)


@job_function
def check(
    mission: str | os.PathLike[str] | Mission,
    *,
    autopilot: str | None = None,
    avoid: Any = (),
    avoid_margin: float = 10.0,
    zone_width: float = 10.0,
    zone_height: float | None = None,
    max_altitude: float | None = None,
    max_distance: float | None = None,
    wind: float | Sequence[float] | None = None,
    dem: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] | None = None,
    photos: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] | None = None,
    regions: str | os.PathLike[str] | GeoDataFrame | None = None,
    camera: str | os.PathLike[str] | Camera | None = None,
    home: Sequence[float] | None = None,
    allow_path: Folders = (),
    allow_network: bool = False,
) -> MissionCheck:
    """Read a mission file back, and say what it holds, who would refuse it and whether it is safe.

    Parameters
    ----------
    mission : path or Mission
        A .plan, .waypoints, .kml, .geojson, .kmz or .csv file, or what `plan` gives.
    autopilot : {"ardupilot", "px4", "generic"}, optional
        What it is checked for; by default what the file is for, if its format says so.
    avoid : path, GeoDataFrame, or a sequence of these
        Keep-out zones, which no leg and no rally point may come near to.
    avoid_margin : float
        Least distance of legs to them in metres.
    zone_width, zone_height : float, optional
        As of `plan`; over zones pass only missions whose heights are all above home.
    max_altitude, max_distance : float, optional
        Metres that the mission must not exceed, above home or with `dem` above the ground, and from home.
    wind : float or (float, float), optional
        Wind that the flight is estimated for, as of `plan`; by default the air is calm.
    dem : path or sequence of paths, optional
        Elevation model: no leg comes nearer to the ground than 5 m, and photographs show this ground. Several
        files are one mosaic.
    photos : path or sequence of paths, optional
        Photographs that came back from the flight, folders of them with their subfolders, or with `camera`
        the log of the flight (.bin of ArduPilot, .ulg of PX4).
    regions : path or GeoDataFrame, optional
        Polygons that the photographs should show; by default what the mission plans to show, without a rim of
        5 % of a photograph, by which positions may be off.
    camera : str, path or Camera, optional
        Camera of the photographs that were taken and are planned; by default the focal length in the files.
    home : (lat, lon) or (lat, lon, altitude_m), optional
        Place of takeoff in degrees, and its height above the sea; by default home of the mission.
    allow_path, allow_network
        As of `extract`.

    Returns
    -------
    found : MissionCheck
        Its `problems` are why the mission must not be flown, or that photographs show less than 99.9 % of the
        area, its `verdicts` who takes it; `as_dict()` is what `uavseg check --json` prints. With photographs,
        `coverage` is what they show, and `gaps` a GeoDataFrame of the rest, which `plan` takes. Its
        `warnings` are warnings too.

    Raises
    ------
    MissionError
        If the file cannot be read, or holds a mission that would not be safe: which item, and why; or what it
        plans to show is not known.
    PhotographError
        If photographs cannot be read, none can be placed, or none was taken near the mission.
    UavsegError
        If zones or an elevation model cannot be read, or a parameter is wrong.

    Examples
    --------
    >>> import uavseg
    >>> uavseg.check("fly.plan", autopilot="px4").problems  # doctest: +SKIP
    ()
    """
    options = build(CheckOptions, locals() | {"avoid": listed_zones(avoid)})
    return run_check(mission, check_request(options))


@job_function
def resume(
    mission: str | os.PathLike[str] | Mission, *, start: str | os.PathLike[str] | float | Sequence[float]
) -> MissionPlan:
    """Plan the rest of a mission whose flight was cut.

    The flight takes off as before, flies level to the last photograph, takes it again and goes on with what
    is left. Speed, camera, gimbal and servos are set as they were at the cut; fence and rally points stay.

    Parameters
    ----------
    mission : path or Mission
        A .plan, .waypoints, .kml, .geojson, .kmz or .csv file, or one of those that `plan` gives.
    start : (lat, lon), float or path
        Where the flight was cut: a place in degrees, at most 100 m from the path; or the item that it flew
        to, as the vehicle counts it (home is 0 and takeoff 1; with PX4, takeoff is 0), or 12.4 where 40 % of
        the leg to item 12 were flown; or the log of the flight, a .bin of ArduPilot or a .ulg of PX4.

    Returns
    -------
    plan : MissionPlan
        With one mission; `plan.write("rest.plan")` writes it. Its `warnings` are warnings too.

    Raises
    ------
    MissionError
        If mission or log cannot be read or do not match, nothing is left, or the rest would not be safe.
    MissingLibraryError
        If pyulog is not installed, for a .ulg.
    ParameterError
        If `start` is none of these.

    Examples
    --------
    >>> import uavseg
    >>> uavseg.resume("survey.plan", start=12.4).write("rest.plan")  # doctest: +SKIP
    """
    return run_resume(mission, start)


@checked
def upload(
    mission: str | os.PathLike[str] | Mission,
    *,
    connect: str,
    timeout: float = 10.0,
    while_armed: bool = False,
    progress: Progress | bool | None = None,
) -> None:
    """Send a mission to a vehicle with its fence and rally points, read them back and compare.

    What a vehicle is sent are heartbeats of a ground station and the MAVLink mission protocol: nothing arms
    or starts it. A fence and rally points that the mission does not have are left as they are.

    Parameters
    ----------
    mission : path or Mission
        A .plan or .waypoints file, or what `plan` gives.
    connect : str
        Where the vehicle is: udpout:HOST:PORT, udpin:HOST:PORT, tcp:HOST:PORT or serial:DEVICE[:BAUD].
    timeout : float
        Seconds to wait for an answer, and without progress.
    while_armed : bool
        Whether the mission of a vehicle whose motors are armed may be replaced: it may be flying, and
        ArduPilot replaces the items one by one. Otherwise nothing is sent to it.
    progress : callable, optional
        Called with (done, total) for each item that is sent or read back.

    Raises
    ------
    MissionError
        If the file cannot be read, or the mission is for another autopilot.
    UnverifiedError
        If the vehicle accepted the mission, which could then not be read back.
    LinkError
        If the vehicle is armed, cannot be reached, refuses, falls silent, is not alone on the link, or holds
        something else afterwards.

    Examples
    --------
    >>> import uavseg
    >>> uavseg.upload("fly.plan", connect="udpout:192.168.4.1:14550")  # doctest: +SKIP
    """
    warn(run_upload(mission, connect, timeout, progress_of(progress), while_armed).warnings)


@checked
def download(*, connect: str, timeout: float = 10.0, progress: Progress | bool | None = None) -> Mission:
    """Read the mission that a vehicle holds, with its fence and rally points.

    Parameters
    ----------
    connect : str
        Where the vehicle is: udpout:HOST:PORT, udpin:HOST:PORT, tcp:HOST:PORT or serial:DEVICE[:BAUD].
    timeout : float
        Seconds to wait for an answer, and without progress.
    progress : callable, optional
        Called with (done, total) for each item of a list.

    Returns
    -------
    mission : Mission
        Its `warnings` are warnings too.

    Raises
    ------
    MissionError
        If the vehicle holds no mission, or one that would not be safe.
    LinkError
        If the vehicle cannot be reached, refuses, falls silent, or is not alone on the link.
    """
    found = run_download(connect, timeout, progress_of(progress))
    warn(found.warnings)
    return found.mission
