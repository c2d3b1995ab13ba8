"""`uavseg levels`: rasters, or a block map, divided into levels between breaks of v."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from uavseg.cli._write import (
    LabelFile,
    check_targets,
    keep_inputs,
    shown,
    summary_rows,
    transaction,
    write_regions_and_labels,
)
from uavseg.cli.options.creation import creation_of, creation_option
from uavseg.cli.options.each import answer_each, check_alone, each_options
from uavseg.cli.options.raster import (
    area,
    drawing,
    drawing_options,
    flatten_option,
    length,
    min_confidence_option,
    read_options,
    reading_options,
    segment_params,
    segmenting_options,
)
from uavseg.cli.options.running import RunOptions, running_options
from uavseg.cli.options.stream import geojson_form, stream_options, stream_warnings
from uavseg.cli.options.style import style_kind, style_option

if TYPE_CHECKING:
    from uavseg.jobs.levels import LevelsRequest
    from uavseg.jobs.result.result import Extraction

_LISTED = 8  # levels in the table at the end


@click.command("levels", short_help="Divide a raster into levels of v, and each into segments.")
@reading_options
@click.option("--width", type=float, metavar="P", help="Width of a level in v, such as 0.1.")
@click.option(
    "--breaks",
    metavar="V,V,...|otsu[:K]|quantile[:K]",
    help="In place of a width: the values of v between levels, such as 0.2,0.5; or K levels with the "
    "smallest variance within (otsu, as suggest --classes K) or the same number of pixels (quantile, 5).",
)
@click.option(
    "-o",
    "--output",
    metavar="PATH",
    help="The segments: .geojson, .gpkg, .fgb, .parquet, .shp or .kml; - is GeoJSON on stdout.  "
    "[default: STEM.levels.geojson here]",
)
@click.option(
    "--labels",
    metavar="PATH",
    help="Also write the labels of the segments as a raster: one .tif, or a .vrt over a folder of tiles.",
)
@creation_option
@flatten_option
@segmenting_options
@click.option(
    "--refine",
    type=click.Choice(["tv", "none", "pixels"]),
    show_default="tv; none with --method paper",
    help="How boundaries are found to the pixel: by total variation, or left at the edges of blocks. Or "
    "pixels: every pixel by its own value.",
)
@click.option(
    "--detail",
    metavar="M|Npx",
    help="Give what is narrower to the levels near it, before small segments are merged.",
)
@click.option(
    "--min-area", metavar="M2|Npx", help="Merge segments of less into their neighbours, or drop them."
)
@click.option(
    "--small",
    type=click.Choice(["merge", "drop"]),
    default="merge",
    show_default=True,
    help="What becomes of small segments. Merge: one after the other, the smallest first, becomes part of "
    "the neighbour with the longest common border (then the nearest mean); one that has grown enough stays.",
)
@min_confidence_option
@drawing_options
@style_option
@stream_options
@each_options
@running_options
def command(**options: Any) -> None:
    """Divide RASTER... (many are one mosaic) into levels of v: 0..P, P..2P, and so on up to 1.

    A segment is what adjacent pixels of one level make together; a value on an edge belongs to the level
    below it. Each segment has its level, counted from 0, and the interval of that level; adjacent segments
    share their borders. RASTER may also be a block map from `uavseg divide`, or the YAML file of a ROS map,
    which is never stretched. For another map of probabilities, say --stretch none.

    RASTER may be a folder, a pattern in quotes, @LIST (a file of names) or - (names on standard input). Its
    rasters are one mosaic, unless --each is given.
    """
    from uavseg.jobs.each.each import RegionJob
    from uavseg.jobs.levels import levels
    from uavseg.jobs.source.open_source import open_source
    from uavseg.raster.read.source_list import stem_of
    from uavseg.regions.formats import export

    run = RunOptions.of(options)
    request, read = _request(options), read_options(options)
    if options["each"]:
        answer_each(
            options, RegionJob(read, lambda source, how: levels(source, request, how)), ".levels.geojson", run
        )
        return
    check_alone(options)
    target = options["output"] or f"{stem_of(options['rasters'][0])}.levels.geojson"
    form = geojson_form(options, target)
    labels = options["labels"]
    label_file = LabelFile(labels, creation_of(options, {labels: "uint32"}))
    check_targets(target, labels, run.overwrite)
    style = style_kind(options, target)
    keep_inputs([target, labels], options["rasters"])
    source = open_source(options["rasters"], read)
    export.check_region_crs(target, source.geobox.wkt, form)
    work = run.work()
    found = levels(source, request, work)
    notes = [*stream_warnings(form, source.geobox.wkt), *export.format_notes(found.regions, target)]
    run.reporter.finish([*found.warnings, *notes])
    with transaction():
        write_regions_and_labels(found, target, label_file, work, run.overwrite, form, style)
    rows = {
        "segments": f"{len(found.regions):,} -> {shown(target)}",
        "levels": _levels_row(found, request),
        **summary_rows(found),
        "seconds": f"{run.reporter.seconds:.2f}",
    }
    run.reporter.table(rows)


def _width(found: Extraction, width: float) -> str:
    """The width of a level in v, and in values where they are known."""
    if found.axis is None:
        return f"{width:g} of v"
    first, last = found.axis.values([0, width]).tolist()
    unit = f" {found.axis.unit}" if found.axis.unit else " in values"
    return f"{width:g} of v ({abs(last - first):.6g}{unit})"


def _request(options: dict[str, Any]) -> LevelsRequest:
    from uavseg.jobs.levels import LevelsRequest, level_params
    from uavseg.jobs.ranges.level_breaks import breaks_of_words
    from uavseg.segmentation.params.segment import Levels

    width, breaks = options["width"], options["breaks"]
    if (width is None) == (breaks is None):
        raise click.UsageError("give --width P, or --breaks V,V,... (or otsu, quantile)")
    levels = Levels(width) if breaks is None else breaks_of_words(breaks)
    return LevelsRequest(
        levels,
        level_params(segment_params(options, None), options["refine"], levels),
        drawing(options),
        area(options["min_area"]),
        options["small"],
        length(options["detail"]),
        options["min_confidence"],
    )


def _levels_row(found: Extraction, request: LevelsRequest) -> str:
    """How many levels there are, for the table at the end."""
    from uavseg.jobs.ranges.level_breaks import BreakChoice
    from uavseg.segmentation.params.segment import Levels

    there = len(set(found.regions.columns["level"].tolist()))
    wanted = request.levels
    if isinstance(wanted, BreakChoice):
        columns = found.regions.columns
        intervals = sorted(
            set(zip(columns["range_low"].tolist(), columns["range_high"].tolist(), strict=True))
        )
        shown_ends = [f"{low:.7g}..{high:.7g}" for low, high in intervals[:_LISTED]]
        more = f" and {len(intervals) - _LISTED} more" if len(intervals) > _LISTED else ""
        return f"{there:,} by {wanted.rule}: {', '.join(shown_ends)}{more}"
    each = f", each {_width(found, wanted.width)} wide" if isinstance(wanted, Levels) else ""
    return f"{there:,} of {wanted.count:,} are there{each}"
