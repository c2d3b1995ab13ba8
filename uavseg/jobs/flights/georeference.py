"""A map of photographs by their pose: read, laid on the ground and written."""

import os
from collections.abc import Sequence
from pathlib import Path

from uavseg.arrays import Path_
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.execution.executors import Progress, decided, phase, split_progress, threads
from uavseg.flight.camera.camera import Camera, camera_named
from uavseg.jobs.source.inputs import keep_inputs
from uavseg.options.photographs import GeoreferenceOptions
from uavseg.output.atomic import check_target
from uavseg.photographs.ground import Ground
from uavseg.photographs.orthophoto import mosaic_of
from uavseg.photographs.read import read_photographs
from uavseg.raster.elevation.dem import Dem
from uavseg.raster.formats.geotiff import check_geotiff_name, write_image_geotiff
from uavseg.raster.grid.geobox import GeoBox


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
    photographs: Sequence[Path_], options: GeoreferenceOptions, progress: Progress | None = None
) -> Georeferenced:
    """Write the map of photographs, which are files or folders.

    Errors are those of `footprints`, `mosaic_of` and `write_image_geotiff`; besides, a ParameterError says
    that the resolution is not a length, an OutputError that the map would replace what it is made from.
    """
    output, overwrite, resolution = options.output, options.files.overwrite, options.resolution
    if resolution is not None and not 0 < resolution < float("inf"):
        raise ParameterError(f"resolution is centimetres per pixel, a number above 0, not {resolution:g}")
    check_geotiff_name(output, "a map of photographs")
    check_target(output, overwrite)
    camera = options.poses.camera
    if camera is not None and not isinstance(camera, Camera):
        camera = camera_named(camera)
    dem = None if options.poses.dem is None else Dem.open(options.poses.dem)
    ground = Ground(dem, None if options.poses.home is None else tuple(options.poses.home))
    reading, laying, drawing = split_progress(progress or (lambda done, total: None), 3)
    taken = read_photographs(photographs, reading, camera)
    read = [one.path for one in taken.photographs]
    keep_inputs([output], [list(photographs), read, options.poses.dem, options.poses.camera])
    mosaic = mosaic_of(taken.photographs, ground, None if resolution is None else resolution / 100, laying)
    names = tuple(Path(view.photograph.path).name for view in mosaic.views)
    decided("%d x %d pixels of %g m", *mosaic.geobox.shape, mosaic.geobox.transform.a)
    error_m, edge_error_m = mosaic.errors_m
    tags = {
        "likely_error_m": f"{error_m:.2f}",
        "likely_error_at_edges_m": f"{edge_error_m:.2f}",
        "ground": "flat" if dem is None else dem.name,
        "photographs": str(len(names)),
    }
    with phase("drawing"):
        strips = mosaic.strips(threads(), drawing)
        write_image_geotiff(output, strips, mosaic.geobox, mosaic.bands + 1, mosaic.dtype, overwrite, tags)
    error = (
        f"places are likely off by {error_m:.1f} m in the middle of a photograph, and by up to "
        f"{edge_error_m:.1f} m elsewhere, from the errors of position, height and angles; the lens is taken "
        "to be without distortion"
    )
    warnings = (*taken.notes, *mosaic.warnings, *(() if dem is None else dem.notes()), error)
    return Georeferenced(
        path=Path(os.fspath(output)),
        geobox=mosaic.geobox,
        photographs=names,
        error_m=error_m,
        edge_error_m=edge_error_m,
        warnings=warnings,
    )
