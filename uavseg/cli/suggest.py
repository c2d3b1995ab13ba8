"""`uavseg suggest`: ranges that a raster suggests by itself, or that part a sample best."""

from __future__ import annotations

import json
import shlex
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, show, work_of
from uavseg.cli.write import keep_inputs, transaction
from uavseg.options.regions import DivisionOptions, SuggestOptions

if TYPE_CHECKING:
    from uavseg.jobs.match.ranges_of_sample import SampleRange, SampleRanges
    from uavseg.jobs.suggest import Suggestion, Suggestions
    from uavseg.options.reading import ReadOptions

    Found = Suggestions | SampleRanges

_BANDS = ("band", "rgb", "index", "expr", "band_names")
_OF_HISTOGRAM = ("output", "classes", "method", "threshold", "intensity_step", "resume")


@job_command("suggest", SuggestOptions)
def command(options: SuggestOptions, reporter: Reporter) -> None:
    """Propose ranges of v for RASTER... (many are one mosaic), each with its share of the area, the number of
    regions that extracting it gives, and the command to type next. Of rasters of more than 400 megapixels,
    the number is estimated ("about").

    The ranges cut the histogram of the means of leaves into the classes that vary least within (Otsu's
    thresholds), as many as its valleys separate; without a valley, into two by the smallest cross entropy.
    Valleys between the values of pixels cut too: rows, grids and small things hardly show in means.
    The class that looks most like things on a ground comes first: compact, closed, with a contrast at its
    borders (their step, as a multiple of the differences on one side; noise and slow light reach 2.5); then
    the others, its complement; then a "part" of the darkest and the brightest that stands out more. A warning
    says which doubt there is. RASTER may also be a block map from `uavseg divide`, which answers by itself.

    With --like, all bands are looked at: the best band, the best index or ratio and the best weighted sum of
    bands, each with the range of its values that fits what has the colors of the sample, and how well it is
    expected to agree with that: pixels that are both, as a share of those that are either.
    """
    if options.like or options.unlike or options.bands:
        _suggest_like(options, reporter)
        return
    from uavseg.jobs.requests import suggest_request
    from uavseg.jobs.source.open_source import open_source
    from uavseg.jobs.source.source import Pixels
    from uavseg.jobs.suggest import suggest

    output, rasters, overwrite = options.output, options.source.rasters, options.files.overwrite
    request = suggest_request(options)
    if output is not None:
        from uavseg.plot.page.page import check_png_target

        check_png_target(output, overwrite)
        keep_inputs([output], rasters)
    source = open_source(rasters, options.read)
    found = suggest(source, request, work_of(options.run, reporter))
    read, more, ranges = options.read, _chosen(options.division), map(str, found.ranges)
    commands = [_line(options, read, found, one.replace(",", "-"), ["--range", one, *more]) for one in ranges]
    with transaction():
        if output is not None:
            from uavseg.plot.suggestions import draw_suggestions
            from uavseg.raster.grid.tiling import TilePass

            dataset = source.cleaned(TilePass(())) if isinstance(source, Pixels) else None
            draw_suggestions(found, output, dataset, overwrite)
        reporter.finish(found.warnings)
        if options.as_json:
            unit = "" if found.source.axis is None else found.source.axis.unit
            facts = {"stretch": found.source.stretch.name, "unit": unit, "explained": found.explained}
            show(_as_json(found, commands, **facts))
        else:
            show(_table(found, commands))
    if output is not None:
        reporter.say(f"wrote {output}")
    reporter.detail(f"{found.explained:.1%} of the variance of the means lies between the ranges")
    reporter.detail(f"{reporter.seconds:.2f} seconds")


def _line(options: SuggestOptions, read: ReadOptions, found: Found, name: str, words: Sequence[str]) -> str:
    """Return the line that extracts a range, to a file whose name ends so, from the same rasters."""
    from uavseg.jobs.info import extract_line
    from uavseg.raster.read.source_list import stem_of
    from uavseg.regions.formats.export import suffix_for

    kind, interval, *more = words
    rasters, suffix = options.source.rasters, suffix_for(found.source.geobox.wkt)
    line = extract_line(rasters, read, interval, kind)
    return f"{line} {shlex.join([*more, '-o', f'{stem_of(rasters[0])}.{name}{suffix}'])}"


def _chosen(division: DivisionOptions) -> list[str]:
    """Return options of the division as the user gave them."""
    names = [name for name in _given() if hasattr(division, name)]
    return [word for name in names for word in (f"--{name.replace('_', '-')}", str(getattr(division, name)))]


def _given() -> list[str]:
    """Return the names of the options that stand on the command line, in the order of the table."""
    context = click.get_current_context()
    names = [str(parameter.name) for parameter in context.command.params]
    return [name for name in names if context.get_parameter_source(name) is ParameterSource.COMMANDLINE]


def _as_json(found: Found, commands: Sequence[str], **facts: Any) -> str:
    listed: Sequence[Suggestion | SampleRange] = found.ranges
    ranges = [asdict(one) | {"command": line} for one, line in zip(listed, commands, strict=True)]
    metadata = {"source": found.source.name, **facts, "ranges": ranges, "warnings": found.warnings}
    return json.dumps(metadata, indent=2, allow_nan=False)


def _table(found: Suggestions, commands: list[str]) -> str:
    """Return the ranges in columns; the line to type next stands whole below its range, to be copied."""
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


# With a sample


def _suggest_like(options: SuggestOptions, reporter: Reporter) -> None:
    from uavseg.jobs.match.ranges_of_sample import ranges_of_sample
    from uavseg.jobs.requests import suggest_like_request
    from uavseg.jobs.source.open_source import open_all_bands

    for name in _given():
        if name in _OF_HISTOGRAM:
            flag = f"--{name.replace('_', '-')}"
            raise click.UsageError(f"{flag} is for ranges without --like; leave one of them out")
    request = suggest_like_request(options)
    opened = open_all_bands(options.source.rasters, options.read)
    found = ranges_of_sample(opened, request, work_of(options.run, reporter))
    commands = []
    for rank, one in enumerate(found.ranges, start=1):
        chosen: dict[str, Any] = {name: one.words.get(name) for name in _BANDS}
        read = replace(options.read, **chosen)
        commands.append(_line(options, read, found, f"like{rank}", ["--values", str(one)]))
    reporter.finish(found.warnings)
    show(_as_json(found, commands) if options.as_json else _like_table(found, commands))
    reporter.detail(f"{reporter.seconds:.2f} seconds")


def _like_table(found: SampleRanges, commands: Sequence[str]) -> str:
    """Return the ranges in columns; the line to type next stands whole below its range, to be copied."""
    if not found.ranges:
        return "all pixels have one value: there is no range to choose"
    of, values = [one.of for one in found.ranges], [one.values_text for one in found.ranges]
    first, second = (max(map(len, texts)) + 3 for texts in ([*of, "of"], [*values, "values"]))
    lines = [f"{'of':<{first}}{'values':<{second}}{'agreement':>9}{'area':>9}"]
    for one, text, line in zip(found.ranges, values, commands, strict=True):
        agreement, share = f"{one.agreement:.0%}", f"{100 * one.share:.1f} %"
        lines += [f"{one.of:<{first}}{text:<{second}}{agreement:>9}{share:>9}", f"    {line}"]
    return "\n".join(lines)
