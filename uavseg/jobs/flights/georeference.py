"""A map of photographs by their pose: read, laid on the ground and written."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from uavseg.arrays import Path_
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.execution.executors import Progress, decided, phase, split_progress, threads
from uavseg.jobs.flights.footprints import read_over_ground
from uavseg.jobs.source.inputs import keep_inputs
from uavseg.options.photographs import GeoreferenceOptions
from uavseg.output.atomic import check_target
from uavseg.photographs.orthophoto import Mosaic
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
    keep_inputs([output], [list(photographs), read, options.poses.dem, options.poses.camera])
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
