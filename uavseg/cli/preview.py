"""`uavseg preview`: a picture of a raster with what was found in it, or of missions alone."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli.options.raster import read_options, reading_options
from uavseg.cli.options.verbosity import heed_verbose, verbosity_options
from uavseg.cli.terminal.say import say
from uavseg.errors import ParameterError

if TYPE_CHECKING:
    from uavseg.jobs.source.source import ProbabilityMap, Raster
    from uavseg.raster.intensity.stretch import Stretch

_LAYERS = ("levels", "states", "leaves", "labels", "regions", "path", "mission")
_OF_RASTERS = (*_LAYERS[:-1], "band", "rgb", "index", "expr", "band_names", "nodata", "skip_bad_tiles")


@click.command("preview", short_help="Draw a raster with what was found in it, or a mission alone.")
@partial(reading_options, required=False)
@click.option("--regions", type=click.Path(), help="Regions to outline: a file that extract wrote.")
@click.option(
    "--mission",
    multiple=True,
    type=click.Path(),
    help="Mission to draw, in any format of uavseg plan. May be given several times.",
)
@click.option("--states", type=click.Path(), help="States in colour, segments outlined: what classify wrote.")
@click.option("--leaves", type=click.Path(), help="Leaves to outline: the block map that divide wrote.")
@click.option(
    "--labels",
    type=click.Path(),
    help="Segments to outline: the labels that original wrote, or another command with --labels.",
)
@click.option("--levels", type=click.Path(), help="Levels in grey: the segments that levels wrote.")
@click.option("--path", type=click.Path(), help="A path to draw: .geojson, .plan or .waypoints.")
@click.option(
    "--dem",
    multiple=True,
    metavar="DEM.tif",
    help="For missions without RASTER: the ground below them; may be repeated, for a mosaic.",
)
@click.option("-o", "--output", type=click.Path(), help="The picture.  [default: STEM.preview.png]")
@click.option("--width", default=1400, show_default=True, help="Width of the picture in pixels.")
@click.option("--overwrite", is_flag=True, help="Replace a picture that is there.")
@verbosity_options
def command(**options: Any) -> None:
    """Draw RASTER (many are one mosaic, a YAML file is a ROS map) in grey as a PNG picture, with a scale bar
    and what is named: the outlines and ids of regions, the legs of missions in their order with their fence,
    the states or the levels of segments, the contours of labels, the leaves of the quadtree, a path. The
    surer a region is, the stronger it is filled; lines are dashed below a confidence of 0.8 and dotted below
    0.5.

    Without RASTER, missions are drawn on a blank map, with a profile of their heights below; then FILE.plan
    may be given in place of --mission FILE.plan.

    However large the raster is, no more of it is read than the picture can show. A map of probabilities is
    drawn with free cells black and occupied ones white (--stretch none, where it holds floats and neither
    --states nor --path are given).
    """
    heed_verbose(options["quiet"], options["verbose"])
    missions = _missions_alone(options)
    if missions:
        _draw_missions(missions, options)
    else:
        _draw_raster(options)


def _missions_alone(options: dict[str, Any]) -> list[str]:
    """The missions that are drawn without a raster; empty where there is one."""
    from uavseg.flight.formats.files import FORMATS

    rasters, missions = options["rasters"], options["mission"]
    if not rasters and not missions:
        raise click.UsageError("Missing argument 'RASTER...': give a raster, or a mission with --mission.")
    flights = [name for name in rasters if Path(name).suffix.lower() in FORMATS]
    if len(flights) == len(rasters):
        return [*flights, *missions]
    if flights:
        raise ParameterError(
            f"{flights[0]} is a mission and {next(name for name in rasters if name not in flights)} is a "
            f"raster; to draw it over the raster, give --mission {flights[0]}"
        )
    if options["dem"]:
        raise ParameterError(
            "--dem is for the profile of a mission without a raster; leave RASTER or --dem out"
        )
    return []


def _draw_missions(missions: list[str], options: dict[str, Any]) -> None:
    from uavseg.cli._write import warnings_of
    from uavseg.plot.preview_missions import preview_missions

    given = [name for name in _OF_RASTERS if options[name] not in (None, False)]
    given += [name for name in ("stretch", "collar") if options[name] != "auto"]
    if given:
        raise ParameterError(f"--{given[0].replace('_', '-')} needs a raster to draw on: give RASTER as well")
    out = options["output"] or f"{Path(missions[0]).stem}.preview.png"
    how = {"width_px": options["width"], "overwrite": options["overwrite"]}
    _, notes = warnings_of(lambda: preview_missions(missions, out, dem=options["dem"] or None, **how))
    if options["quiet"]:
        return
    for note in notes:
        say(f"note: {note}")
    say(f"wrote {out}")


def _draw_raster(options: dict[str, Any]) -> None:
    from uavseg.cli._write import warnings_of
    from uavseg.jobs.source.source import ProbabilityMap
    from uavseg.jobs.source.work import Work
    from uavseg.plot.preview import preview

    source, stretch = _opened(options)
    out = options["output"] or f"{Path(source.name).stem}.preview.png"
    drawn = {name: options[name] for name in _LAYERS} | {"mission": options["mission"] or None}
    work = Work()
    how = {"stretch": stretch, "width_px": options["width"], "overwrite": options["overwrite"]}
    how["collar"] = "keep" if isinstance(source, ProbabilityMap) else options["collar"]
    with work.reading_here():
        _, notes = warnings_of(lambda: preview(source.dataset, out, **drawn, **how))
    if options["quiet"]:
        return
    for warning in (*source.warnings, *work.bad_block_warnings, *notes):
        say(f"uavseg: warning: {warning}")
    say(f"wrote {out}")


def _opened(options: dict[str, Any]) -> tuple[Raster | ProbabilityMap, Stretch | str]:
    """The raster and its stretch; a ROS map has its own unless one is named."""
    from dataclasses import replace

    from uavseg.jobs.source.open_source import open_pixels
    from uavseg.jobs.source.source import ProbabilityMap
    from uavseg.raster.intensity.stretch import Stretch

    rasters, stretch = options["rasters"], options["stretch"]
    read = replace(read_options(options), stretch=None)
    source = open_pixels(rasters, read)
    if not isinstance(source, ProbabilityMap):
        return source, stretch
    assert isinstance(source.stretch, Stretch)
    return source, source.stretch if stretch == "auto" else stretch
