"""Photographs of a flight: the ground that each shows as regions, and a map of them."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.affinity import translate

from uavseg.arrays import Path_
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.execution.executors import Progress, decided, phase, split_progress, threads
from uavseg.flight.camera.camera import camera_named
from uavseg.jobs.source.inputs import keep_inputs
from uavseg.options.missions import FootprintsOptions, GeoreferenceOptions
from uavseg.output.atomic import check_target
from uavseg.photographs.ground import Ground
from uavseg.photographs.orthophoto import Mosaic
from uavseg.photographs.read import Photograph, Taken, read_photographs
from uavseg.raster.elevation.dem import Dem
from uavseg.raster.formats.geotiff import check_geotiff_name, write_image_geotiff
from uavseg.raster.geodesy.globe import WGS84, define_crs, geod_wgs84
from uavseg.raster.grid.geobox import GeoBox
from uavseg.regions.table import Regions


@dataclass(frozen=True)
class Footprints:
    """Regions that photographs show, one for each in the order of their times, and what was assumed."""

    regions: Regions
    warnings: tuple[str, ...]


def footprints(
    photographs: Path_ | Sequence[Path_], options: FootprintsOptions, progress: Progress | None = None
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
    photographs: Path_ | Sequence[Path_], options: FootprintsOptions | GeoreferenceOptions, progress: Progress
) -> tuple[Taken, Ground]:
    """Read photographs, which are files or folders, and open the ground below them."""
    poses = options.poses
    camera = None if poses.camera is None else camera_named(poses.camera)
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


@dataclass(frozen=True)
class Georeferenced:
    """A map that was written, and how far off its places are likely to be (standard deviations)."""

    path: Path
    geobox: GeoBox
    photographs: tuple[str, ...]  # names of those that are drawn
    error_m: float  # in the middle of a photograph
    edge_error_m: float  # where it is largest
    warnings: tuple[str, ...]


def georeference(
    photographs: Path_ | Sequence[Path_], options: GeoreferenceOptions, progress: Progress | None = None
) -> Georeferenced:
    """Write the map of photographs, which are files or folders.

    Errors are those of `footprints`, `Mosaic` and `write_image_geotiff`; besides, a ParameterError says
    that the resolution is not a length, an OutputError that the map would replace what it is made from.
    """
    output, resolution = options.output, options.resolution
    if resolution is not None and not 0 < resolution < float("inf"):
        raise ParameterError(f"resolution is centimetres per pixel, a number above 0, not {resolution:g}")
    check_geotiff_name(output, "a map of photographs")
    check_target(output, options.files.overwrite)
    reading, laying, drawing = split_progress(progress or (lambda done, total: None), 3)
    taken, ground = read_over_ground(photographs, options, reading)
    read = [one.path for one in taken.photographs]
    keep_inputs([output], [photographs, read, options.poses.dem, options.poses.camera])
    mosaic = Mosaic(taken.photographs, ground, None if resolution is None else resolution / 100, laying)
    decided("%d x %d pixels of %g m", *mosaic.geobox.shape, mosaic.geobox.transform.a)
    error_m = float(np.median([view.errors_m[0] for view in mosaic.views]))
    edge_error_m = max(view.errors_m[1] for view in mosaic.views)
    tags = {
        "likely_error_m": f"{error_m:.2f}",
        "likely_error_at_edges_m": f"{edge_error_m:.2f}",
        "ground": "flat" if ground.dem is None else ground.dem.name,
        "photographs": str(len(mosaic.views)),
    }
    with phase("drawing"):
        strips = mosaic.strips(threads(), drawing)
        write_image_geotiff(output, strips, mosaic.geobox, mosaic.types, options.files.overwrite, tags)
    error = (
        f"places are likely off by {error_m:.1f} m in the middle of a photograph, and by up to "
        f"{edge_error_m:.1f} m elsewhere, from the errors of position, height and angles; the lens is taken "
        "to be without distortion"
    )
    return Georeferenced(
        path=Path(output),
        geobox=mosaic.geobox,
        photographs=tuple(Path(view.photograph.path).name for view in mosaic.views),
        error_m=error_m,
        edge_error_m=edge_error_m,
        warnings=(*taken.notes, *mosaic.warnings, error),
    )
