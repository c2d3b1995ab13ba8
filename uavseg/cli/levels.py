"""`uavseg levels`: rasters, or a block map, divided into levels of equal width."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from uavseg.cli._write import (
    check_targets,
    keep_inputs,
    shown,
    summary_rows,
    transaction,
    write_regions_and_labels,
)
from uavseg.cli.options.each import answer_each, check_alone, each_options
from uavseg.cli.options.raster import (
    area,
    drawing,
    drawing_options,
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
    from uavseg.jobs.result import Extraction


@click.command("levels", short_help="Divide a raster into levels of equal width, and each into segments.")
@reading_options
@click.option("--width", type=float, required=True, metavar="P", help="Width of a level in v, such as 0.1.")
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
@segmenting_options
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
@drawing_options
@style_option
@stream_options
@each_options
@running_options
def command(**options: Any) -> None:
    """Divide RASTER... (many are one mosaic) into levels of v: 0..P, P..2P, and so on up to 1.

    A segment is what adjacent blocks of one level make together; a value on an edge belongs to the level
    below it. Each segment has its level, counted from 0, and the interval of that level; its borders are
    those of blocks. RASTER may also be a block map from `uavseg divide`, which answers by itself, or the YAML
    file of a ROS map, which is never stretched. For another map of probabilities, say --stretch none.

    RASTER may be a folder, a pattern in quotes, @LIST (a file of names) or - (names on standard input). Its
    rasters are one mosaic, unless --each is given.
    """
    from uavseg.jobs.each import RegionJob
    from uavseg.jobs.levels import levels
    from uavseg.jobs.open_source import open_source
    from uavseg.raster.source_list import stem_of
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
    check_targets(target, labels, run.overwrite)
    style = style_kind(options, target)
    keep_inputs([target, labels], options["rasters"])
    source = open_source(options["rasters"], read)
    export.check_region_crs(target, source.geobox.wkt, form)
    work = run.work()
    found = levels(source, request, work)
    run.reporter.finish([*found.warnings, *stream_warnings(form, source.geobox.wkt)])
    with transaction():
        write_regions_and_labels(found, target, labels, work, run.overwrite, form, style)
    wanted = request.levels
    there = len(set(found.regions.columns["level"].tolist()))
    rows = {
        "segments": f"{len(found.regions):,} -> {shown(target)}",
        "levels": f"{there:,} of {wanted.count:,} are there, each {_width(found, wanted.width)} wide",
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
    from uavseg.jobs.levels import LevelsRequest
    from uavseg.segmentation.params import Levels

    return LevelsRequest(
        Levels(options["width"]),
        segment_params(options, "none"),
        drawing(options),
        area(options["min_area"]),
        options["small"],
    )
