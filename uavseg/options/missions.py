"""Options of missions that are there, and of photographs from the air: their ground, and their camera."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from uavseg.options import flights, running, texts
from uavseg.options.flights import AUTOPILOTS, MissionFileOptions, Paths, SafetyOptions, TerrainOptions
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
        basic=True,
        label="Elevation model",
        **flights.DEM,
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


class CheckOptions(running.JobOptions):
    """Check."""

    file: str = argument("FILE", required=True)
    autopilot: str | None = option(
        "What it is checked for.  [default: what FILE is for, if its format says so]",
        choices=AUTOPILOTS,
        basic=True,
        label="Autopilot",
    )
    safety: SafetyOptions = group(
        SafetyOptions,
        *("allow_edge", "fence", "rally"),
        avoid={
            "help": "Keep-out zones; may be given several times.",
            "metavar": "FILE",
            "parse": None,
            "basic": True,
        },
        avoid_margin={"basic": True},
        max_altitude={
            "default": None,
            "basic": True,
            "help": "Refuse more above home, or with --dem above the ground.",
        },
        max_distance={"basic": True, "help": "Refuse more from home."},
    )
    wind: float | Sequence[float] | None = option(
        "Wind to estimate for, and the azimuth in degrees that it comes from; by default any.  "
        "[default: calm air]",
        metavar="M_S[,FROM]",
        parse=texts.numbers("--wind is M_S or M_S,FROM, such as 6 or 6,270"),
        label="Wind in m/s",
    )
    terrain: TerrainOptions = group(
        TerrainOptions,
        *("terrain", "terrain_tolerance", "climb", "descent"),
        dem={
            "basic": True,
            "help": "Refuse to fly nearer than 5 m to the ground of this elevation model; may be repeated.",
        },
    )
    photos: Paths = option(
        "Photographs that came back from the flight: files, folders, or with --camera its log (.bin, .ulg). "
        "What they do not show is found, on flat ground or that of --dem. May be repeated.",
        **flights.SEVERAL_PATHS,
    )
    gaps: str | None = option(
        "With --photos: write the gaps as regions, for the next flight with uavseg plan: .geojson, .gpkg, "
        ".fgb, .parquet, .shp or .kml.",
        metavar="PATH",
        python=False,
        basic=True,
    )
    regions: Any = option(
        "With --photos: what they should show, a file of polygons.  [default: what FILE plans to show, but a "
        "rim of 5 % of a photograph]",
        metavar="REGIONS",
        basic=True,
    )
    poses: PoseOptions = group(
        PoseOptions,
        "dem",
        camera={
            "basic": False,
            "help": "With --photos: all were, and are planned to be, taken with this camera.  [default: the "
            "focal length in the files]",
        },
        home={
            "basic": False,
            "help": "With --photos: place of takeoff, and its metres above the sea.  [default: the home of "
            "FILE]",
        },
    )
    files: OverwriteOptions = group(OverwriteOptions, overwrite={"help": "Replace gaps that are there."})
    as_json: bool = option("Write JSON, for programs.", "--json", default=False, python=False, basic=True)


class ResumeOptions(Options):
    """Resume."""

    file: str = argument("MISSION", required=True)
    start: Any = option(
        "Where the flight was cut: LAT,LON; or ITEM that it flew to, by its number on the vehicle (home is 0 "
        "and takeoff 1; with PX4, takeoff is 0), 12.4 where 40 % of the leg to 12 were flown; or LOG of the "
        "flight, a .bin of ArduPilot or a .ulg of PX4.",
        "--from",
        required=True,
        metavar="LAT,LON|ITEM|LOG",
        parse=texts.place_item_or_file,
        basic=True,
    )
    output: str = output_option("The rest: .plan or another mission file as of uavseg plan.", "FILE")
    mission_files: MissionFileOptions = group(MissionFileOptions, "editable")
    files: OverwriteOptions = group(OverwriteOptions, overwrite={"help": "Replace a mission that is there."})
    messages: VerbosityOptions = group(VerbosityOptions)


class LinkOptions(Options):
    """Vehicle."""

    connect: str = option(
        "Where the vehicle is: udpout:HOST:PORT, udpin:HOST:PORT, tcp:HOST:PORT or serial:DEVICE[:BAUD].",
        required=True,
        metavar="ADDRESS",
        basic=True,
    )
    timeout: float = option(
        "Seconds to wait for an answer, and without progress.", default=10.0, metavar="S", basic=True
    )


class UploadOptions(Options):
    """Upload."""

    file: str = argument("FILE", required=True)
    while_armed: bool = option(
        "Replace the mission of a vehicle whose motors are armed; it may be flying, and ArduPilot replaces "
        "the items one by one.",
        default=False,
        basic=True,
    )
    link: LinkOptions = group(LinkOptions)
    progress: ProgressOptions = group(ProgressOptions)
    messages: VerbosityOptions = group(VerbosityOptions)


class DownloadOptions(Options):
    """Download."""

    link: LinkOptions = group(LinkOptions)
    output: str = output_option("The mission: .plan or another file as of uavseg plan.", "FILE")
    files: OverwriteOptions = group(OverwriteOptions, overwrite={"help": "Replace a mission that is there."})
    progress: ProgressOptions = group(ProgressOptions)
    messages: VerbosityOptions = group(VerbosityOptions)
