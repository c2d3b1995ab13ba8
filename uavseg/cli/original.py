"""`uavseg original`: the original LBP/C, for comparison."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli._reading import reading_options
from uavseg.cli._running import Running, running_options
from uavseg.errors import ParameterError

if TYPE_CHECKING:
    from uavseg.execution.executors import Map
    from uavseg.raster.dataset import Dataset
    from uavseg.segmentation.source import GreyTile


@click.command("original")
@reading_options
@click.option("-o", "--output", required=True, metavar="LABELS.tif", help="The labels of the segments.")
@click.option(
    "--threshold",
    type=float,
    default=1.2,
    show_default=True,
    metavar="X",
    help="Divide where G_max / G_min is larger.",
)
@click.option(
    "--merge-stop",
    type=float,
    default=2.0,
    show_default=True,
    metavar="Y",
    help="Stop merging where MI / (largest MI before) is larger.",
)
@click.option(
    "--untested",
    type=float,
    default=0.1,
    show_default=True,
    metavar="SHARE",
    help="Of all possible merges, during which that is not tested.",
)
@click.option(
    "--radius", type=int, default=11, show_default=True, metavar="PIXELS", help="Of the disc around a pixel."
)
@click.option(
    "--sweeps", type=int, default=32, show_default=True, metavar="N", help="Over the pixels along boundaries."
)
@running_options
def command(
    rasters: tuple[str, ...],
    output: str,
    running: Running,
    **options: Any,
) -> None:
    """Segment RASTER... (many are one mosaic) by texture alone, as Ojala and Pietikäinen did in 1999.

    The baseline: blocks are divided, adjacent regions of like texture merged, boundary pixels classified one
    by one. All of the image is held in memory, at most 4096 x 4096 pixels.
    """
    from uavseg.atomic import check_target
    from uavseg.raster.bad_blocks import BadBlock, listening, listing
    from uavseg.raster.dataset import Dataset
    from uavseg.raster.formats.geotiff import write_labels
    from uavseg.raster.tiling import Window
    from uavseg.segmentation.baseline.lbpc import LbpcParams, check_lbpc_size, segment_lbpc

    reporter = running.reporter
    params = LbpcParams(
        options["threshold"],
        options["merge_stop"],
        options["untested"],
        options["radius"],
        options["sweeps"],
    )
    if Path(output).suffix.lower() not in (".tif", ".tiff"):
        raise ParameterError(f"labels are written as GeoTIFF; name a .tif, not {output}")
    check_target(output, running.overwrite)
    dataset = Dataset.open(
        rasters, options["band"], options["rgb"], options["nodata"], options["skip_bad_tiles"]
    )
    rows, cols = dataset.geobox.shape
    check_lbpc_size((rows, cols))
    bad: set[BadBlock] = set()
    run = listing(running.resuming(running.workers()), bad)
    with listening(bad):
        image, told, name = _read(dataset, options["stretch"], running.tile, run)
    labels = segment_lbpc(image.grey[:rows, :cols], image.valid[:rows, :cols] > 0, params)
    write_labels(output, [(Window(0, 0, rows, cols), labels)], dataset.geobox, running.overwrite)
    reporter.finish()
    for warning in (*told, *map(str, sorted(bad))):
        reporter.warn(warning)
    reporter.say(f"  segments    {int(labels.max()):,} -> {output}")
    reporter.say(f"  stretch     {name}")
    reporter.say(f"  band        {dataset.band_names}")
    reporter.say(f"  seconds     {reporter.seconds:.2f}")


def _read(
    dataset: Dataset, stretch: str, tile: int | None, run: Map
) -> tuple[GreyTile, tuple[str, ...], str]:
    """The whole raster as grey, what there is to tell, and the stretch that was used."""
    from uavseg.raster.intensity.stretch import fit
    from uavseg.raster.tile_pass import TilePass
    from uavseg.raster.tiling import Window
    from uavseg.segmentation.source import GreySource

    fitted = fit(dataset, stretch, TilePass.over(dataset, tile, run))
    image = GreySource(dataset, fitted).read(Window(0, 0, *dataset.geobox.shape), 0)
    return image, dataset.warnings + fitted.warnings, fitted.name
