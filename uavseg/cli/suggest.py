"""`uavseg suggest`: ranges of v that a raster, or a block map, suggests by itself."""

from __future__ import annotations

import json
import shlex
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from uavseg.cli._reading import reading_options
from uavseg.cli._regions import opened
from uavseg.cli._running import Reporter, Running, running_options
from uavseg.cli._segmenting import segmenting_options

if TYPE_CHECKING:
    from uavseg.execution.executors import Map
    from uavseg.jobs.extract import ExtractParams
    from uavseg.jobs.suggest import Suggestion, Suggestions
    from uavseg.segmentation.blocks.block_file import SavedBlocks

_MOST_NAMED = 8  # rasters of a command that is printed


def _number(ctx: click.Context, param: click.Parameter, value: str) -> int | None:
    """A number of classes, or None for auto."""
    if value == "auto":
        return None
    try:
        return int(value)
    except ValueError as error:
        raise click.BadParameter(f"{value!r} is neither auto nor a number such as 3", ctx, param) from error


@click.command("suggest", short_help="Propose ranges of v, with what each would give.")
@reading_options
@click.option("-o", "--output", metavar="PATH.png", help="Also draw the ranges beside the histogram.")
@click.option(
    "--classes",
    default="auto",
    show_default=True,
    callback=_number,
    metavar="N|auto",
    help="How many ranges: 2 to 8, or as many as the histogram has by itself.",
)
@click.option("--json", "as_json", is_flag=True, help="Write JSON, for programs.")
@segmenting_options
@running_options
def command(
    rasters: tuple[str, ...],
    output: str | None,
    classes: int | None,
    as_json: bool,
    running: Running,
    **options: Any,
) -> None:
    """Propose ranges of v for RASTER... (many are one mosaic), each with its share of the area, the number of
    regions that it gives before their boundaries are refined, and the command to type next.

    The ranges cut the histogram of the means of leaves into the classes that vary least within (Otsu's
    thresholds). RASTER may also be a block map from `uavseg divide`, which answers by itself.
    """
    reporter = running.reporter
    params = _params(running.tile, options)
    if output is not None:
        from uavseg.plot.page import check_picture

        check_picture(output, running.overwrite)
    saved, dataset = opened(rasters, options, "none", reporter)
    run = running.workers()
    if dataset is not None:
        reporter.begin(dataset, running.tile)
    found = _found(saved, dataset, classes, params, running.resuming(run), reporter)
    if output is not None:
        from uavseg.plot.suggestions import draw_suggestions

        draw_suggestions(found, output, dataset, running.overwrite)
    reporter.finish()
    for warning in found.warnings:
        reporter.warn(warning)
    commands = [_command(chosen, rasters, found, options) for chosen in found.ranges]
    click.echo(_as_json(found, commands) if as_json else _table(found, commands))
    _tell(found, output, len(rasters), reporter)


def _params(tile: int | None, options: dict[str, Any]) -> ExtractParams:
    from uavseg.jobs.extract import ExtractParams
    from uavseg.raster.intensity.stretch import parse_stretch
    from uavseg.segmentation.params import SegmentParams

    return ExtractParams(
        SegmentParams(options["method"], options["threshold"], options["intensity_step"], "none"),
        parse_stretch(options["stretch"]),
        tile=tile,
    )


def _found(
    saved: SavedBlocks | None,
    dataset: Any,
    classes: int | None,
    params: ExtractParams,
    run: Map,
    reporter: Reporter,
) -> Suggestions:
    from uavseg.jobs.suggest import suggest, suggest_from_blocks
    from uavseg.raster.bad_blocks import BadBlock, listing

    if saved is not None:
        return suggest_from_blocks(saved, classes, params)
    bad: set[BadBlock] = set()
    found = suggest(dataset, classes, params, listing(run, bad), reporter.progress)
    return replace(found, warnings=(*found.warnings, *map(str, sorted(bad))))


def _command(
    chosen: Suggestion, rasters: tuple[str, ...], found: Suggestions, options: dict[str, Any]
) -> str:
    """The line that extracts a range, from the same rasters in the same way."""
    named = rasters if len(rasters) <= _MOST_NAMED else (rasters[0], "...")
    target = f"{Path(rasters[0]).stem}.{str(chosen).replace(',', '-')}{_suffix(found)}"
    words = ["uavseg", "extract", *named, "--range", str(chosen), *_chosen(options), "-o", target]
    return shlex.join(words)


def _suffix(found: Suggestions) -> str:
    """GeoJSON where it can hold the regions."""
    from uavseg.errors import OutputError
    from uavseg.regions.formats import export

    try:
        export.check_region_crs("regions.geojson", found.about.geobox.wkt)
    except OutputError:
        return ".gpkg"
    return ".geojson"


def _chosen(options: dict[str, Any]) -> list[str]:
    """Options of reading and segmenting as the user gave them."""
    context = click.get_current_context()
    words: list[str] = []
    for parameter in context.command.params:
        name = str(parameter.name)
        if name not in options or context.get_parameter_source(name) is not ParameterSource.COMMANDLINE:
            continue
        value = options[name]
        text = ",".join(map(str, value)) if isinstance(value, tuple) else str(value)
        words += [parameter.opts[0]] if value is True else [parameter.opts[0], text]
    return words


def _as_json(found: Suggestions, commands: list[str]) -> str:
    ranges = [asdict(chosen) | {"command": line} for chosen, line in zip(found.ranges, commands, strict=True)]
    facts = {
        "source": found.about.name,
        "stretch": found.about.stretch.name,
        "explained": found.explained,
        "ranges": ranges,
        "warnings": found.warnings,
    }
    return json.dumps(facts, indent=2, allow_nan=False)


def _table(found: Suggestions, commands: list[str]) -> str:
    """The ranges in columns; the line to type next stands whole below its range, to be copied."""
    if not found.ranges:
        return "one class: there is no range to choose"
    lines = [f"{'v':<20}{'area':>8}{'regions':>12}"]
    for chosen, line in zip(found.ranges, commands, strict=True):
        interval = str(chosen).replace(",", " to ")
        lines.append(f"{interval:<20}{100 * chosen.share:>6.1f} %{chosen.regions:>12,}")
        lines.append(f"    {line}")
    return "\n".join(lines)


def _tell(found: Suggestions, output: str | None, rasters: int, reporter: Reporter) -> None:
    """What else is to be said, on stderr."""
    if rasters > _MOST_NAMED and found.ranges:
        reporter.say(f"in the commands, ... stands for the other {rasters - 1} rasters")
    if output is not None:
        reporter.say(f"wrote {output}")
    reporter.detail(f"{found.explained:.1%} of the variance of the means lies between the ranges")
    reporter.detail(f"stretch {found.about.stretch.name}, {found.about.band_names}")
    reporter.detail(f"{reporter.seconds:.2f} seconds")
