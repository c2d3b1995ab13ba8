"""The ground that each photograph of a flight shows, as regions."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.affinity import translate

from uavseg.arrays import Path_
from uavseg.dataclass import dataclass
from uavseg.execution.executors import Progress, split_progress
from uavseg.flight.camera.camera import Camera, camera_named
from uavseg.options.photographs import FootprintsOptions, GeoreferenceOptions
from uavseg.photographs.ground import Ground
from uavseg.photographs.photograph import Photograph
from uavseg.photographs.read import Taken, read_photographs
from uavseg.raster.elevation.dem import Dem
from uavseg.raster.geodesy.globe import WGS84, define_crs, geod_wgs84
from uavseg.regions.table import Regions


@dataclass(frozen=True)
class Footprints:
    """Regions that photographs show, one for each in the order of their times, and what was assumed."""

    regions: Regions
    warnings: tuple[str, ...]


def footprints(
    photographs: Sequence[Path_], options: FootprintsOptions, progress: Progress | None = None
) -> Footprints:
    """Return the footprints of photographs, which are files or folders.

    A PhotographError says that none can be placed, and why; a ParameterError or MissionError that the camera
    is not known, or the place of takeoff not on Earth.
    """
    reading, laying = split_progress(progress or (lambda done, total: None), 2)
    taken, ground = read_over_ground(photographs, options, reading)
    rows, notes = ground.each(taken.photographs, lambda one: _row(one, ground), laying)
    return Footprints(_regions(rows), (*taken.notes, *notes))


def read_over_ground(
    photographs: Sequence[Path_], options: FootprintsOptions | GeoreferenceOptions, progress: Progress
) -> tuple[Taken, Ground]:
    """Read photographs, which are files or folders, and open the ground below them."""
    poses, camera = options.poses, options.poses.camera
    if camera is not None and not isinstance(camera, Camera):
        camera = camera_named(camera)
    dem = None if poses.dem is None else Dem.open(poses.dem)
    ground = Ground(dem, None if poses.home is None else tuple(poses.home))
    return read_photographs(photographs, progress, camera), ground


def _regions(rows: list[dict[str, Any]]) -> Regions:
    outlines = shapely.orient_polygons([row.pop("geometry") for row in rows])
    inside = shapely.get_coordinates(shapely.point_on_surface(outlines))
    columns: dict[str, Any] = {
        "id": np.arange(1, len(rows) + 1),
        "area_m2": np.array([abs(geod_wgs84().geometry_area_perimeter(one)[0]) for one in outlines]),
    }
    for name, first in rows[0].items():
        columns[name] = np.array([row[name] for row in rows], object if isinstance(first, str) else float)
    columns |= {"lon": inside[:, 0], "lat": inside[:, 1]}
    return Regions(columns, outlines, define_crs(WGS84).wkt2)


def _row(photograph: Photograph, ground: Ground) -> dict[str, Any]:
    """Return the attributes of a footprint, and its outline, cut where it lies across 180 degrees."""
    outline, earth = ground.footprint(photograph), shapely.box(-180, -90, 180, 90)
    if not earth.covers(outline):
        parts = [shapely.intersection(translate(outline, turn), earth) for turn in (-360, 0, 360)]
        outline = shapely.union_all([part for part in parts if part.area > 0])
    height_m, lon, lat = ground.camera_height_m(photograph), photograph.lon, photograph.lat
    [middle] = ground.seen(photograph, np.array([photograph.image_px]) / 2)
    taken_s = photograph.taken_s
    return {
        "photo": Path(photograph.path).name,
        "camera_lon": lon,
        "camera_lat": lat,
        "height_m": height_m - float(ground.heights_m(np.array([lon]), np.array([lat]))[0]),
        "yaw": photograph.yaw_deg % 360,
        "pitch": photograph.pitch_deg,
        "gsd_cm": 100 * math.dist(middle, (0, 0, height_m)) / photograph.focal_px,
        "taken": "" if taken_s is None else str(np.datetime64(round(1000 * taken_s), "ms")),
        "geometry": outline,
    }
