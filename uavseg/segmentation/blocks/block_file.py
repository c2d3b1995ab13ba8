"""Block maps as GeoTIFF: leaves as bands to display, the block map itself in further pages."""

import json
import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import RasterError, RasterReadError, UavsegError
from uavseg.output.targets import check_not_inputs
from uavseg.plain_text import cause_of
from uavseg.raster.formats.creation import DEFAULT, CreationOptions
from uavseg.raster.formats.geotiff import Page, check_geotiff_name, read_geotiff, write_geotiff_pages
from uavseg.raster.grid.geobox import GeoBox, scaled
from uavseg.raster.intensity.stretch import Stretch
from uavseg.segmentation.blocks.block_map import BlockMap, find_leaves
from uavseg.segmentation.blocks.saved_blocks import (
    Origin,
    SavedBlocks,
    axis_of_header,
    checked_header,
    header_text,
    origin_of_header,
)
from uavseg.segmentation.params.illumination import Illumination
from uavseg.segmentation.params.segment import DivisionParams
from uavseg.units import BLOCK, CELL, CELLS, GREY_MAX

if TYPE_CHECKING:
    from rasterio.io import DatasetReader

_TAG = "UAVSEG_BLOCK_MAP"
_BAND_NAMES = ("mean v", "side of the leaf in pixels")
_RATIO_NAMES = ("R of 64", *(f"R of 32, {k}" for k in range(4)), *(f"R of 16, {k}" for k in range(16)))
_SUMS, _COUNTS, _RATIOS, _ILLUMINATION = 2, 3, 4, 5  # pages of the file


def is_block_map(file: "DatasetReader") -> bool:
    """Test whether an open raster is a block map, and not any other raster."""
    return _TAG in file.tags()


def rasters_of(path: str | os.PathLike[str], tags: Mapping[str, str]) -> list[str]:
    """Return the paths of the rasters that a block map of these tags was made from; none for other files."""
    if _TAG not in tags:
        return []
    try:
        header = json.loads(tags[_TAG])
        return Origin(tuple(header["rasters"]), header["folder"]).find_rasters(path) or []
    except (UavsegError, KeyError, ValueError, TypeError):
        return []  # the error is reported when the file is opened


def check_block_map_name(path: str | os.PathLike[str]) -> None:
    """Refuse a file name that a block map cannot have, with OutputError, before the work starts."""
    check_geotiff_name(path, "a block map")


def write_block_map(
    path: str | os.PathLike[str],
    saved: SavedBlocks,
    division: DivisionParams,
    overwrite: bool = False,
    creation: CreationOptions = DEFAULT,
) -> None:
    """Write a block map; a pixel of the file is a cell of 8 x 8 pixels.

    The bands that a viewer displays are the mean v and the side of each leaf, for the X and tau of
    `division`. Further pages hold the block map itself: sums and counts of the cells, and R of all blocks
    with a pixel for each block of 64. `creation` is how integers, which most of the file holds, are stored.
    An OutputExistsError or OutputError says that the file exists, is not named .tif, cannot be written, or is
    one of the rasters that the block map was made from.
    """
    check_block_map_name(path)
    check_not_inputs([path], saved.origin.find_rasters(path) or [])
    blocks, cells = saved.blocks, saved.geobox.coarsen(CELL)
    side, mean = find_leaves(blocks, division)
    bands = [np.where(mean < 0, np.nan, mean).astype(np.float32), side.astype(np.float32)]
    write_geotiff_pages(
        path,
        [
            Page([_crop(band, cells) for band in bands], cells, _BAND_NAMES, nodata=float("nan")),
            Page([_crop(blocks.sums, cells)], cells, ["sum of grey"]),
            Page([_crop(blocks.counts, cells)], cells, ["valid pixels"]),
            Page(list(blocks.ratios.transpose(2, 0, 1)), saved.geobox.coarsen(CELL * CELLS), _RATIO_NAMES),
            *_illumination_pages(saved),
        ],
        {_TAG: header_text(saved)},
        overwrite,
        creation,
    )


def _illumination_pages(saved: SavedBlocks) -> list[Page]:
    """Return the page of the illumination that was subtracted, if any, with a pixel for each square."""
    flat = saved.illumination
    if flat is None:
        return []
    return [Page([flat.nodes], saved.geobox.coarsen(flat.step), ["light that was taken away, in grey"])]


def _crop(band: NDArray[Any], cells: GeoBox) -> NDArray[Any]:
    return band[: cells.shape[0], : cells.shape[1]]


def read_block_map(path: str | os.PathLike[str]) -> SavedBlocks:
    """Read a block map from its GeoTIFF; raise RasterReadError or RasterError if it is not one."""
    _, cells, _, tags = read_geotiff(path)
    try:
        header = checked_header(json.loads(tags[_TAG]))
        shape = (header["rows"], header["cols"])
        geobox = GeoBox(shape, scaled(cells.transform, 1 / CELL, 1 / CELL), cells.crs)
        blocks = _read_blocks(path, shape, _checked_cells(shape, cells.shape))
        illumination = _read_illumination(path, shape, header.get("flatten"))
    except (KeyError, ValueError, RecursionError, RasterReadError) as error:
        raise RasterError(
            f"{path} is not a block map that this version reads ({cause_of(error)}); make it again with "
            "uavseg divide"
        ) from error
    stretch = Stretch(header["low"], header["high"], header["stretch"])
    origin, axis = origin_of_header(header), axis_of_header(header, stretch)
    return SavedBlocks(blocks, geobox, stretch, header["bands"], origin, axis, illumination)


def _read_blocks(path: str | os.PathLike[str], shape: tuple[int, int], cells: tuple[int, int]) -> BlockMap:
    """Read the pages of a block map, each of the shape and type that a raster of `shape` has."""
    in_blocks = (-(-shape[0] // BLOCK), -(-shape[1] // BLOCK))
    sums = _read_page(path, _SUMS, cells, 1, np.uint32)[0]
    counts = _read_page(path, _COUNTS, cells, 1, np.uint8)[0]
    ratios = _read_page(path, _RATIOS, in_blocks, len(_RATIO_NAMES), np.float64)
    if (counts > CELL * CELL).any() or (sums > counts.astype(np.uint32) * GREY_MAX).any():
        raise ValueError("its cells hold more than pixels can")
    blocks = BlockMap.empty(shape)
    blocks.sums[: cells[0], : cells[1]] = sums
    blocks.counts[: cells[0], : cells[1]] = counts
    blocks.ratios[:] = ratios.transpose(1, 2, 0)
    return blocks


def _read_illumination(
    path: str | os.PathLike[str], shape: tuple[int, int], header: dict[str, Any] | None
) -> Illumination | None:
    if header is None:
        return None
    step = header["step"]
    squares = (-(-shape[0] // step), -(-shape[1] // step))
    return Illumination(_read_page(path, _ILLUMINATION, squares, 1, np.uint16)[0], step, header["target"])


def _read_page(
    path: str | os.PathLike[str], page: int, shape: tuple[int, int], bands: int, dtype: Any
) -> NDArray[Any]:
    content = read_geotiff(path, page, shape, bands)[0]
    if content.dtype != dtype:
        raise ValueError(f"page {page} is of {content.dtype}, not of {np.dtype(dtype)}")
    return content


def _checked_cells(shape: tuple[int, int], cells: tuple[int, int]) -> tuple[int, int]:
    """Return the rows and columns of cells if they cover a raster of `shape`; raise ValueError if not."""
    if min(shape) < 1 or cells != tuple(-(-length // CELL) for length in shape):
        raise ValueError(f"{cells} cells do not cover {shape} pixels")
    return cells
