"""`uavseg suggest`: ranges of v that a raster, or a block map, suggests by itself."""

from __future__ import annotations

import json
import shlex
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from uavseg.cli._suggest_like import suggest_like
from uavseg.cli._write import keep_inputs, transaction
from uavseg.cli.options.bands import many_bands
from uavseg.cli.options.raster import (
    flatten_option,
    read_options,
    reading_options,
    segment_params,
    segmenting_options,
)
from uavseg.cli.options.running import Reporter, RunOptions, running_options
from uavseg.cli.terminal.say import show

if TYPE_CHECKING:
    from uavseg.jobs.suggestions import Suggestion, Suggestions

_PASSED_ON = {"method", "threshold", "intensity_step"}


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
    help="How many ranges: 2 to 8, of Otsu's thresholds alone, or as many as the raster has by itself.",
)
@click.option(
    "--like",
    multiple=True,
    metavar="SAMPLE|X,Y,RADIUS",
    help="The band, index or sum of bands and the range of its values that part this sample best: a file of "
    "polygons, or a disc in the raster's coordinates. May be given several times.",
)
@click.option(
    "--unlike",
    multiple=True,
    metavar="SAMPLE|X,Y,RADIUS",
    help="With --like: a sample of what is not wanted; may be given several times.",
)
@click.option(
    "--bands",
    metavar="BAND,...",
    callback=many_bands,
    help="With --like: look at these bands alone.",
)
@click.option("--json", "as_json", is_flag=True, help="Write JSON, for programs.")
@flatten_option
@segmenting_options
@running_options
def command(**options: Any) -> None:
    """Propose ranges of v for RASTER... (many are one mosaic), each with its share of the area, the number of
    regions that extracting it gives, and the command to type next. Of rasters of more than 400 megapixels,
    the number is estimated ("about").

    The ranges cut the histogram of the means of leaves into the classes that vary least within (Otsu's
    thresholds), as many as its valleys separate; without a valley, into two by the smallest cross entropy.
    Valleys between the values of pixels cut too: rows, grids and small things hardly show in means.
    Things that stand out in the darkest or the brightest of them get a range of their own, a "part". What
    looks most like things on a ground comes first: compact, closed, with a contrast at its borders (their
    step, as a multiple of the differences on one side; noise and slow light reach 2.5). RASTER may also be a
    block map from `uavseg divide`, which answers by itself.

    With --like, all bands are looked at: the best band, the best index or ratio and the best weighted sum of
    bands, each with the range of its values that fits what has the colors of the sample, and how well it is
    expected to agree with that: pixels that are both, as a share of those that are either.
    """
    if options["like"] or options["unlike"] or options["bands"]:
        suggest_like(options)
        return
    from uavseg.jobs.source.open_source import open_source
    from uavseg.jobs.source.source import Pixels
    from uavseg.jobs.suggest import SuggestRequest, suggest

    run = RunOptions.of(options)
    output, rasters = options["output"], options["rasters"]
    request = SuggestRequest(options["classes"], segment_params(options, None))
    read = read_options(options)
    if output is not None:
        from uavseg.plot.page.page import check_png_target

        check_png_target(output, run.overwrite)
        keep_inputs([output], rasters)
    source = open_source(rasters, read)
    found = suggest(source, request, run.work())
    commands = [_command(chosen, rasters, found, options) for chosen in found.ranges]
    with transaction():
        if output is not None:
            from uavseg.plot.suggestions import draw_suggestions
            from uavseg.raster.grid.tiling import TilePass

            dataset = source.cleaned(TilePass(())) if isinstance(source, Pixels) else None
            draw_suggestions(found, output, dataset, run.overwrite)
        run.reporter.finish(found.warnings)
        show(_as_json(found, commands) if options["as_json"] else _table(found, commands))
    _report(found, output, run.reporter)


def _command(
    chosen: Suggestion, rasters: tuple[str, ...], found: Suggestions, options: dict[str, Any]
) -> str:
    """The line that extracts a range, from the same rasters in the same way."""
    from uavseg.jobs.source.command_line import extract_line
    from uavseg.raster.read.source_list import stem_of
    from uavseg.regions.formats.export import suffix_for

    suffix = suffix_for(found.source.geobox.wkt)
    target = f"{stem_of(rasters[0])}.{str(chosen).replace(',', '-')}{suffix}"
    line = extract_line(rasters, read_options(options), str(chosen))
    return f"{line} {shlex.join([*_chosen(options), '-o', target])}"


def _chosen(options: dict[str, Any]) -> list[str]:
    """Options of segmenting as the user gave them."""
    context = click.get_current_context()
    words: list[str] = []
    for parameter in context.command.params:
        name = str(parameter.name)
        if name not in _PASSED_ON or context.get_parameter_source(name) is not ParameterSource.COMMANDLINE:
            continue
        value = options[name]
        text = ",".join(map(str, value)) if isinstance(value, tuple) else str(value)
        words += [parameter.opts[0]] if value is True else [parameter.opts[0], text]
    return words


def _as_json(found: Suggestions, commands: list[str]) -> str:
    ranges = [asdict(chosen) | {"command": line} for chosen, line in zip(found.ranges, commands, strict=True)]
    facts = {
        "source": found.source.name,
        "stretch": found.source.stretch.name,
        "unit": "" if found.source.axis is None else found.source.axis.unit,
        "explained": found.explained,
        "ranges": ranges,
        "warnings": found.warnings,
    }
    return json.dumps(facts, indent=2, allow_nan=False)


def _table(found: Suggestions, commands: list[str]) -> str:
    """The ranges in columns; the line to type next stands whole below its range, to be copied."""
    if not found.ranges:
        return "one class: there is no range to choose"
    values = [one.values_text for one in found.ranges]
    width = max(map(len, values)) + 3 if any(values) else 0
    title = "values" if width else ""
    lines = [f"{'v':<20}{title:<{width}}{'area':>8}{'regions':>14}{'contrast':>11}"]
    for chosen, text, line in zip(found.ranges, values, commands, strict=True):
        interval = str(chosen).replace(",", " to ")
        contrast = "" if chosen.contrast is None else f"{chosen.contrast:.1f}"
        row = f"{interval:<20}{text:<{width}}{100 * chosen.share:>6.1f} %{chosen.regions_text:>14}"
        lines.append(f"{row}{contrast:>11}{'  part' * chosen.part}")
        lines.append(f"    {line}")
    return "\n".join(lines)


def _report(found: Suggestions, output: str | None, reporter: Reporter) -> None:
    """What else is to be said, on stderr."""
    if output is not None:
        reporter.say(f"wrote {output}")
    reporter.detail(f"{found.explained:.1%} of the variance of the means lies between the ranges")
    reporter.detail(f"{reporter.seconds:.2f} seconds")
