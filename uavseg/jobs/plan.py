"""Planning of a mission over regions: which of them, from where, and how to fly."""

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

from uavseg.errors import MissionError, ParameterError
from uavseg.flight.camera.camera import Camera, Overlap
from uavseg.flight.camera.catalogue import camera_named
from uavseg.flight.camera.photos import Photos
from uavseg.flight.mission import Mission
from uavseg.flight.params import PlanParams
from uavseg.flight.planner import plan_mission
from uavseg.flight.terrain.params import TerrainParams
from uavseg.plain_text import shown
from uavseg.regions.select.choose import select_regions
from uavseg.regions.table import Regions

if TYPE_CHECKING:
    from geopandas import GeoDataFrame

MAX_GSD_CM = 100.0

Home = tuple[float, ...] | Literal["auto"]


@dataclass(frozen=True, slots=True)
class PlanRequest:
    """How to fly, from where, and over which of the regions.

    Parameters
    ----------
    flight : PlanParams
    home : (lat, lon), (lat, lon, altitude_m) or "auto"
        Where the vehicle starts; with "auto", inside the first chosen region.
    ids : sequence of int, optional
        Only the regions with these ids.
    largest : int, optional
        Only so many, the largest.
    where : str, optional
        Only those that fulfil a condition, see `uavseg.regions.select.where`.
    """

    flight: PlanParams
    home: Home
    ids: Sequence[int] | None = None
    largest: int | None = None
    where: str | None = None

    @property
    def chooses(self) -> bool:
        """Whether some regions are left out."""
        return any(choice is not None for choice in (self.ids, self.largest, self.where))


@dataclass(frozen=True)
class Planned:
    """A mission, and over how many regions it leads."""

    mission: Mission
    regions: int

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the person who flies it should know."""
        return self.mission.warnings


def plan(regions: Regions, request: PlanRequest) -> Planned:
    """A mission over regions: take off, fly their pattern in a short order, return.

    Parameters
    ----------
    regions : Regions
        In degrees (lon, lat; WGS 84), see `open_regions` and `in_degrees`.
    request : PlanRequest

    Raises
    ------
    RegionError
        If none of the regions is chosen.
    MissionError
        If there are no regions, if they are not near home, or if the mission would not be safe.
    """
    if request.chooses:
        regions = select_regions(regions, request.ids, request.largest, request.where)
    points = list(zip(regions.columns["lon"].tolist(), regions.columns["lat"].tolist(), strict=True))
    home = _first(points) if request.home == "auto" else request.home
    return Planned(plan_mission(list(regions.polygons), points, request.flight, home), len(regions))


def flight_params(
    altitude: float | None,
    *,
    pattern: str | None = None,
    spacing: float | None = None,
    angle: float | None = None,
    speed: float = 5.0,
    firmware: str = "ardupilot",
    tolerance: float | None = None,
    photos: Photos | None = None,
    gsd: float | None = None,
    terrain: TerrainParams | None = None,
) -> PlanParams:
    """How to fly; without a pattern, regions are visited, or surveyed where a spacing or camera is given.

    With a camera, the height follows from the ground sampling distance (`gsd`, centimetres) where that is
    given, and the spacing from the overlap.

    Raises
    ------
    ParameterError
        If a value is out of bounds, or values do not go together.
    """
    if gsd is not None:
        if photos is None:
            raise ParameterError("a ground sampling distance needs a camera (--camera)")
        if altitude is not None:
            raise ParameterError("the height follows from the ground sampling distance; give one of the two")
        if not 0 < gsd <= MAX_GSD_CM:
            raise ParameterError(f"a ground sampling distance is above 0 and at most 100 cm, not {gsd:g}")
        altitude = photos.camera.height_m(gsd / 100, photos.pitch_deg)
    if altitude is None:
        raise ParameterError("a mission needs --altitude, in metres above home, or --camera and --gsd")
    surveyed = pattern == "survey" or (pattern is None and (spacing is not None or photos is not None))
    if photos is not None and surveyed and 0 < altitude < math.inf:
        spacing = photos.spacing_m(altitude) if spacing is None else spacing
    return PlanParams(
        altitude_m=altitude,
        pattern=pattern or ("survey" if surveyed else "visit"),
        spacing_m=spacing,
        angle_deg=angle,
        speed_m_s=speed,
        firmware=firmware,
        tolerance_m=tolerance,
        photos=photos,
        terrain=terrain,
    )


def photos_of(
    camera: str | os.PathLike[str] | Camera | None,
    overlap: Sequence[float] = (75.0, 70.0),
    gimbal_pitch: float = -90.0,
) -> Photos | None:
    """How to photograph with a camera that is named; None without one.

    Parameters
    ----------
    camera : str, path or Camera, optional
        A name of the catalogue, or a JSON file; see `uavseg.flight.camera.catalogue`.
    overlap : (float, float)
        Along the lines and between them, in per cent.
    gimbal_pitch : float
        Degrees; -90 is straight down.

    Raises
    ------
    ParameterError
        If the camera is not known, or a number is out of bounds.
    """
    if camera is None:
        return None
    if len(overlap) != 2:
        raise ParameterError(f"an overlap is two numbers, along the lines and between them, not {overlap!r}")
    found = camera if isinstance(camera, Camera) else camera_named(camera)
    return Photos(found, Overlap(float(overlap[0]), float(overlap[1])), float(gimbal_pitch))


def open_regions(
    source: "str | os.PathLike[str] | bytes | GeoDataFrame | Regions", layer: str | None = None
) -> Regions:
    """Regions in degrees from a file, from the content of one, from a frame or from another job.

    Parameters
    ----------
    source : path, bytes, GeoDataFrame or Regions
    layer : str, optional
        Which layer of a file.

    Raises
    ------
    RegionError
        If the file cannot be read, has no polygons or not only polygons, or no coordinate system.
    """
    if isinstance(source, Regions):
        return in_degrees(source)
    from uavseg.regions.formats import read

    if isinstance(source, str | os.PathLike | bytes):
        return read.read_regions(source, layer)
    if not hasattr(source, "geometry") or not hasattr(source, "columns"):
        raise ParameterError(f"regions is a file of polygons or a GeoDataFrame, not {shown(source)}")
    return read.regions_of_frame(source)


def in_degrees(regions: Regions) -> Regions:
    """Regions of a raster in WGS 84, with the coordinates that GeoJSON gets.

    Raises
    ------
    OutputError
        If they have no place on the Earth.
    """
    from uavseg.regions.wgs84.to_wgs84 import wgs84_geometries

    polygons: Any = wgs84_geometries(regions)
    return replace(regions, polygons=polygons, wkt="EPSG:4326")


def _first(points: Sequence[tuple[float, float]]) -> tuple[float, ...]:
    """Home in the first region."""
    if not points:
        raise MissionError("there is no region to fly to; choose at least one")
    return points[0][1], points[0][0]
