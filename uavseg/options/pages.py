"""Options of the jobs that show results, preview, map and serve, and of those about the installation."""

from __future__ import annotations

from typing import Any

from uavseg.options import running, texts
from uavseg.options.flights import DEM, SEVERAL_PATHS, Paths
from uavseg.options.option import Options, argument, group, option
from uavseg.options.reading import ONLY_MAPS, RASTER_STRETCH, AccessOptions, RasterArguments, ReadOptions
from uavseg.options.regions import DivisionOptions
from uavseg.options.running import JobOptions, ProgressOptions, RunOptions, VerbosityOptions, output_option


class PreviewOptions(JobOptions):
    """Picture."""

    rasters: tuple[str, ...] = argument(
        "[RASTER...]", default=(), multiple=True, parse=texts.names_from_standard_input
    )
    regions: Any = option("Regions to outline: a file that extract wrote.", metavar="PATH", basic=True)
    mission: Any = option(
        "Mission to draw, in any format of uavseg plan. May be given several times.", **SEVERAL_PATHS
    )
    states: Any = option(
        "States in colour, segments outlined: what classify wrote.", metavar="PATH", basic=True
    )
    leaves: Any = option("Leaves to outline: the block map that divide wrote.", metavar="PATH", basic=True)
    labels: Any = option(
        "Segments to outline: the labels that original wrote, or another command with --labels.",
        metavar="PATH",
        basic=True,
    )
    levels: Any = option("Levels in grey: the segments that levels wrote.", metavar="PATH", basic=True)
    path: Any = option(
        "A path, views or a drive to draw: .geojson, .plan or .waypoints.", metavar="PATH", basic=True
    )
    dem: Any = option(
        "For missions without RASTER: the ground below them; may be repeated, for a mosaic.",
        **DEM,
    )
    output: Any = output_option("The picture.  [default: STEM.preview.png]", "PATH", False, python=True)
    width: int = option("Width of the picture in pixels.", default=1400, basic=True)
    read: ReadOptions = group(ReadOptions, *ONLY_MAPS, "flatten", stretch={"default": "auto", "basic": False})
    files: running.OverwriteOptions = group(
        running.OverwriteOptions, overwrite={"python": True, "help": "Replace a picture that is there."}
    )


class PictureOptions(Options):
    """Page."""

    size: int = option("Longest side of the picture of the raster, in pixels.", default=2048, basic=True)


class MapOptions(Options):
    """Page."""

    source: RasterArguments = group(RasterArguments)
    regions: Any = option(
        "Regions to show: a file that extract wrote, or any polygons.", metavar="PATH", basic=True
    )
    mission: Any = option(
        "Mission to show, in any format of uavseg plan. May be given several times.", **SEVERAL_PATHS
    )
    camera: Any = option(
        "The camera of the missions, for the footprints of their photographs; uavseg cameras lists them.",
        metavar="NAME|FILE.json",
        basic=True,
    )
    output: Any = output_option("The page.  [default: STEM.map.html here]", "PATH.html", required=False)
    installable: bool = option(
        "Also write STEM.sw.js and STEM.webmanifest beside the page: from a web server (https), a browser "
        "keeps it at the first visit, shows it without network, and can install it.",
        default=False,
    )
    size: PictureOptions = group(PictureOptions)
    read: ReadOptions = group(ReadOptions, *ONLY_MAPS, "flatten", **RASTER_STRETCH)
    division: DivisionOptions = group(DivisionOptions)
    run: RunOptions = group(RunOptions)
    files: running.OverwriteOptions = group(running.OverwriteOptions, overwrite={"python": True})
    messages: VerbosityOptions = group(VerbosityOptions)
    progress: ProgressOptions = group(ProgressOptions)
    access: AccessOptions = group(AccessOptions)


class ServeOptions(Options):
    """Server."""

    source: RasterArguments = group(RasterArguments)
    port: int = option("Port of 127.0.0.1; 0 is any that is free.", default=0, metavar="N", basic=True)
    photos: Paths = option(
        "Photographs that came back from a flight, files or folders: the page shows their footprints. May be "
        "repeated.",
        **SEVERAL_PATHS,
    )
    mission: Any = option(
        "With --photos: the mission that was flown. The page shows what they missed, as regions.",
        metavar="PATH",
        basic=True,
    )
    size: PictureOptions = group(PictureOptions)
    read: ReadOptions = group(ReadOptions, *ONLY_MAPS, "flatten", **RASTER_STRETCH)
    division: DivisionOptions = group(DivisionOptions)
    run: RunOptions = group(RunOptions, resume={"python": False})
    messages: VerbosityOptions = group(VerbosityOptions)
    progress: ProgressOptions = group(ProgressOptions)
    access: AccessOptions = group(AccessOptions)


class CamerasOptions(Options):
    """Cameras."""

    words: tuple[str, ...] = argument("[WORDS]...", default=(), multiple=True)
    as_json: bool = option(
        "Write JSON, for programs; an entry in a file is a camera for --camera.",
        "--json",
        default=False,
        python=False,
        basic=True,
    )


class DoctorOptions(Options):
    """Installation."""

    as_json: bool = option("The same as JSON.", "--json", default=False, python=False, basic=True)


class WarmUpOptions(Options):
    """Warm-up."""

    processes: int | None = option("How many compile at once.  [default: all cores]", metavar="N", basic=True)
    messages: VerbosityOptions = group(VerbosityOptions, "verbose", quiet={"basic": True})
    progress: ProgressOptions = group(ProgressOptions, progress={"basic": True})
