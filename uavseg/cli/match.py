"""`uavseg match`: regions of rasters that look like a sample of them, by color and texture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from uavseg.cli._write import (
    LabelFile,
    check_targets,
    confidence_row,
    keep_inputs,
    shown,
    summary_rows,
    transaction,
    write_regions_and_labels,
)
from uavseg.cli.options.bands import many_bands
from uavseg.cli.options.creation import creation_of, creation_option
from uavseg.cli.options.each import answer_each, check_alone, each_options
from uavseg.cli.options.raster import (
    area,
    drawing,
    length,
    min_confidence_option,
    read_options,
    reading_options,
)
from uavseg.cli.options.running import RunOptions, running_options
from uavseg.cli.options.stream import geojson_form, stream_options, stream_warnings
from uavseg.cli.options.style import style_kind, style_option

if TYPE_CHECKING:
    from uavseg.jobs.match.by_classes import MatchClassesRequest
    from uavseg.jobs.match.match import Match
    from uavseg.jobs.match.request import MatchRequest
    from uavseg.jobs.result.result import Extraction
    from uavseg.jobs.source.source import Source
    from uavseg.jobs.source.work import Work


@click.command("match", short_help="Find regions that look like a sample.")
@reading_options
@click.option(
    "--like",
    multiple=True,
    metavar="SAMPLE|X,Y,RADIUS",
    help="The sample: a file of polygons, or a disc in the raster's coordinates (RADIUS in their unit; in "
    "metres where they are degrees). May be given several times.",
)
@click.option(
    "--unlike",
    multiple=True,
    metavar="SAMPLE|X,Y,RADIUS",
    help="A sample of what is not wanted; may be given several times.",
)
@click.option(
    "--classes",
    metavar="SAMPLES",
    help="In place of --like: a file of polygons with a column class; every pixel is of the likeliest class, "
    "or of none.",
)
@click.option(
    "-o",
    "--output",
    metavar="PATH",
    help="The regions: .geojson, .gpkg, .fgb, .parquet, .shp or .kml; - is GeoJSON on stdout.  "
    "[default: STEM.match.geojson here]",
)
@click.option(
    "--labels",
    metavar="PATH",
    help="Also write the labels of the regions as a raster: one .tif, or a .vrt over a folder of tiles.",
)
@creation_option
@click.option(
    "--by",
    type=click.Choice(["auto", "color", "texture"]),
    default="auto",
    show_default=True,
    help="What is compared: color, texture with intensity, or what parts the sample from the raster.",
)
@click.option(
    "--window",
    type=int,
    metavar="PIXELS",
    help="Side of the window whose texture is compared: 16, 24, 32, 48, 64, 96 or 128.  "
    "[default: 32, or 24 or 16 where the sample is small]",
)
@click.option(
    "--similarity",
    type=float,
    default=0.9,
    show_default=True,
    metavar="S",
    help="How like the sample's own windows a window must be, up to 1; less finds more.",
)
@click.option(
    "--intensity",
    type=float,
    default=1.0,
    show_default=True,
    metavar="K|inf",
    help="By how many of the sample's deviations the mean may differ; inf: texture alone.",
)
@click.option(
    "--bands",
    metavar="BAND,...",
    callback=many_bands,
    help="Compare these bands, each by itself; beside texture too.",
)
@click.option(
    "--refine",
    type=click.Choice(["pixel", "none"]),
    default="pixel",
    show_default=True,
    help="Boundaries to the pixel, or at the edges of cells of 8 pixels.",
)
@click.option(
    "--detail",
    metavar="M|Npx",
    help="Leave out what is narrower, cut necks and close gaps that are; before holes are filled.",
)
@click.option("--min-area", metavar="M2|Npx", help="Drop regions of less.")
@click.option("--fill-holes", metavar="M2|Npx", help="Fill holes of less, before small regions are dropped.")
@min_confidence_option
@click.option(
    "--simplify", type=float, metavar="METRES", help="Simplify outlines; shared borders stay shared."
)
@style_option
@stream_options
@each_options
@running_options
def command(**options: Any) -> None:
    """Find the regions of RASTER... (many are one mosaic) that look like a sample of it.

    By color: mixtures of few kinds of ground are fitted to the colors of the whole raster, and those that are
    far more frequent in the sample than elsewhere are its kind. A radius of 8 pixels is enough.

    By texture: G, the log-likelihood ratio between joint histograms of LBP codes and contrast, tells a
    ploughed field from a meadow of the same grey; what looks more like the raster as a whole than like the
    sample is left out. The sample has a radius of 16 pixels at least, better 32.

    By default color; of what has the colors of the sample, texture decides where it clearly shows two kinds;
    and texture with intensity where color hardly parts the sample from the raster, or where --window,
    --similarity or --intensity is given. The table at the end says which. Several samples, and those of what
    is --unlike, are compared by color. With --classes, a whole map: samples of each class against those of
    all others; what is like none of them is left out.

    Where color leaves much of the raster undecided, a line says where to look, and what to add: the disc that
    would help most as another sample.

    Each region has its similarity, 1 where it is as like the sample as the sample is to itself.

    RASTER may be a folder, a pattern in quotes, @LIST (a file of names) or - (names on standard input). Its
    rasters are one mosaic, unless --each is given.
    """
    from uavseg.jobs.each.each import RegionJob
    from uavseg.jobs.match.by_classes import match_classes
    from uavseg.jobs.match.match import match
    from uavseg.jobs.match.request import MatchRequest
    from uavseg.jobs.source.open_source import open_source
    from uavseg.raster.read.source_list import stem_of
    from uavseg.regions.formats import export

    run = RunOptions.of(options)
    _check_samples(options)
    request, read = _request(options), read_options(options)

    def find(source: Source, how: Work) -> tuple[Extraction, dict[str, str], str | None]:
        if isinstance(request, MatchRequest):
            made = match(source, request, how)
            return made.found, _compared(made), made.advice
        found = match_classes(source, request, how)
        return found, _classes(found), None

    if options["each"]:
        answer_each(
            options,
            RegionJob(read, lambda source, how: find(source, how)[0]),
            ".match.geojson",
            run,
        )
        return
    check_alone(options)
    target = options["output"] or f"{stem_of(options['rasters'][0])}.match.geojson"
    form = geojson_form(options, target)
    labels = options["labels"]
    label_file = LabelFile(labels, creation_of(options, {labels: "uint32"}))
    check_targets(target, labels, run.overwrite)
    style = style_kind(options, target)
    keep_inputs([target, labels], options["rasters"], options["like"], options["unlike"], options["classes"])
    source = open_source(options["rasters"], read)
    export.check_region_crs(target, source.geobox.wkt, form)
    work = run.work()
    found, compared, advice = find(source, work)
    notes = [*stream_warnings(form, source.geobox.wkt), *export.format_notes(found.regions, target)]
    run.reporter.finish([*found.warnings, *notes])
    if advice is not None:
        run.reporter.say(advice)
    with transaction():
        write_regions_and_labels(found, target, label_file, work, run.overwrite, form, style)
    common = summary_rows(found)
    rows = {
        "regions": f"{len(found.regions):,} -> {shown(target)}",
        "total area": common["total area"],
        "largest": common["largest"],
        **confidence_row(found),
        **compared,
        "stretch": common["stretch"],
        "band": common["band"],
    }
    run.reporter.table(rows | {"seconds": f"{run.reporter.seconds:.2f}"})


def _check_samples(options: dict[str, Any]) -> None:
    """Either samples of one kind, or of classes."""
    if options["classes"] is None:
        if not options["like"]:
            raise click.UsageError("give a sample with --like, or samples of several classes with --classes")
        return
    alone = ("like", "unlike", "window")
    given = [f"--{name}" for name in alone if options[name]]
    usual = {"by": "auto", "similarity": 0.9, "intensity": 1.0}
    given += [f"--{name}" for name, value in usual.items() if options[name] != value]
    if given:
        raise click.UsageError(
            f"--classes compares the colors of all its samples; leave out {', '.join(given)}"
        )


def _request(options: dict[str, Any]) -> MatchRequest | MatchClassesRequest:
    from uavseg.jobs.match.by_classes import MatchClassesRequest
    from uavseg.jobs.match.request import MatchRequest
    from uavseg.regions.sample.place import parse_like

    if options["classes"] is not None:
        return MatchClassesRequest(
            options["classes"],
            options["refine"],
            drawing(options),
            area(options["fill_holes"]),
            area(options["min_area"]),
            options["bands"],
            length(options["detail"]),
            options["min_confidence"],
        )
    return MatchRequest(
        tuple(map(parse_like, options["like"])),
        options["window"],
        options["similarity"],
        options["intensity"],
        options["refine"],
        drawing(options),
        area(options["fill_holes"]),
        area(options["min_area"]),
        options["bands"],
        options["by"],
        tuple(map(parse_like, options["unlike"])),
        length(options["detail"]),
        options["min_confidence"],
    )


def _compared(match: Match) -> dict[str, str]:
    """What was compared, and what it says of the sample."""
    from uavseg.units import GREY_MAX

    color, texture = match.color, match.texture
    rows = {"compared": match.compared if color is not None else "texture and intensity"}
    if color is not None:
        rows["likeness"] = f"{color.own:.2f} in the sample, {color.share:.2f} in the raster"
        if color.unlike is not None:
            rows["likeness"] += f", {color.unlike:.2f} in what is unlike"
    if texture is not None:
        sample = texture.sample
        mean, deviation = sample.mean / GREY_MAX, sample.deviation / GREY_MAX
        rows["sample"] = f"{sample.model.count:,} pixels, v {mean:.3f} +- {deviation:.3f}"
        rows["window"] = f"{texture.window} pixels"
        rows["G per pixel"] = (
            f"{texture.own:.3f} beyond chance in the sample, up to {texture.limit:.3f} is like it"
        )
    return rows


def _classes(found: Extraction) -> dict[str, str]:
    """How many regions each class has."""
    from collections import Counter

    counts = Counter(found.regions.columns["class"].tolist())
    parts = [f"{name} {count:,}" for name, count in sorted(counts.items())]
    return {"classes": ", ".join(parts) or "none"}
