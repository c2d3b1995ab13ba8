"""`uavseg suggest --like`: the band, index or expression and the range that part a sample best."""

from __future__ import annotations

import json
import shlex
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli.options.raster import read_options
from uavseg.cli.options.running import RunOptions
from uavseg.cli.terminal.say import show

if TYPE_CHECKING:
    from collections.abc import Sequence

    from uavseg.jobs.match.ranges_of_sample import SampleRange, SampleRanges

_OF_HISTOGRAM = ("output", "classes", "method", "threshold", "intensity_step", "resume")


def suggest_like(options: dict[str, Any]) -> None:
    """Answer `uavseg suggest` with a sample."""
    from uavseg.jobs.match.ranges_of_sample import SuggestLikeRequest, open_all_bands, ranges_of_sample
    from uavseg.regions.sample.place import parse_like

    _check_alone()
    run = RunOptions.of(options)
    samples = [tuple(map(parse_like, options[name])) for name in ("like", "unlike")]
    request = SuggestLikeRequest(samples[0], samples[1], options["bands"])
    found = ranges_of_sample(open_all_bands(options["rasters"], read_options(options)), request, run.work())
    commands = [_command(one, rank, options, found) for rank, one in enumerate(found.ranges, start=1)]
    run.reporter.finish(found.warnings)
    show(_as_json(found, commands) if options["as_json"] else _table(found, commands))
    run.reporter.detail(f"{run.reporter.seconds:.2f} seconds")


def _check_alone() -> None:
    context = click.get_current_context()
    for parameter in context.command.params:
        given = context.get_parameter_source(str(parameter.name)) is click.core.ParameterSource.COMMANDLINE
        if given and parameter.name in _OF_HISTOGRAM:
            raise click.UsageError(
                f"{parameter.opts[-1]} is for ranges without --like; leave one of them out"
            )


def _command(one: SampleRange, rank: int, options: dict[str, Any], found: SampleRanges) -> str:
    """The line that extracts a range."""
    from uavseg.jobs.source.command_line import extract_line
    from uavseg.raster.read.source_list import stem_of
    from uavseg.raster.spectral.formula import BandWords
    from uavseg.regions.formats.export import suffix_for

    words = one.words
    bands = BandWords(words.get("index"), words.get("expr"), words.get("band_names"))
    read = replace(read_options(options), band=words.get("band"), rgb=words.get("rgb"), words=bands)
    rasters = options["rasters"]
    line = extract_line(rasters, read, str(one), "--values")
    target = f"{stem_of(rasters[0])}.like{rank}{suffix_for(found.source.geobox.wkt)}"
    return f"{line} {shlex.join(['-o', target])}"


def _as_json(found: SampleRanges, commands: Sequence[str]) -> str:
    ranges = [asdict(one) | {"command": line} for one, line in zip(found.ranges, commands, strict=True)]
    facts = {"source": found.source.name, "ranges": ranges, "warnings": found.warnings}
    return json.dumps(facts, indent=2, allow_nan=False)


def _table(found: SampleRanges, commands: Sequence[str]) -> str:
    """The ranges in columns; the line to type next stands whole below its range, to be copied."""
    if not found.ranges:
        return "all pixels have one value: there is no range to choose"
    of, values = [one.of for one in found.ranges], [one.values_text for one in found.ranges]
    first, second = (max(map(len, texts)) + 3 for texts in ([*of, "of"], [*values, "values"]))
    lines = [f"{'of':<{first}}{'values':<{second}}{'agreement':>9}{'area':>9}"]
    for one, text, line in zip(found.ranges, values, commands, strict=True):
        agreement, share = f"{one.agreement:.0%}", f"{100 * one.share:.1f} %"
        lines += [f"{one.of:<{first}}{text:<{second}}{agreement:>9}{share:>9}", f"    {line}"]
    return "\n".join(lines)
