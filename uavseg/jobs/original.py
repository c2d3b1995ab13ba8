"""Segmentation by the original LBP/C, for comparison."""

from uavseg.arrays import Uint32s
from uavseg.dataclass import dataclass
from uavseg.jobs.result.result import SourceInfo
from uavseg.jobs.source.open_source import pixels_of
from uavseg.jobs.source.source import Source
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.raster.grid.tiling import Window
from uavseg.segmentation.lbpc import LbpcParams, check_lbpc_size, segment_lbpc


@dataclass(frozen=True)
class OriginalSegments:
    """Labels of segments, (rows, cols)."""

    labels: Uint32s
    source: SourceInfo
    warnings: tuple[str, ...]


def original(source: Source, request: LbpcParams = LbpcParams(), work: Work = SERIAL) -> OriginalSegments:
    """Return segments by texture alone (Ojala, Pietikäinen, 1999); RasterError above 4096 x 4096 pixels."""
    work = work.begun()
    pixels = pixels_of(source, "a block map is divided already; name the raster itself")
    rows, cols = pixels.geobox.shape
    check_lbpc_size((rows, cols))
    with work.reading_here():
        grey = pixels.grey(work.over(pixels).silent)
        image = grey.read(Window(0, 0, rows, cols), 0)
    labels = segment_lbpc(image.grey[:rows, :cols], image.valid[:rows, :cols] > 0, request)
    info = SourceInfo.of(grey)
    return work.finished(OriginalSegments(labels, info, info.warnings))
