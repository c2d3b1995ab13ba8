"""`uavseg preview`: a picture of a raster with what was found in it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli._options import read_options, reading_options
from uavseg.cli._say import say

if TYPE_CHECKING:
    from uavseg.jobs.source import ProbabilityMap, Raster
    from uavseg.raster.intensity.stretch import Stretch

_LAYERS = ("levels", "states", "leaves", "regions", "path", "mission")


@click.command("preview", short_help="Draw a raster with what was found in it.")
@reading_options
@click.option("--regions", type=click.Path(), help="Regions to outline: a file that extract wrote.")
@click.option("--mission", type=click.Path(), help="Mission to draw: a file of uavseg plan.")
@click.option("--states", type=click.Path(), help="States in colour, segments outlined: what classify wrote.")
@click.option("--leaves", type=click.Path(), help="Leaves to outline: the block map that divide wrote.")
@click.option("--levels", type=click.Path(), help="Levels in grey: the segments that levels wrote.")
@click.option("--path", type=click.Path(), help="A path to draw: .geojson, .plan or .waypoints.")
@click.option("-o", "--output", type=click.Path(), help="The picture.  [default: STEM.preview.png]")
@click.option("--width", default=1400, show_default=True, help="Width of the picture in pixels.")
@click.option("--overwrite", is_flag=True, help="Replace a picture that is there.")
@click.option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")
def command(**options: Any) -> None:
    """Draw RASTER (many are one mosaic, a YAML file is a ROS map) in grey as a PNG picture, with a scale bar
    and what is named: the outlines and ids of regions, the legs of a mission in their order, the states or
    the levels of segments, the leaves of the quadtree, a path.

    However large the raster is, no more of it is read than the picture can show. A map of probabilities is
    drawn with free cells black and occupied ones white (--stretch none, where it holds floats and neither
    --states nor --path are given).
    """
    from uavseg.jobs.work import Work
    from uavseg.plot.preview import preview

    source, stretch = _opened(options)
    out = options["output"] or f"{Path(source.name).stem}.preview.png"
    drawn = {name: options[name] for name in _LAYERS}
    work = Work()
    with work.reading_here():
        preview(
            source.dataset,
            out,
            **drawn,
            stretch=stretch,
            width_px=options["width"],
            overwrite=options["overwrite"],
        )
    if options["quiet"]:
        return
    for warning in (*source.warnings, *map(str, sorted(work.bad_blocks))):
        say(f"uavseg: warning: {warning}")
    say(f"wrote {out}")


def _opened(options: dict[str, Any]) -> tuple[Raster | ProbabilityMap, Stretch | str]:
    """The raster and its stretch; a ROS map has its own unless one is named."""
    from dataclasses import replace

    from uavseg.jobs.open_source import open_raster, open_source
    from uavseg.jobs.source import ProbabilityMap
    from uavseg.raster.intensity.stretch import Stretch

    rasters, stretch = options["rasters"], options["stretch"]
    read = replace(read_options(options), stretch=None)
    if not rasters[0].lower().endswith((".yaml", ".yml")):
        return open_raster(rasters, read), stretch
    source = open_source(rasters, read)
    assert isinstance(source, ProbabilityMap) and isinstance(source.stretch, Stretch)
    return source, source.stretch if stretch == "auto" else stretch
