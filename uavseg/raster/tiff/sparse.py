"""Sparse TIFF files: the pixels of blocks that are not stored have one value, and are never decoded."""

from collections.abc import Sequence

import numpy as np
from rasterio.errors import RasterBlockError
from rasterio.io import DatasetReader

from uavseg.dataclass import dataclass
from uavseg.raster.grid.tiling import Window, indices_within, sample_positions
from uavseg.raster.spectral.bands import Values
from uavseg.raster.tiff.index import Stored, stored_blocks


@dataclass(frozen=True, slots=True)
class SparseBlocks:
    """The blocks of some bands, of one type, of an open TIFF."""

    source: DatasetReader
    path: str
    bands: Sequence[int]

    def is_empty(self, window: Window) -> bool:
        """Return whether no block that intersects a window is stored; false where that is not known."""
        if self._stores_first(window):
            return False
        stored = self._stored(window)
        return stored is not None and not stored.any()

    def read(self, window: Window, shape: tuple[int, int]) -> Values | None:
        """Read a window, downsampled to `shape` by nearest neighbour; None if GDAL reads it as fast.

        That is where all blocks are stored, or some of them are and every pixel is asked for. The result is
        (bands, *shape).
        """
        whole = shape == (window.rows, window.cols)
        if whole and self._stores_first(window):
            return None
        stored = self._stored(window)
        fill = self._fill_values()
        if stored is None or fill is None or stored.all():
            return None
        values = np.empty((len(fill), *shape), fill.dtype)
        values[:] = fill[:, None, None]
        if not stored.any():
            return values
        if whole or self.source.overviews(self.bands[0]):
            return None
        self._sample(stored, window, values)
        return values

    def _stores_first(self, window: Window) -> bool:
        """Return whether the first block of a window is stored; the index need not be read then."""
        rows, cols = self.source.block_shapes[0]
        try:
            return bool(self.source.block_size(self.bands[0], window.row // rows, window.col // cols))
        except RasterBlockError:
            return False

    def _sample(self, stored: Stored, window: Window, values: Values) -> None:
        """Put the nearest pixels of stored blocks in their places."""
        rows = sample_positions(window.row, window.rows, values.shape[1])
        cols = sample_positions(window.col, window.cols, values.shape[2])
        height, width = self.source.block_shapes[0]
        first = np.array([window.row // height, window.col // width])
        for i, j in (first + np.argwhere(stored)).tolist():
            block = Window(i * height, j * width, height, width).clipped(self.source.shape)
            here = indices_within(rows, block.row, block.rows), indices_within(cols, block.col, block.cols)
            if here[0].start == here[0].stop or here[1].start == here[1].stop:
                continue
            place = (block.row, block.row + block.rows), (block.col, block.col + block.cols)
            pixels = self.source.read(list(self.bands), window=place)
            sampled = np.ix_(rows[here[0]] - block.row, cols[here[1]] - block.col)
            values[:, here[0], here[1]] = pixels[:, sampled[0], sampled[1]]

    def _fill_values(self) -> Values | None:
        """Return the value of missing blocks by band, nodata or 0; None if the type cannot hold it."""
        dtype = np.dtype(self.source.dtypes[self.bands[0] - 1])
        fill = [self.source.nodatavals[band - 1] or 0.0 for band in self.bands]
        if dtype.kind in "iu":
            limits = np.iinfo(dtype)
            if not all(limits.min <= value <= limits.max and value == int(value) for value in fill):
                return None
        return np.array(fill).astype(dtype) if dtype.kind in "iuf" else None

    def _stored(self, window: Window) -> Stored | None:
        """Return which blocks that intersect a window are stored, of any of the bands, (rows, cols)."""
        known = stored_blocks(self.path, self.source)
        if known is None:
            return None
        rows, cols = self.source.block_shapes[0]
        part = known[
            :,
            window.row // rows : -(-(window.row + window.rows) // rows),
            window.col // cols : -(-(window.col + window.cols) // cols),
        ]
        planes = [0] if len(part) == 1 else [band - 1 for band in self.bands]
        return np.asarray(part[planes].any(axis=0))
