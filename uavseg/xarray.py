"""Accessor of xarray: after `import uavseg.xarray`, DataArrays have `.uavseg` with the jobs for rasters.

>>> import rioxarray, uavseg.xarray  # doctest: +SKIP
>>> raster = rioxarray.open_rasterio("tile.tif")  # doctest: +SKIP
>>> regions = raster.uavseg.extract((0.55, 1))  # doctest: +SKIP
"""

from typing import Any

import xarray

import uavseg


@xarray.register_dataarray_accessor("uavseg")
class UavsegAccessor:
    """Jobs over a DataArray: the functions of `uavseg` with the array as their source.

    Parameters
    ----------
    array : DataArray
        With a CRS and nodata as rioxarray has them; it lies where its coordinates say.
    """

    def __init__(self, array: xarray.DataArray) -> None:
        self._array = array

    def extract(self, *choices: Any, **words: Any) -> Any:
        """Regions within a range, as `uavseg.extract`."""
        return uavseg.extract(self._array, *choices, **words)

    def levels(self, *choices: Any, **words: Any) -> Any:
        """Levels of equal width, each in segments, as `uavseg.levels`."""
        return uavseg.levels(self._array, *choices, **words)

    def match(self, *choices: Any, **words: Any) -> Any:
        """Regions like a sample, as `uavseg.match`."""
        return uavseg.match(self._array, *choices, **words)

    def suggest(self, *choices: Any, **words: Any) -> Any:
        """Ranges of intensity to try, as `uavseg.suggest`."""
        return uavseg.suggest(self._array, *choices, **words)

    def classify(self, *choices: Any, **words: Any) -> Any:
        """States of a map of probabilities, as `uavseg.classify`."""
        return uavseg.classify(self._array, *choices, **words)

    def info(self, *choices: Any, **words: Any) -> Any:
        """What the raster is, as `uavseg.info`."""
        return uavseg.info(self._array, *choices, **words)

    def divide(self, *choices: Any, **words: Any) -> Any:
        """The block map, as `uavseg.divide`."""
        return uavseg.divide(self._array, *choices, **words)
