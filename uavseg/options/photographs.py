"""Options of photographs from the air: the ground that they show, and their camera."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

from uavseg.options import texts
from uavseg.options.flights import Paths
from uavseg.options.option import Options, argument, group, option
from uavseg.options.reading import AccessOptions
from uavseg.options.running import OverwriteOptions, ProgressOptions, VerbosityOptions, output_option

if TYPE_CHECKING:
    from uavseg.flight.camera.camera import Camera


class PoseOptions(Options):
    """Ground and camera."""

    dem: Paths = option(
        "Elevation model of the ground; may be repeated, for a mosaic.  [default: flat ground, at the height "
        "of takeoff]",
        metavar="DEM.tif",
        multiple=True,
        parse=texts.or_none,
        basic=True,
        label="Elevation model",
    )
    home: Sequence[float] | None = option(
        "Place of takeoff, and its metres above the sea: over an elevation model, heights are then those "
        "above takeoff, not altitudes.",
        metavar="LAT,LON[,M]",
        parse=texts.numbers("--home is LAT,LON or LAT,LON,M in degrees and metres"),
        basic=True,
    )
    camera: str | os.PathLike[str] | Camera | None = option(
        "All were taken with this camera. uavseg cameras lists them.  [default: the focal length in the "
        "files]",
        metavar="NAME|FILE.json",
        basic=True,
        label="Camera",
    )


class PhotographOptions(Options):
    """Photographs."""

    photographs: tuple[str, ...] = argument("PHOTO", multiple=True, required=True)
    poses: PoseOptions = group(PoseOptions)
    messages: VerbosityOptions = group(VerbosityOptions)
    progress: ProgressOptions = group(ProgressOptions)
    access: AccessOptions = group(AccessOptions)


class FootprintsOptions(PhotographOptions):
    """Footprints."""

    output: str = output_option(
        "The footprints: .geojson, .gpkg, .fgb, .parquet, .shp or .kml; - is GeoJSON on stdout.", "PATH"
    )
    files: OverwriteOptions = group(OverwriteOptions)


class GeoreferenceOptions(PhotographOptions):
    """Map."""

    output: str | os.PathLike[str] = output_option(
        "The map: a GeoTIFF in the UTM zone of the place, with an alpha band.", "PATH.tif", python=True
    )
    resolution: float | None = option(
        "Side of a pixel in centimetres.  [default: that of the photographs in their middle]",
        metavar="CM",
        basic=True,
        label="Side of a pixel in cm",
    )
    files: OverwriteOptions = group(OverwriteOptions, overwrite={"python": True})
