"""Division of a raster into a block map, which answers any range later, and by the original LBP/C."""

from uavseg.arrays import Uint32s
from uavseg.dataclass import dataclass
from uavseg.execution.executors import decided, phase
from uavseg.jobs.result.result import SourceInfo
from uavseg.jobs.source.open_source import pixels_of
from uavseg.jobs.source.source import ProbabilityMap, Raster, Source
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.raster.grid.tiling import TilePass, Window
from uavseg.segmentation.blocks.block_file import SavedBlocks
from uavseg.segmentation.lbpc import LbpcParams, check_lbpc_size, segment_lbpc
from uavseg.segmentation.pipeline import measure_block_map

_DIVIDED = "a block map is divided already; name the raster itself"


@dataclass(frozen=True)
class Division:
    """A block map, ready to be saved."""

    saved: SavedBlocks
    warnings: tuple[str, ...]


def divide(source: Source, work: Work = SERIAL) -> Division:
    """Compute the whole block map of a raster or a map of probabilities."""
    work = work.begun()
    pixels = pixels_of(source, _DIVIDED)
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


@dataclass(frozen=True)
class OriginalSegments:
    """Labels of segments, (rows, cols)."""

    labels: Uint32s
    source: SourceInfo
    warnings: tuple[str, ...]


def original(source: Source, request: LbpcParams = LbpcParams(), work: Work = SERIAL) -> OriginalSegments:
    """Return segments by texture alone (Ojala, Pietikäinen, 1999); RasterError above 4096 x 4096 pixels."""
    work = work.begun()
    pixels = pixels_of(source, _DIVIDED)
    rows, cols = pixels.geobox.shape
    check_lbpc_size((rows, cols))
    with work.reading_here():
        grey = pixels.grey(work.over(pixels).silent)
        image = grey.read(Window(0, 0, rows, cols), 0)
    labels = segment_lbpc(image.grey[:rows, :cols], image.valid[:rows, :cols] > 0, request)
    info = SourceInfo.of(grey)
    return work.finished(OriginalSegments(labels, info, info.warnings))
