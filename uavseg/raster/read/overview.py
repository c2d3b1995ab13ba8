"""Dataset overview: a downsampled copy of a dataset, held in memory."""

from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.spectral.bands import without


@dataclass(frozen=True, eq=False)
class DatasetOverview(Dataset):
    """A downsampled dataset in memory, with the interface of `Dataset`."""

    values: NDArray[Any] = field(kw_only=True)  # (1 or 3, rows, cols)
    valid: NDArray[np.bool_] | None = field(kw_only=True)  # (rows, cols)
    grid: GeoBox = field(kw_only=True)
    whole: Dataset = field(kw_only=True)  # what it is downsampled from

    @classmethod
    def of(cls, dataset: Dataset, max_side: int) -> "DatasetOverview":
        """Return a dataset downsampled to at most `max_side` rows and columns; it is never read whole."""
        values, valid, grid = dataset.read_coarse(max_side)
        unchanged = (dataset.mosaic, dataset.choice, dataset.warnings)
        return cls(*unchanged, values=values, valid=valid, grid=grid, whole=dataset)

    @property
    def geobox(self) -> GeoBox:
        """The grid of the downsampled pixels; its extent is that of the dataset."""
        return self.grid

    def without_formula(self) -> Dataset:
        """Return the same pixels with the stored values of the bands, for which they are read again."""
        if self.choice.formula is None:
            return self
        return DatasetOverview.of(self.whole.without_formula(), max(self.grid.shape))

    def is_empty(self, window: Window) -> bool:
        """Return whether no downsampled pixel of `window` is valid."""
        _, valid = self.read(window)
        return valid is not None and not valid.any()

    def read(self, window: Window) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
        """Return values and validity of a window of downsampled pixels."""
        rows, cols = window.slices
        valid = None if self.valid is None else self.valid[rows, cols]
        if self.collar is not None:
            valid = without(valid, self.collar.read(window))
        return self.values[:, rows, cols], valid
