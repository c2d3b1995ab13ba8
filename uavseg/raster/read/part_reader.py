"""Windows made of parts of files: the first valid pixel wins, and blocks that cannot be read are listed."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from uavseg.raster.access.opening import OpenFiles
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.bad_blocks import (
    MissingPart,
    read_naming_bad_block,
    read_skipping_bad_blocks,
    record_bad_block,
)
from uavseg.raster.read.mosaic import RasterSource
from uavseg.raster.read.raster_file import RasterFile
from uavseg.raster.spectral.bands import BandChoice, Valid, Values

Part = tuple[RasterSource, Window, tuple[slice, slice]]


@dataclass(frozen=True, slots=True)
class PartReader:
    """Reads the intensity bands of parts of files.

    Parameters
    ----------
    choice : BandChoice
    handles : OpenFiles
    skip_bad_tiles : bool
        Whether blocks that cannot be read count as nodata.
    """

    choice: BandChoice
    handles: OpenFiles
    skip_bad_tiles: bool

    def read(self, file: RasterSource, part: Window) -> tuple[Values, Valid | None]:
        """Values and validity of a window of a file."""
        values, valid, bad = self._read_part(file, part, (part.rows, part.cols))
        for block, _ in bad:
            record_bad_block(block)
        return values, valid

    def merge(
        self, shape: tuple[int, int], parts: Iterable[Part], dtype: np.dtype[np.generic]
    ) -> tuple[Values, Valid | None]:
        """Values and validity of a window to which parts of files belong, in the order of their rank."""
        planes = self.choice.planes if self.choice.formula is None else 1
        values = np.zeros((planes, *shape), dtype)
        filled = np.zeros(shape, bool)
        for file, part, (rows, cols) in parts:
            missing = ~filled[rows, cols]
            if not missing.any():
                continue
            pixels, valid, bad = self._read_part(file, part, missing.shape)
            for block, place in bad:
                if missing[place].any():  # no earlier file has these pixels
                    record_bad_block(block)
            if valid is not None:
                missing &= valid
            np.copyto(values[:, rows, cols], pixels, where=missing)
            filled[rows, cols] |= missing
        return values, None if filled.all() else filled

    def _read_part(
        self, file: RasterSource, part: Window, shape: tuple[int, int]
    ) -> tuple[Values, Valid | None, Sequence[MissingPart]]:
        """Values and validity of a part of a file, and which blocks of it cannot be read."""
        values, valid, bad = self._read_bands(file, part, shape)
        return *with_formula(file, self.choice, values, valid), bad

    def _read_bands(
        self, file: RasterSource, part: Window, shape: tuple[int, int]
    ) -> tuple[Values, Valid | None, Sequence[MissingPart]]:
        if not isinstance(file, RasterFile):
            return *file.read(self.handles, self.choice, part, shape), ()
        if self.skip_bad_tiles:
            return read_skipping_bad_blocks(file, self.handles, self.choice, part, shape)
        return *read_naming_bad_block(file, self.handles, self.choice, part, shape), ()


def with_formula(
    file: RasterSource, choice: BandChoice, values: Values, valid: Valid | None
) -> tuple[Values, Valid | None]:
    """What the formula of a choice makes of the bands of a file; without one, the same."""
    if choice.formula is None:
        return values, valid
    scales = [file.scale_of(band, choice.bits) for band in choice.bands]
    return choice.formula.apply(values, valid, scales)
