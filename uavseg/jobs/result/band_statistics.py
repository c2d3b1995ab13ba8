"""Zonal statistics of the bands of a raster: a pixel counts by the part of it in a region (exactextract)."""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import shapely

from uavseg.errors import MissingLibraryError, ParameterError
from uavseg.execution.executors import phase
from uavseg.jobs.result.result import Extraction
from uavseg.jobs.source.open_source import pixels_of
from uavseg.jobs.source.source import Source
from uavseg.jobs.source.work import Work
from uavseg.raster.grid.geobox import GeoBox, scaled, shifted
from uavseg.raster.grid.tiling import Window
from uavseg.raster.intensity.value_range import scale_of
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.spectral.band_names import names_of
from uavseg.raster.spectral.bands import Values
from uavseg.regions.sample.place import to_pixels
from uavseg.regions.shapes import batch_slices
from uavseg.regions.table import Regions

try:
    from exactextract import exact_extract
    from exactextract.feature import JSONFeatureSource
    from exactextract.operation import Operation
    from exactextract.raster import NumPyRasterSource
except ImportError as error:
    raise MissingLibraryError('--stats needs exactextract: pip install "uavseg[stats]"') from error

_STATISTICS = {"mean": "mean", "std": "stdev", "min": "min", "max": "max"}  # columns, as exactextract has them
_PIXELS = 1 << 24  # of all bands together, in memory at a time
_STEPS = 1 << 16  # of a pixel, to which corners are rounded: those on pixel edges lie there exactly


def find_with_statistics(find: Callable[[Source, Work], Extraction], source: Source, work: Work) -> Extraction:
    """Find regions, and add the statistics of the bands of their raster; a block map is refused."""
    raster = pixels_of(source, "--stats reads the bands of the raster; give it in place of its block map")
    bands_of(raster.dataset)  # refused before any work
    found, work = find(source, work), replace(work.begun(), progress=None, started=None)
    with work.reading_here(), phase("statistics of bands"):
        regions = with_statistics(found.regions, raster.cleaned(work.over(raster)))
    warnings = dict.fromkeys((*found.warnings, *work.bad_block_warnings))
    return replace(found, regions=regions, warnings=tuple(warnings))


def bands_of(dataset: Dataset) -> dict[str, Dataset]:
    """Return each band but alpha, by its common name, the words of its description, or b1, b2, ...

    Where two would have one name, all are called b1, b2, ... A ParameterError says that they are indices into
    a palette, or have other scales in other files, a RasterError that one is of complex numbers.
    """
    if dataset.choice.expanded:
        raise ParameterError(
            f"{dataset.source} has a palette, whose indices have no statistics; leave --stats out, or expand "
            "it to colours (gdal_translate -expand rgb)"
        )
    layout = dataset.mosaic.files[0].layout
    found = {band: dataset.of_band(band.number) for band in names_of(layout) if band.number != layout.alpha}
    words = [re.sub(r"\W+", "_", band.description.casefold())[:40].strip("_") for band in found]
    names = [band.common or word or f"b{band.number}" for band, word in zip(found, words, strict=True)]
    if len({*names, "value"}) <= len(names):  # there is a column mean_value
        names = [f"b{band.number}" for band in found]
    for band in found.values():
        scale_of(band)
    return dict(zip(names, found.values(), strict=True))


def with_statistics(regions: Regions, dataset: Dataset) -> Regions:
    """Return regions with mean_<band>, std_<band>, min_<band> and max_<band>, (n,) float64, of each band.

    They are of the valid pixels, in the raster's own units, each weighted by the part of it that lies in the
    polygon; NaN where there are none.
    """
    bands = [(name, _Band(name, band)) for name, band in bands_of(dataset).items()]
    operations = [
        Operation(statistic, f"{column}_{name}", band)
        for name, band in bands
        for column, statistic in _STATISTICS.items()
    ]
    found = exact_extract(
        [band for _, band in bands],
        JSONFeatureSource(_features(regions, dataset.geobox)),
        operations,
        strategy="raster-sequential",
        max_cells_in_memory=_PIXELS // len(bands),
    )
    columns = {one.name: [feature["properties"][one.name] for feature in found] for one in operations}
    added = {name: np.array(column, np.float64) for name, column in columns.items()}
    return replace(regions, columns=regions.columns | added)


class _Band(NumPyRasterSource):  # type: ignore[misc]
    """The values of a band, read by windows, in pixels."""

    def __init__(self, name: str, dataset: Dataset) -> None:  # bands of one name are taken for one
        super().__init__(np.broadcast_to(np.nan, dataset.geobox.shape), name=name)  # its shape alone is used
        self.dataset = dataset

    def read_window(self, col: int, row: int, cols: int, rows: int) -> Values:
        """Return the values of a window, which may be empty; NaN where a pixel is not valid."""
        if not rows * cols:
            return np.zeros((rows, cols))
        values, valid = self.dataset.read(Window(row, col, rows, cols))
        scaled_values = scale_of(self.dataset).values(values[0])
        return scaled_values if valid is None else np.where(valid, scaled_values, np.nan)


def _features(regions: Regions, geobox: GeoBox) -> Iterator[dict[str, Any]]:
    """Yield the polygons in pixels, counted from the lower left corner of the raster, as GeoJSON."""
    upwards = replace(geobox, transform=scaled(shifted(geobox.transform, geobox.shape[0], 0), -1, 1))
    for part in batch_slices(regions.polygons):
        polygons = to_pixels(regions.polygons[part], upwards)
        for polygon in shapely.transform(polygons, lambda xy: np.round(xy * _STEPS) / _STEPS):
            yield {"geometry": polygon.__geo_interface__, "properties": {}}
