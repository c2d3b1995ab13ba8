"""The words one types in Python: options as plain arguments, answers as values of the field's libraries."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from uavseg.parallel import Progress
from uavseg.parallel import threads as workers
from uavseg.raster.dataset import Dataset
from uavseg.regions.cleaning import Area, parse_area
from uavseg.regions.extract import ExtractParams
from uavseg.regions.extract import divide as _divide
from uavseg.regions.extract import extract as _extract
from uavseg.segmentation.pipeline import SegmentParams
from uavseg.segmentation.segments import IntensityRange

if TYPE_CHECKING:
    from geopandas import GeoDataFrame

    from uavseg.segmentation.blockmap import BlockMap


def extract(
    source: Any,
    range: tuple[float, float],
    *,
    band: int | None = None,
    rgb: tuple[int, int, int] | None = None,
    nodata: float | None = None,
    stretch: str = "auto",
    method: str = "adaptive",
    refine: str = "scan",
    threshold: float = 1.2,
    intensity_step: float = 0.05,
    min_area: float | str | None = None,
    fill_holes: float | str | None = None,
    simplify: float | None = None,
    tile: int | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> GeoDataFrame:
    """Regions of a raster whose mean intensity lies in a range.

    Parameters
    ----------
    source : path, sequence of paths, DataArray or Dataset
        Many paths are one mosaic. A DataArray wants rioxarray's `.rio`.
    range : (float, float)
        Of v in [0, 1], both ends in it.
    band, rgb, nodata, stretch, method, refine, threshold, intensity_step
        As the options of `uavseg extract`.
    min_area, fill_holes : float or str, optional
        Square metres, or pixels as "64px".
    simplify : float, optional
        Metres.
    tile, threads : int, optional
        Change no result.
    progress : callable, optional
        Called with (done, total).

    Returns
    -------
    regions : geopandas.GeoDataFrame
        In the raster's CRS, the region with most pixels first: id, area_m2, perimeter_m, mean, std, pixels,
        holes, lon, lat, range_low, range_high, source.

    Raises
    ------
    UavsegError
        If the raster cannot be read or answered rightly, or a parameter is wrong.

    Examples
    --------
    >>> import uavseg
    >>> regions = uavseg.extract("tile.tif", range=(0.55, 1))  # doctest: +SKIP
    """
    dataset = source if isinstance(source, Dataset) else Dataset.open(source, band, rgb, nodata)
    segment = SegmentParams(method, threshold, intensity_step, refine)  # type: ignore[arg-type]
    params = ExtractParams(segment, stretch, _area(fill_holes), _area(min_area), simplify, tile)
    return _extract(dataset, IntensityRange(*range), params, workers(threads), progress).regions.frame()


def divide(
    source: Any, *, stretch: str = "auto", tile: int | None = None, threads: int | None = None
) -> BlockMap:
    """The block map of a raster, from which `uavseg.segmentation` answers any range.

    Parameters
    ----------
    source : path, sequence of paths, DataArray or Dataset
    stretch : str
    tile, threads : int, optional
    """
    dataset = source if isinstance(source, Dataset) else Dataset.open(source)
    return _divide(dataset, stretch, tile, workers(threads))[0]


def _area(given: float | str | None) -> Area | None:
    if given is None:
        return None
    return parse_area(given) if isinstance(given, str) else Area(float(given))
