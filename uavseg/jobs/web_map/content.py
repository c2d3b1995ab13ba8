"""Content of a web map of a raster: a picture in Web Mercator, and block means for ranges."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, RasterError
from uavseg.execution.executors import phase
from uavseg.jobs.divide import block_map_of
from uavseg.jobs.result.result import SourceInfo
from uavseg.jobs.source.open_source import raster_of
from uavseg.jobs.source.source import Source
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.jobs.web_map.mercator import MercatorImage, to_mercator
from uavseg.raster.geodesy.globe import is_on_earth
from uavseg.raster.grid.ground_grid import GroundGrid, ground_grid
from uavseg.raster.grid.tiling import Window
from uavseg.raster.intensity.stretch import Stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.read.overview import DatasetOverview
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.blocks.leaves import STEPS as STEPS  # for plot, which imports no segmentation
from uavseg.segmentation.blocks.leaves import leaf_codes
from uavseg.segmentation.params.segment import SegmentParams
from uavseg.units import CELL

MIN_SIZE, MAX_SIZE = 64, 8192
MAX_CELLS = 1 << 22  # about 16384 x 16384 pixels


@dataclass(frozen=True, slots=True)
class FieldMapRequest:
    """Options of a web map: the longest side of the picture in pixels, 64 to 8192, and the division.

    `all_cells` tells whether cells are computed even where they are too many for a page.
    """

    segment: SegmentParams = SegmentParams()
    size: int = 2048
    all_cells: bool = False

    def __post_init__(self) -> None:
        if not MIN_SIZE <= self.size <= MAX_SIZE:
            raise ParameterError(
                f"the longest side of the picture is {MIN_SIZE} to {MAX_SIZE} pixels, not {self.size}"
            )


@dataclass(frozen=True)
class CellCodes:
    """Position of the mean of each cell's leaf among the steps of a slider."""

    shape: tuple[int, int]  # rows and columns of the raster
    codes: NDArray[np.uint16]  # (m, n), see `leaf_codes`
    counts: NDArray[np.uint8]  # (m, n) valid pixels


@dataclass(frozen=True)
class FieldMap:
    """A raster for a web map; without cells where it is too large for a page, unless all were requested."""

    image: MercatorImage
    ground: GroundGrid
    cells: CellCodes | None
    info: SourceInfo
    warnings: tuple[str, ...]

    @property
    def fits_page(self) -> bool:
        """Return whether a page can hold the cells."""
        return self.cells is not None and self.cells.codes.size <= MAX_CELLS


def field_map(source: Source, request: FieldMapRequest = FieldMapRequest(), work: Work = SERIAL) -> FieldMap:
    """Compute the picture and the block means of a raster.

    RasterError is raised if it has no place on Earth, or one that a map in Web Mercator cannot show.
    """
    work = work.begun()
    raster = raster_of(source, "a block map holds no picture; name the raster that it was made from")
    if raster.geobox.crs is None or not is_on_earth(raster.geobox.wkt):
        raise RasterError(
            f"{raster.name} has no coordinate system on Earth, so it has no place on a map; give it one "
            "(gdal_edit.py -a_srs), or draw it with uavseg preview"
        )
    ground = ground_grid(raster.geobox)
    tile_pass = work.over(raster)
    saved, info = block_map_of(raster, tile_pass)
    with phase("picture"), work.reading_here():
        coarse = DatasetOverview.of(raster.cleaned(tile_pass.silent), request.size)
        picture = colored(*coarse.read(Window(0, 0, *coarse.geobox.shape)), saved.stretch, coarse)
        image = to_mercator(picture, coarse.geobox, ground, request.size)
    cells, notes = None, info.warnings
    rows, cols = raster.geobox.shape
    if request.all_cells or -(-rows // CELL) * -(-cols // CELL) <= MAX_CELLS:
        cells = _cells(saved.blocks, request.segment)
    else:
        size = f"{cols} x {rows} pixels are too many for the slider of a page"
        notes = (*notes, f"{size}, so it is left out; uavseg serve has one")
    return work.finished(FieldMap(image=image, ground=ground, cells=cells, info=info, warnings=notes))


def _cells(blocks: BlockMap, segment: SegmentParams) -> CellCodes:
    rows, cols = (-(-length // CELL) for length in blocks.shape)
    codes, counts = leaf_codes(blocks, segment.division)[:rows, :cols], blocks.counts[:rows, :cols]
    return CellCodes(
        shape=blocks.shape, codes=np.ascontiguousarray(codes), counts=np.ascontiguousarray(counts)
    )


def colored(
    values: NDArray[Any], valid: NDArray[np.bool_] | None, stretch: Stretch, source: Dataset
) -> NDArray[np.uint8]:
    """Return red, green, blue and alpha: bytes as they are in three bands, else grey through the stretch.

    The values of the source are (1 or 3, rows, cols).
    """
    image = np.full((4, *values.shape[1:]), 255, np.uint8)
    if len(values) == 3 and values.dtype == np.uint8 and source.choice.formula is None:
        image[:3] = values
    else:
        image[:3] = (stretch.apply(values, valid) >> 8).astype(np.uint8)
    if valid is not None:
        image[3] = np.where(valid, 255, 0)
    return image
