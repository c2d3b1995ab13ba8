"""xarray accessor: after `import uavseg.xarray`, DataArrays have `.uavseg` with the jobs for rasters.

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

    def extract(self, *args: Any, **options: Any) -> Any:
        """Return the regions within a range, as `uavseg.extract`."""
        return uavseg.extract(self._array, *args, **options)

    def levels(self, *args: Any, **options: Any) -> Any:
        """Return levels of equal width, each in segments, as `uavseg.levels`."""
        return uavseg.levels(self._array, *args, **options)

    def match(self, *args: Any, **options: Any) -> Any:
        """Return the regions similar to a sample, as `uavseg.match`."""
        return uavseg.match(self._array, *args, **options)

    def suggest(self, *args: Any, **options: Any) -> Any:
        """Suggest ranges of intensity, as `uavseg.suggest`."""
        return uavseg.suggest(self._array, *args, **options)

    def classify(self, *args: Any, **options: Any) -> Any:
        """Classify a map of probabilities into states, as `uavseg.classify`."""
        return uavseg.classify(self._array, *args, **options)

    def info(self, *args: Any, **options: Any) -> Any:
        """Describe the raster, as `uavseg.info`."""
        return uavseg.info(self._array, *args, **options)

    def divide(self, *args: Any, **options: Any) -> Any:
        """Return the block map, as `uavseg.divide`."""
        return uavseg.divide(self._array, *args, **options)
