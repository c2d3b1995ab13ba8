"""Division of a raster into a block map, from which any range is answered later."""

from uavseg.dataclass import dataclass
from uavseg.execution.executors import decided, phase
from uavseg.jobs.result.result import SourceInfo
from uavseg.jobs.source.open_source import pixels_of
from uavseg.jobs.source.source import ProbabilityMap, Raster, Source
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.raster.grid.tiling import TilePass
from uavseg.segmentation.blocks.block_file import SavedBlocks
from uavseg.segmentation.pipeline import measure_block_map


@dataclass(frozen=True)
class Division:
    """A block map, ready to be saved."""

    saved: SavedBlocks
    warnings: tuple[str, ...]


def divide(source: Source, work: Work = SERIAL) -> Division:
    """Compute the whole block map of a raster or a map of probabilities."""
    work = work.begun()
    pixels = pixels_of(source, "a block map is divided already; name the raster itself")
    saved, info = block_map_of(pixels, work.over(pixels))
    return work.finished(Division(saved, info.warnings))


def block_map_of(source: Raster | ProbabilityMap, tile_pass: TilePass) -> tuple[SavedBlocks, SourceInfo]:
    """Return the block map of a raster or a map of probabilities, and what there is to say of the source."""
    stretching, dividing = tile_pass.stages(2)
    grey = source.grey(stretching)
    with phase("division"):
        blocks = measure_block_map(grey, dividing)
    decided("%d x %d blocks of 64 x 64 pixels", *blocks.blocks)
    dataset, info = source.dataset, SourceInfo.of(grey)
    saved = SavedBlocks(
        blocks,
        dataset.geobox,
        grey.stretch,
        dataset.band_names,
        source.origin,
        axis=info.axis,
        illumination=grey.illumination,
    )
    return saved, info
