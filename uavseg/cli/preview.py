"""uavseg preview: a picture of a raster with its regions and the mission."""

from pathlib import Path
from typing import Any

import click

from uavseg.cli._reading import reading_options


@click.command("preview", short_help="Draw a raster with its regions and a mission.")
@reading_options
@click.option("--regions", type=click.Path(), help="Regions to outline: a file that extract wrote.")
@click.option("--mission", type=click.Path(), help="Mission to draw: a .plan or .waypoints file.")
@click.option("-o", "--output", type=click.Path(), help="The picture.  [default: STEM.preview.png]")
@click.option("--width", default=1400, show_default=True, help="Width of the picture in pixels.")
@click.option("--overwrite", is_flag=True, help="Replace a picture that is there.")
@click.option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")
def command(
    rasters: tuple[str, ...],
    band: int | None,
    rgb: tuple[int, int, int] | None,
    nodata: float | None,
    stretch: str,
    skip_bad_tiles: bool,
    output: str | None,
    quiet: bool,
    **drawn: Any,
) -> None:
    """Draw RASTER (many are one mosaic) in grey, with the outlines and ids of regions, the legs of a mission
    in their order, and a scale bar, as a PNG picture.

    However large the raster is, no more of it is read than the picture can show.
    """
    from uavseg.look.preview import preview
    from uavseg.raster.dataset import Dataset
    from uavseg.raster.skipping import BadBlock, listening

    dataset = Dataset.open(rasters, band=band, rgb=rgb, nodata=nodata, skip_bad_tiles=skip_bad_tiles)
    out = output or f"{Path(dataset.source).stem}.preview.png"
    bad: set[BadBlock] = set()
    with listening(bad):
        preview(dataset, out, drawn["regions"], drawn["mission"], stretch=stretch, **_layout(drawn))
    if quiet:
        return
    for warning in (*dataset.warnings, *map(str, sorted(bad))):
        click.echo(f"uavseg: warning: {warning}", err=True)
    click.echo(f"wrote {out}", err=True)


def _layout(drawn: dict[str, Any]) -> dict[str, Any]:
    return {"width_px": drawn["width"], "overwrite": drawn["overwrite"]}
