"""uavseg preview: a picture of a raster with what was found in it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli._reading import reading_options

if TYPE_CHECKING:
    from uavseg.raster.dataset import Dataset
    from uavseg.raster.intensity.stretch import Stretch

_LAYERS = ("levels", "states", "leaves", "regions", "path", "mission")


@click.command("preview", short_help="Draw a raster with what was found in it.")
@reading_options
@click.option("--regions", type=click.Path(), help="Regions to outline: a file that extract wrote.")
@click.option("--mission", type=click.Path(), help="Mission to draw: a .plan or .waypoints file.")
@click.option("--states", type=click.Path(), help="States in colour, segments outlined: what classify wrote.")
@click.option("--leaves", type=click.Path(), help="Leaves to outline: the block map that divide wrote.")
@click.option("--levels", type=click.Path(), help="Levels in grey: the segments that levels wrote.")
@click.option("--path", type=click.Path(), help="A path to draw: .geojson, .plan or .waypoints.")
@click.option("-o", "--output", type=click.Path(), help="The picture.  [default: STEM.preview.png]")
@click.option("--width", default=1400, show_default=True, help="Width of the picture in pixels.")
@click.option("--overwrite", is_flag=True, help="Replace a picture that is there.")
@click.option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")
def command(
    rasters: tuple[str, ...],
    stretch: str,
    output: str | None,
    width: int,
    overwrite: bool,
    quiet: bool,
    **options: Any,
) -> None:
    """Draw RASTER (many are one mosaic, a YAML file is a ROS map) in grey as a PNG picture, with a scale bar
    and what is named: the outlines and ids of regions, the legs of a mission in their order, the states or
    the levels of segments, the leaves of the quadtree, a path.

    However large the raster is, no more of it is read than the picture can show. A map of probabilities is
    drawn with free cells black and occupied ones white (--stretch none, where it holds floats and neither
    --states nor --path are given).
    """
    from uavseg.plot.preview import preview
    from uavseg.raster.bad_blocks import BadBlock, recording_bad_blocks

    dataset, grey = _opened(rasters, stretch, options)
    out = output or f"{Path(dataset.source).stem}.preview.png"
    bad: set[BadBlock] = set()
    with recording_bad_blocks(bad):
        drawn = {name: options[name] for name in _LAYERS}
        preview(dataset, out, **drawn, stretch=grey, width_px=width, overwrite=overwrite)
    if quiet:
        return
    for warning in (*dataset.warnings, *map(str, sorted(bad))):
        click.echo(f"uavseg: warning: {warning}", err=True)
    click.echo(f"wrote {out}", err=True)


def _opened(rasters: tuple[str, ...], stretch: str, options: dict[str, Any]) -> tuple[Dataset, Stretch | str]:
    """The raster and its stretch; a ROS map has its own unless one is named."""
    from uavseg.occupancy.probability_map import open_map
    from uavseg.occupancy.ros.ros_map import is_ros_map
    from uavseg.raster.dataset import Dataset

    if len(rasters) == 1 and is_ros_map(rasters[0]):
        dataset, own = open_map(rasters[0])
        return dataset, own if stretch == "auto" else stretch
    how = (options[name] for name in ("band", "rgb", "nodata", "skip_bad_tiles"))
    return Dataset.open(rasters, *how), stretch
