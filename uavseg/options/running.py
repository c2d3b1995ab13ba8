"""Options that say how a job is run, what it writes and reports, and what it may open."""

from __future__ import annotations

import os
from typing import Any

from uavseg.options.option import Options, group, option
from uavseg.options.reading import AccessOptions


def output_option(help: str, metavar: str, required: bool = True, python: bool = False) -> Any:
    """Declare the option for the file that a command writes."""
    return option(help, "-o", "--output", required=required, metavar=metavar, python=python, basic=True)


class StorageOptions(Options):
    """Storage."""

    creation_options: tuple[str, ...] = option(
        "How a GeoTIFF is stored: COMPRESS=DEFLATE, LZW, ZSTD, LZMA, PACKBITS or NONE, ZLEVEL, ZSTD_LEVEL, "
        "PREDICTOR, BIGTIFF; several times for several. Its pixels stay the same.",
        "--co",
        default=(),
        multiple=True,
        metavar="NAME=VALUE",
        python=False,
    )


class RegionOutputs(Options):
    """Output."""

    output: str | None = output_option(
        "The regions: .geojson, .gpkg, .fgb, .parquet, .shp or .kml; - is GeoJSON on stdout.  "
        "[default: STEM.regions.geojson here]",
        "PATH",
        required=False,
    )
    labels: str | None = option(
        "Also write the labels of the regions as a raster: one .tif, or a .vrt over a folder of tiles.",
        metavar="PATH",
        python=False,
    )
    crs: str | None = option(
        "The CRS of the regions in .gpkg, .fgb, .parquet, .shp and with --projected, such as EPSG:2056.  "
        "[default: that of the raster]",
        metavar="CRS",
        python=False,
    )
    style: str | None = option(
        "Also write a style for GIS programs beside the regions: STEM.qml, with which QGIS shows them, or "
        "STEM.sld.",
        choices=("qml", "sld"),
        python=False,
    )
    sequence: bool | None = option(
        "With -o -: one feature a line, or one collection.  [default: collection]",
        "--sequence/--collection",
        python=False,
    )
    rs: bool = option(
        "With -o -: a sequence with the character RS before each feature.", default=False, python=False
    )
    geographic: bool | None = option(
        "With -o -: longitude and latitude, or the CRS of the raster.  [default: geographic]",
        "--geographic/--projected",
        python=False,
    )


class EachOptions(Options):
    """Each of many rasters."""

    each: bool = option(
        "Each raster by itself, to an output of its own: -o 'out/{stem}.gpkg'. {stem} is its name without "
        "folder and extension, {name} with its extension, {suffix} the extension, {parent} the name of its "
        "folder, {number} its place. What fails does not stop the others.",
        default=False,
        python=False,
    )
    report: str | None = option(
        "With --each: also a table of what came out of each.", metavar="PATH.csv", python=False
    )
    skip_existing: bool = option(
        "With --each: leave out rasters whose output is there, so that a run goes on.",
        default=False,
        python=False,
    )


class RunOptions(Options):
    """Running; changes no result."""

    tile: int | None = option("Side of a tile, a multiple of 64.", metavar="PIXELS")
    threads: int | None = option("Threads to work with.  [default: all cores]", metavar="N", label="Threads")
    scheduler: str | None = option(
        "Let the workers of a dask.distributed scheduler do the work.",
        metavar="tcp://HOST:PORT",
        python=False,
    )
    resume: str | os.PathLike[str] | None = option(
        "Keep finished tiles in this folder, and take up those that are there, so that a run that was "
        "stopped goes on where it stopped. Remove the folder when you are done.",
        metavar="DIR",
    )


class VerbosityOptions(Options):
    """Messages."""

    quiet: bool = option("Say nothing but errors.", "-q", "--quiet", default=False, python=False)
    verbose: bool = option(
        "Say what was decided, and how long it took.", "-v", "--verbose", default=False, python=False
    )


class ProgressOptions(Options):
    """Progress."""

    progress: str = option(
        "A bar on a terminal; plain: lines 'progress NN' on stderr, for programs.",
        default="auto",
        choices=("auto", "plain", "none"),
        python=False,
    )


class OverwriteOptions(Options):
    """Files."""

    overwrite: bool = option("Replace files that are there.", default=False, python=False, basic=True)


class JobOptions(Options):
    """What jobs have in common, listed after their own options."""

    messages: VerbosityOptions = group(VerbosityOptions)
    access: AccessOptions = group(AccessOptions)


class TiledJobOptions(Options):
    """What jobs that work tile by tile have in common, listed after their own options."""

    run: RunOptions = group(RunOptions)
    files: OverwriteOptions = group(OverwriteOptions)
    messages: VerbosityOptions = group(VerbosityOptions)
    progress: ProgressOptions = group(ProgressOptions)
    access: AccessOptions = group(AccessOptions)
