"""Options that commands share, and the values that their texts become."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

from uavseg.cli.options.access import access_options
from uavseg.cli.options.bands import band_option, band_words, formula_options, nodata_option, three_bands

if TYPE_CHECKING:
    from uavseg.jobs.result.result import Drawing
    from uavseg.jobs.source.detail import Length
    from uavseg.jobs.source.source import ReadOptions
    from uavseg.regions.edit.small import Area
    from uavseg.segmentation.params.segment import SegmentParams


Command = TypeVar("Command", bound=Callable[..., Any])

map_stretch_option = click.option(
    "--stretch",
    metavar="STRETCH",
    help="For a map that holds no probabilities: auto, dtype, minmax, percentile:P,Q, none or LOW,HIGH.  "
    "[default: dtype for integers, none for floats]",
)


polarity_option = click.option(
    "--free-is-white/--free-is-black",
    "free_is_white",
    default=None,
    help="Of a picture without its YAML file: whether white or black is free; with white, 205 is unknown.",
)


def reading_options(command: Command, required: bool = True) -> Command:
    """Give a command RASTER..., the options of `read_options` and those of `access_options`."""
    return _with_options(
        access_options(command),
        click.argument(
            "rasters",
            metavar="RASTER..." if required else "[RASTER...]",
            nargs=-1,
            required=required,
            callback=_with_standard_input,
        ),
        band_option,
        click.option(
            "--rgb", metavar="R,G,B", callback=three_bands, help="Use the luminance of these bands."
        ),
        formula_options,
        nodata_option,
        click.option(
            "--stretch",
            default="auto",
            show_default=True,
            metavar="STRETCH",
            help="How intensity becomes v: auto, dtype, minmax, percentile:P,Q, none or LOW,HIGH.",
        ),
        click.option(
            "--collar",
            type=click.Choice(["auto", "keep"]),
            default="auto",
            show_default=True,
            help="Count an untagged black or white collar as nodata, or keep it.",
        ),
        click.option(
            "--skip-bad-tiles",
            is_flag=True,
            help="Count blocks of a file that cannot be read as nodata, and list them at the end.",
        ),
    )


flatten_option = click.option(
    "--flatten",
    metavar="M|Npx",
    help="Take away light that changes slowly over this width, several times that of what is sought; --range "
    "is then of v without it.",
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


min_confidence_option = click.option(
    "--min-confidence",
    type=float,
    metavar="P",
    help="Drop regions of a lower confidence (0 to 1) at last; on drawn scenes four fifths of those at 0.8 "
    "are right.",
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
    from uavseg.jobs.source.source import ReadOptions

    names = ("band", "rgb", "nodata", "stretch", "skip_bad_tiles", "free_is_white", "collar", "flatten")
    return ReadOptions(
        **{name: options[name] for name in names if name in options}, words=band_words(options)
    )


def segment_params(options: dict[str, Any], refine: str | None) -> SegmentParams:
    """How the source is segmented."""
    from uavseg.segmentation.params.segment import SegmentParams

    return SegmentParams.from_words(
        options["method"], options["threshold"], options["intensity_step"], refine
    )


def drawing(options: dict[str, Any]) -> Drawing:
    """How outlines are drawn."""
    from uavseg.jobs.result.result import Drawing

    return Drawing(options.get("smooth_outline"), options["simplify"])


def area(text: str | None) -> Area | None:
    """The area that an option names, if it was given."""
    from uavseg.regions.edit.small import as_area

    return as_area(text)


def length(text: str | None) -> Length | None:
    """The length that an option names, if it was given."""
    from uavseg.jobs.source.detail import as_length

    return as_length(text)


def _with_options(command: Command, *options: Callable[[Command], Command]) -> Command:
    """A command with options, the first of them on top of its help."""
    for option in reversed(options):
        command = option(command)
    return command


def _with_standard_input(
    ctx: click.Context, param: click.Parameter, value: tuple[str, ...]
) -> tuple[str, ...]:
    """The rasters, with the names that standard input holds in place of -."""
    if "-" not in value or ctx.resilient_parsing:  # a shell that completes the line has a terminal as input
        return value
    from uavseg.errors import RasterReadError
    from uavseg.raster.read.source_list import MAX_LIST, parse_list

    if sys.stdin is None:
        raise RasterReadError("the standard input is closed; name rasters, or pass their names to it")
    names = parse_list(sys.stdin.buffer.read(MAX_LIST))
    if not names:
        raise RasterReadError("the standard input names no rasters; pass one name a line to it")
    return tuple(name for given in value for name in (names if given == "-" else [given]))
