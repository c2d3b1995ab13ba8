"""Options that commands share, and the values that their texts become."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import click

from uavseg.cli._access import access_options
from uavseg.cli._say import say
from uavseg.errors import ParameterError, RegionError

if TYPE_CHECKING:
    from uavseg.flight.mission import Mission
    from uavseg.jobs.plan import Home, PlanRequest
    from uavseg.jobs.result import Drawing
    from uavseg.jobs.source import ReadOptions
    from uavseg.regions.edit.small import Area
    from uavseg.segmentation.params import IntensityRange, SegmentParams


Command = TypeVar("Command", bound=Callable[..., Any])

map_stretch_option = click.option(
    "--stretch",
    metavar="STRETCH",
    help="For a map that holds no probabilities: auto, dtype, minmax, percentile:P,Q, none or LOW,HIGH.  "
    "[default: dtype for integers, none for floats]",
)


def reading_options(command: Command) -> Command:
    """Give a command RASTER..., the options of `read_options` and those of `access_options`."""
    return _with_options(
        access_options(command),
        click.argument("rasters", metavar="RASTER...", nargs=-1, required=True),
        click.option("--band", type=click.IntRange(min=1), help="Use this band, counted from 1."),
        click.option("--rgb", metavar="R,G,B", callback=_three, help="Use the luminance of these bands."),
        click.option("--nodata", type=float, metavar="V|nan", help="This value counts for nothing."),
        click.option(
            "--stretch",
            default="auto",
            show_default=True,
            metavar="STRETCH",
            help="How intensity becomes v: auto, dtype, minmax, percentile:P,Q, none or LOW,HIGH.",
        ),
        click.option(
            "--skip-bad-tiles",
            is_flag=True,
            help="Count blocks of a file that cannot be read as nodata, and list them at the end.",
        ),
    )


def segmenting_options(command: Command, method: str = "adaptive") -> Command:
    """Give a command --method, with this default, --threshold and --intensity-step; see `segment_params`."""
    return _with_options(
        command,
        click.option(
            "--method",
            type=click.Choice(["adaptive", "paper"]),
            default=method,
            show_default=True,
            help="Divide blocks by texture and intensity, or by texture alone as the paper does.",
        ),
        click.option(
            "--threshold",
            type=float,
            default=1.2,
            show_default=True,
            metavar="X",
            help="Divide where G_max / G_min is larger.",
        ),
        click.option(
            "--intensity-step",
            type=float,
            default=0.05,
            show_default=True,
            metavar="TAU",
            help="Adaptive: divide where the means of the children differ by more.",
        ),
    )


def drawing_options(command: Command) -> Command:
    """Give a command --smooth-outline and --simplify, in the order in which they work; see `drawing`."""
    return _with_options(
        command,
        click.option(
            "--smooth-outline",
            type=float,
            metavar="METRES",
            help="Draw outlines without stairs, within this many metres of the pixel edges, and never "
            "further than half a pixel; shared borders stay shared, attributes those of the pixels.",
        ),
        click.option(
            "--simplify",
            type=float,
            metavar="METRES",
            help="Simplify outlines, after they are smoothed; shared borders stay shared.",
        ),
    )


def read_options(options: dict[str, Any]) -> ReadOptions:
    """How the source is read."""
    from uavseg.jobs.source import ReadOptions

    names = ("band", "rgb", "nodata", "stretch", "skip_bad_tiles")
    return ReadOptions(**{name: options[name] for name in names if name in options})


def segment_params(options: dict[str, Any], refine: str | None) -> SegmentParams:
    """How the source is segmented."""
    from uavseg.segmentation.params import SegmentParams

    return SegmentParams.from_words(
        options["method"], options["threshold"], options["intensity_step"], refine
    )


def drawing(options: dict[str, Any]) -> Drawing:
    """How outlines are drawn."""
    from uavseg.jobs.result import Drawing

    return Drawing(options.get("smooth_outline"), options["simplify"])


def area(text: str | None) -> Area | None:
    """The area that an option names, if it was given."""
    from uavseg.regions.edit.small import as_area

    return as_area(text)


def parsed_range(text: str) -> IntensityRange:
    """LO,HI of --range as a range of v."""
    from uavseg.segmentation.params import IntensityRange

    try:
        low, high = (float(part) for part in text.split(","))
    except ValueError:
        raise ParameterError(f"--range is two numbers between commas, such as 0.55,1, not {text!r}") from None
    return IntensityRange(low, high)


def _with_options(command: Command, *options: Callable[[Command], Command]) -> Command:
    """A command with options, the first of them on top of its help."""
    for option in reversed(options):
        command = option(command)
    return command


def _three(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[int, int, int] | None:
    """Three band numbers of a text."""
    if value is None:
        return None
    try:
        red, green, blue = (int(part) for part in value.split(","))
    except ValueError as error:
        raise click.BadParameter(f"{value!r} is not three band numbers, such as 4,3,2", ctx, param) from error
    return red, green, blue


F = TypeVar("F", bound=Callable[..., Any])


def mission_options(command: F) -> F:
    """The options that say how to fly, for every command that makes a mission.

    They arrive as `altitude`, `camera`, `gsd`, `overlap`, `gimbal_pitch`, `home`, `pattern`, `spacing`,
    `angle`, `speed`, `firmware` and `tolerance`: see `plan_request`.
    """
    options = [
        click.option(
            "--altitude", type=float, metavar="M", help="Height of the flight above home, in metres."
        ),
        click.option(
            "--camera",
            metavar="NAME|FILE.json",
            help="Photograph with this camera: spacing, trigger distance and the highest speed follow. "
            "uavseg cameras lists them.",
        ),
        click.option(
            "--gsd",
            type=float,
            metavar="CM",
            help="Ground sampling distance, in place of --altitude: centimetres per pixel.",
        ),
        click.option(
            "--overlap",
            default="75,70",
            metavar="FRONT,SIDE",
            show_default=True,
            help="Overlap of photographs along lines and between them, in per cent.",
        ),
        click.option(
            "--gimbal-pitch",
            type=float,
            default=-90.0,
            metavar="DEG",
            show_default=True,
            help="Where the camera looks: -90 is straight down.",
        ),
        click.option(
            "--home",
            metavar="LAT,LON[,M]|auto",
            help="Where the vehicle starts, and metres above the sea; auto: inside the first chosen region.",
        ),
        click.option(
            "--pattern",
            type=click.Choice(["visit", "perimeter", "survey"]),
            help="A point in each region, its outline, or lines over it.  [visit, or survey with --spacing]",
        ),
        click.option("--spacing", type=float, metavar="M", help="Metres between the lines of a survey."),
        click.option(
            "--angle",
            default="auto",
            metavar="DEG|auto",
            show_default=True,
            help="Azimuth of the lines, clockwise from north; auto: the one that needs the fewest lines.",
        ),
        click.option(
            "--speed", type=float, default=5.0, metavar="M_S", show_default=True, help="Metres per second."
        ),
        click.option(
            "--firmware", type=click.Choice(["ardupilot", "px4"]), default="ardupilot", show_default=True
        ),
        click.option(
            "--tolerance",
            type=float,
            metavar="M",
            help="How far outlines may be moved to save corners.  [default: 1 m, or a pixel where larger]",
        ),
    ]
    for option in reversed(options):
        command = option(command)
    return command


def plan_request(options: dict[str, Any]) -> PlanRequest:
    """How to fly, from where and over which regions, from the values of `mission_options`."""
    from uavseg.jobs.plan import PlanRequest, flight_params, photos_of

    names = ("pattern", "spacing", "speed", "firmware", "tolerance", "gsd")
    photos = photos_of(options["camera"], parse_overlap(options["overlap"]), options["gimbal_pitch"])
    flight = flight_params(
        options["altitude"],
        angle=parse_angle(options["angle"]),
        photos=photos,
        **{name: options[name] for name in names},
    )
    home = parse_home(options["home"])
    return PlanRequest(
        flight, home, parse_ids(options.get("ids")), options.get("largest"), options.get("where")
    )


def parse_home(text: str | None) -> Home:
    """LAT,LON or LAT,LON,M as numbers, or auto."""
    if text is None:
        raise ParameterError("a mission needs --home LAT,LON, where the vehicle starts (or --home auto)")
    if text.strip().lower() == "auto":
        return "auto"
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) not in (2, 3):
        raise ParameterError(f"--home is LAT,LON or LAT,LON,M in degrees and metres, or auto, not {text!r}")
    return numbers


def parse_ids(text: str | None) -> list[int] | None:
    """Whole numbers between commas."""
    if text is None:
        return None
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise RegionError(f"--ids is whole numbers between commas, as in 1,4,7, not {text!r}") from None


def parse_overlap(text: str) -> list[float]:
    """FRONT,SIDE as numbers."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise ParameterError(f"--overlap is FRONT,SIDE in per cent, such as 75,70, not {text!r}") from None


def parse_angle(text: str) -> float | None:
    """Degrees, or None for auto."""
    if text.strip().lower() == "auto":
        return None
    try:
        return float(text)
    except ValueError:
        raise ParameterError(f"--angle is a number of degrees or auto, not {text!r}") from None


def report(mission: Mission, regions: int, output: str, unwritten: Sequence[str] = ()) -> None:
    """Print length, duration and warnings of a mission on stderr, and what its format cannot hold."""
    minutes, seconds = divmod(round(mission.duration_s), 60)
    flown = f"{output}: {regions} region{'s' * (regions != 1)}, {len(mission.items)} items"
    say(f"{flown}, {mission.distance_m / 1000:.2f} km, at least {minutes} min {seconds:02d} s")
    if mission.firmware == "px4" and output.lower().endswith(".waypoints"):
        say("note: PX4 will face north at each item of a .waypoints file; a .plan leaves it free")
    for warning in (*mission.warnings, *unwritten):
        say(f"note: {warning}")
