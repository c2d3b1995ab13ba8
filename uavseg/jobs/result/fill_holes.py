"""Small holes of outlined regions, filled with the sums of the pixels that are then enclosed."""

from dataclasses import replace

from uavseg.raster.grid.tiling import TilePass
from uavseg.regions.edit.small import Area, fill_small_holes
from uavseg.regions.outline.rings import RegionOutlines
from uavseg.regions.tiles.range_tiles import sum_regions
from uavseg.segmentation.source import GreySource


def filled(
    grey: GreySource, outlined: RegionOutlines, smallest: Area | None, tile_pass: TilePass
) -> RegionOutlines:
    """Regions whose holes of less than an area are filled, with the sums of all pixels they then enclose."""
    if smallest is None:
        return outlined
    found = fill_small_holes(outlined, grey.dataset.geobox, smallest)
    return outlined if found is outlined else replace(found, sums=sum_regions(grey, found, tile_pass))
