"""Block maps as GeoTIFF: what QGIS shows of them, and all that is needed to load them back."""

import json
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import RasterError
from uavseg.raster.geobox import GeoBox, scaled
from uavseg.raster.opening import GDAL_ERRORS, gdal, is_remote, quiet_open
from uavseg.raster.stretch import Stretch
from uavseg.raster.tiling import CELL
from uavseg.raster.write import read_geotiff, write_geotiff
from uavseg.segmentation.blockmap import CELLS, BlockMap, leaves

_TAG = "UAVSEG_BLOCK_MAP"
_BANDS = (
    "mean v",
    "side of the leaf in pixels",
    "sum of grey",
    "valid pixels",
    "R of 64",
    "R of 32",
    "R of 16",
)
_SIDES = (64, 32, 16)


@dataclass(frozen=True)
class Origin:
    """What a block map was made from.

    Parameters
    ----------
    rasters : tuple of str
        Paths as they were given.
    folder : str
        The folder that relative paths start from.
    band, rgb, nodata
        What the user chose, or None.
    """

    rasters: tuple[str, ...]
    folder: str
    band: int | None = None
    rgb: tuple[int, int, int] | None = None
    nodata: float | None = None

    def found(self, beside: str | os.PathLike[str]) -> list[str] | None:
        """Paths of the rasters where all are still there: as they were, or beside the block map's file."""
        for folder in (Path(self.folder), Path(beside).resolve().parent):
            paths = [raster if is_remote(raster) else str(folder / raster) for raster in self.rasters]
            if all(is_remote(path) or Path(path).exists() for path in paths):
                return paths
        return None


@dataclass(frozen=True)
class SavedBlocks:
    """A block map with its place on the map, the stretch that made its grey, and its origin."""

    blocks: BlockMap
    geobox: GeoBox
    stretch: Stretch
    band_names: str
    origin: Origin


def is_block_map(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a block map rather than a raster of its own."""
    try:
        with gdal(), quiet_open(path) as file:
            return _TAG in file.tags()
    except GDAL_ERRORS:
        return False  # whatever is wrong with it is told when it is opened as a raster


def save(
    path: str | os.PathLike[str], saved: SavedBlocks, threshold: float, step: float, overwrite: bool = False
) -> None:
    """Write a block map; a pixel of the file is a cell of 8 x 8 pixels.

    The first two bands are for looking at: mean v and the side of each leaf, for the given X and tau.
    """
    blocks, shape = saved.blocks, saved.geobox.coarsen(CELL).shape
    side, mean = leaves(blocks, threshold, step)
    bands = [
        np.where(mean < 0, np.nan, mean),
        side,
        blocks.sums,
        blocks.counts,
        *(_on_cells(blocks.ratios, k) for k in range(len(_SIDES))),
    ]
    write_geotiff(
        path,
        [band[: shape[0], : shape[1]].astype(np.float64, copy=False) for band in bands],
        saved.geobox.coarsen(CELL),
        _BANDS,
        _tags(saved),
        overwrite,
        nodata=float("nan"),
    )


def load(path: str | os.PathLike[str]) -> SavedBlocks:
    """Read a block map back.

    Raises
    ------
    RasterReadError, RasterError
        If the file cannot be read or is no block map.
    """
    bands, cells, _, tags = read_geotiff(path)
    try:
        facts = json.loads(tags[_TAG])
        shape = (int(facts["rows"]), int(facts["cols"]))
        blocks = BlockMap.empty(shape)
        rows, cols = cells.shape
        blocks.sums[:rows, :cols] = bands[2]
        blocks.counts[:rows, :cols] = bands[3]
        for k in range(len(_SIDES)):
            _from_cells(bands[4 + k], k, blocks.ratios)
        geobox = GeoBox(shape, scaled(cells.transform, 1 / CELL, 1 / CELL), cells.crs)
        rgb = facts["rgb"] and tuple(facts["rgb"])
        nodata = None if facts["nodata"] is None else float(facts["nodata"])
        origin = Origin(tuple(facts["rasters"]), facts["folder"], facts["band"], rgb, nodata)
        stretch = Stretch(facts["low"], facts["high"], facts["stretch"])
        return SavedBlocks(blocks, geobox, stretch, facts["bands"], origin)
    except (KeyError, ValueError, TypeError, IndexError) as error:
        raise RasterError(
            f"{path} is not a block map that this version reads; make it again with uavseg divide"
        ) from error


def _tags(saved: SavedBlocks) -> dict[str, str]:
    origin = saved.origin
    facts = {
        "rows": saved.geobox.shape[0],
        "cols": saved.geobox.shape[1],
        "low": saved.stretch.low,
        "high": saved.stretch.high,
        "stretch": saved.stretch.name,
        "bands": saved.band_names,
        "rasters": list(origin.rasters),
        "folder": origin.folder,
        "band": origin.band,
        "rgb": origin.rgb,
        "nodata": None if origin.nodata is None else repr(origin.nodata),
    }
    return {_TAG: json.dumps(facts)}


def _ratios_of_side(ratios: NDArray[np.float64], k: int) -> NDArray[np.float64]:
    """R of all blocks of one side, as an image of blocks; a view for the largest, a copy otherwise."""
    rows, cols, many = ratios.shape[0], ratios.shape[1], 1 << k
    first = (0, 1, 5)[k]
    small = ratios[:, :, first : first + many * many].reshape(rows, cols, many, many)
    return small.transpose(0, 2, 1, 3).reshape(rows * many, cols * many)


def _on_cells(ratios: NDArray[np.float64], k: int) -> NDArray[np.float64]:
    """R of all blocks of one side, repeated over their cells."""
    times = CELLS >> k
    return _ratios_of_side(ratios, k).repeat(times, axis=0).repeat(times, axis=1)


def _from_cells(band: NDArray[np.float64], k: int, ratios: NDArray[np.float64]) -> None:
    """Fill in R of one side from a band over cells."""
    rows, cols, many, times = ratios.shape[0], ratios.shape[1], 1 << k, CELLS >> k
    small = np.zeros((rows * many, cols * many))
    known = band[::times, ::times]
    small[: known.shape[0], : known.shape[1]] = known
    first = (0, 1, 5)[k]
    apart = small.reshape(rows, many, cols, many).transpose(0, 2, 1, 3)
    ratios[:, :, first : first + many * many] = apart.reshape(rows, cols, many * many)
