"""`uavseg match`: regions of rasters whose texture and intensity are like those of a sample."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli._reading import reading_options
from uavseg.cli._regions import area, check_targets, largest, shown, tell, write_labels, write_regions
from uavseg.cli._running import Reporter, Running, running_options
from uavseg.errors import ParameterError

if TYPE_CHECKING:
    from uavseg.execution.executors import Map
    from uavseg.jobs.match import Match, MatchParams
    from uavseg.raster.dataset import Dataset
    from uavseg.regions.sample.place import Disc


@click.command("match", short_help="Find regions whose texture and intensity are like a sample's.")
@reading_options
@click.option(
    "--like",
    required=True,
    metavar="SAMPLE|X,Y,RADIUS",
    help="The sample: a file of polygons, or a disc in the raster's coordinates (RADIUS in their unit; in "
    "metres where they are degrees).",
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
@click.option(
    "--window",
    type=int,
    default=32,
    show_default=True,
    metavar="PIXELS",
    help="Side of the window whose texture is compared: 16, 24, 32, 48, 64, 96 or 128.",
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
    "--refine",
    type=click.Choice(["pixel", "none"]),
    default="pixel",
    show_default=True,
    help="Boundaries to the pixel, or at the edges of cells of 8 pixels.",
)
@click.option("--min-area", metavar="M2|Npx", help="Drop regions of less.")
@click.option("--fill-holes", metavar="M2|Npx", help="Fill holes of less, before small regions are dropped.")
@click.option(
    "--simplify", type=float, metavar="METRES", help="Simplify outlines; shared borders stay shared."
)
@running_options
def command(
    rasters: tuple[str, ...],
    like: str,
    output: str | None,
    labels: str | None,
    running: Running,
    **options: Any,
) -> None:
    """Find the regions of RASTER... (many are one mosaic) that look like a sample of it.

    Texture is compared by G, the log-likelihood ratio between joint histograms of LBP codes and contrast, so
    that a ploughed field is told from a meadow of the same grey; and what looks more like the raster as a
    whole than like the sample is left out. Each region has its similarity, 1 where it is as like the sample
    as the sample is to itself.
    """
    from uavseg.regions.formats import export
    from uavseg.regions.sample.place import parse_like

    reporter = running.reporter
    target = output or f"{Path(rasters[0]).stem}.match.geojson"
    wanted, params = parse_like(like), _params(running.tile, options)
    check_targets(target, labels, running.overwrite)
    dataset = _opened(rasters, options)
    export.check_region_crs(target, dataset.geobox.wkt)
    run = running.workers()
    reporter.begin(dataset, running.tile)
    found = _found(dataset, wanted, params, running.resuming(run), reporter)
    reporter.finish()
    for warning in found.found.warnings:
        reporter.warn(warning)
    if len(found.found.regions) == 0:
        reporter.warn("nothing is like the sample; a smaller --similarity or a larger --intensity finds more")
    write_regions(found.found, target, running.overwrite)
    if labels is not None:
        write_labels(found.found, labels, run, running)
    _tell(found, target, reporter)


def _params(tile: int | None, options: dict[str, Any]) -> MatchParams:
    from uavseg.jobs.match import MatchParams
    from uavseg.raster.intensity.stretch import parse_stretch

    return MatchParams(
        options["window"],
        options["similarity"],
        options["intensity"],
        options["refine"],
        parse_stretch(options["stretch"]),
        area(options["fill_holes"]),
        area(options["min_area"]),
        options["simplify"],
        tile,
    )


def _opened(rasters: tuple[str, ...], options: dict[str, Any]) -> Dataset:
    from uavseg.raster.dataset import Dataset
    from uavseg.segmentation.blocks.block_file import is_block_map

    if any(is_block_map(raster) for raster in rasters):
        raise ParameterError("a block map holds no texture to be compared; name the raster itself")
    how = (options["band"], options["rgb"], options["nodata"], options["skip_bad_tiles"])
    return Dataset.open(rasters, *how)


def _found(dataset: Dataset, like: Disc | str, params: MatchParams, run: Map, reporter: Reporter) -> Match:
    from uavseg.jobs.match import match
    from uavseg.raster.bad_blocks import BadBlock, listing

    bad: set[BadBlock] = set()
    found = match(dataset, like, params, listing(run, bad), reporter.progress)
    told = (*found.found.warnings, *map(str, sorted(bad)))
    return replace(found, found=replace(found.found, warnings=told))


def _tell(match: Match, target: str, reporter: Reporter) -> None:
    """The short table at the end."""
    from uavseg.units import GREY_MAX

    found = match.found
    unit = "m2" if found.regions.wkt is not None else "square units"
    sample = match.sample
    mean, deviation = sample.mean / GREY_MAX, sample.deviation / GREY_MAX
    rows = {
        "regions": f"{len(found.regions):,} -> {shown(target)}",
        "total area": f"{found.regions.columns['area_m2'].sum():,.1f} {unit}",
        "largest": largest(found, unit),
        "sample": f"{sample.model.count:,} pixels, v {mean:.3f} +- {deviation:.3f}",
        "G per pixel": f"{match.own:.3f} beyond chance in the sample, up to {match.limit:.3f} is like it",
        "stretch": found.stretch.name,
        "band": found.band_names,
        "seconds": f"{reporter.seconds:.2f}",
    }
    tell(rows, reporter)
