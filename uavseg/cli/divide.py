"""`uavseg divide`: rasters become a block map."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from uavseg.cli._reading import reading_options
from uavseg.cli._running import Running, running_options
from uavseg.cli._segmenting import segmenting_options


@click.command("divide")
@reading_options
@click.option("-o", "--output", required=True, metavar="PATH.tif", help="The block map.")
@segmenting_options
@running_options
def command(
    rasters: tuple[str, ...],
    output: str,
    running: Running,
    **options: Any,
) -> None:
    """Divide RASTER... (many are one mosaic) into blocks of uniform texture, and save the block map.

    It is a GeoTIFF of 8 x 8 pixel cells. Its first two bands are for looking at: the mean and the side of
    each leaf. `uavseg extract` answers any range from it, without the raster or refined with it.
    """
    from uavseg.atomic import check_target
    from uavseg.jobs.extract import divide
    from uavseg.raster.bad_blocks import BadBlock, listing
    from uavseg.raster.dataset import Dataset
    from uavseg.segmentation.blocks.block_file import Origin, SavedBlocks, write_block_map
    from uavseg.segmentation.params import SegmentParams

    reporter = running.reporter
    check_target(output, running.overwrite)
    params = SegmentParams(options["method"], options["threshold"], options["intensity_step"])
    dataset = Dataset.open(
        rasters, options["band"], options["rgb"], options["nodata"], options["skip_bad_tiles"]
    )
    bad: set[BadBlock] = set()
    run = listing(running.resuming(running.workers()), bad)
    reporter.begin(dataset, running.tile)
    blocks, stretch = divide(dataset, options["stretch"], running.tile, run, reporter.progress)
    origin = Origin(rasters, str(Path.cwd()), options["band"], options["rgb"], options["nodata"])
    saved = SavedBlocks(blocks, dataset.geobox, stretch, dataset.band_names, origin)
    write_block_map(output, saved, params.division, running.overwrite)
    reporter.finish()
    for warning in (*dataset.warnings, *stretch.warnings, *map(str, sorted(bad))):
        reporter.warn(warning)
    rows, cols = blocks.blocks
    reporter.say(f"  blocks      {rows * cols:,} of 64 x 64 -> {output}")
    reporter.say(f"  stretch     {stretch.name}")
    reporter.say(f"  band        {dataset.band_names}")
    reporter.say(f"  seconds     {reporter.seconds:.2f}")
