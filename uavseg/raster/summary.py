"""Raster summary: metadata, histogram and moments of intensity, and a command to try."""

import math
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np

from uavseg.arrays import Integers
from uavseg.dataclass import dataclass
from uavseg.execution.executors import Map, Progress, serial
from uavseg.raster.collar.find import without_collar
from uavseg.raster.geodesy.globe import crs_name
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import ground_resolution
from uavseg.raster.grid.tiling import TilePass, Window, tile_side, tiles
from uavseg.raster.intensity.stretch import Stretch, StretchSpec, fit_stretch, greys_beyond
from uavseg.raster.intensity.thresholds import multi_otsu, population_edges, rarest_population
from uavseg.raster.intensity.value_range import axis_of
from uavseg.raster.read.dataset import Dataset, DatasetOverview
from uavseg.raster.spectral.band_names import names_of
from uavseg.raster.spectral.bands import ValueAxis
from uavseg.units import GREY_LEVELS

EXACT_PIXELS = 100_000_000  # larger rasters are downsampled before counting
COARSE_SIDE = 4096
HISTOGRAM_BINS = 20


@dataclass(frozen=True, slots=True)
class Summary:
    """Metadata and intensity statistics of a raster."""

    paths: tuple[str, ...]
    driver: str
    rows: int
    cols: int
    crs: str | None  # its name
    epsg: int | None
    located: bool  # georeferenced
    resolution: tuple[float, float]  # ground metres (or map units) of a pixel along a row and a column
    bounds: tuple[float, float, float, float]  # left, bottom, right, top in map coordinates
    center: tuple[float, float] | None  # lon, lat in degrees
    bands: tuple[tuple[str, str, float | None], ...]  # dtype, colour interpretation, nodata
    names: tuple[str, ...]  # description and common name of each band, "" where it has neither
    used: str  # the bands that become intensity
    exact: bool  # whether every pixel was counted; otherwise a sample of `counted` pixels
    counted: int
    valid: int  # of the pixels counted
    stretch: str  # and its bounds
    histogram: tuple[int, ...]  # valid pixels in HISTOGRAM_BINS equal steps of v
    mean: float  # of v, as `std`; NaN if no pixel is valid
    std: float
    cut: float  # Otsu's threshold: the v that splits the histogram best into dark and bright
    overviews: tuple[int, ...]
    in_metres: bool  # whether `resolution` is in metres rather than in units of the map
    warnings: tuple[str, ...]
    command: str = ""  # one to try next, which extracts `interval`; "" if no pixel is valid
    axis: ValueAxis | None = None  # v to values of the raster; None if bands or files have different scales
    mean_beyond: float = 0.0  # how much larger the mean of v would be if v were not clipped to 0..1
    # The rarest population of pixels, see `population_edges`, as --range takes it; where there is one, the
    # rarer of dark and bright, at Otsu's threshold in steps of 0.05. `suggest` looks at the means of leaves
    # too, which noise hardly affects.
    interval: str = ""

    @property
    def mean_value(self) -> float:
        """Mean of the values of all valid pixels that were counted; NaN if there is none."""
        if self.axis is None or self.axis.low == self.axis.high:
            return math.nan
        return float(self.axis.values(self.mean + self.mean_beyond))

    @property
    def nodata_share(self) -> float:
        """Share of the counted pixels that are invalid."""
        return 1 - self.valid / self.counted

    def as_dict(self) -> dict[str, Any]:
        """Return all fields as plain values for JSON, with None instead of NaN and infinity."""
        found = asdict(self)
        found["bands"] = [
            dict(zip(("dtype", "color", "nodata"), map(_plain, b), strict=True)) for b in self.bands
        ]
        for band, name in zip(found["bands"], found.pop("names"), strict=True):
            band["name"] = name
        found.pop("mean_beyond")
        found["values"] = found.pop("axis")
        if self.axis is not None:  # the values at v = 0 and 1, their mean, and how they are stored
            ends = (*self.axis.values([0, 1]).tolist(), self.mean_value)
            values = dict(zip(("low", "high", "mean"), map(_plain, ends), strict=True))
            found["values"] = values | asdict(self.axis.scale)
        more = {"nodata_share": self.nodata_share, "command": found.pop("command")}
        return {key: _plain(value) for key, value in (found | more).items()}


def summarize(
    dataset: Dataset,
    stretch: Stretch | StretchSpec | str = "auto",
    map: Map = serial,
    progress: Progress | None = None,
    collar: str = "keep",
) -> Summary:
    """Summarise a dataset.

    Every pixel of a raster of up to 100 megapixels is counted, tile by tile; a larger one is downsampled to
    at most 4096 rows and columns. With `collar` "auto", its collar counts as nodata; that of a larger raster
    is searched for in what is counted.
    """
    box, first = dataset.geobox, dataset.mosaic.files[0]
    exact = math.prod(box.shape) <= EXACT_PIXELS
    seen = dataset if exact else DatasetOverview.of(dataset, COARSE_SIDE)
    if collar == "auto":
        seen = without_collar(seen, TilePass((), map))
    fitted, greys, beyond = _count(seen, stretch, map, progress)
    mean, std = _moments(greys)
    edges, histogram, cut = population_edges(greys), _binned(greys), _otsu_threshold(greys)
    bright = 0 < 2 * histogram[round(cut * HISTOGRAM_BINS) :].sum() <= greys.sum()
    low, high = rarest_population(greys, edges) if edges else (cut, 1.0) if bright else (0.0, cut)
    return Summary(
        paths=dataset.paths,
        driver=first.driver,
        rows=box.shape[0],
        cols=box.shape[1],
        crs=crs_name(box.wkt),
        epsg=None if box.crs is None else box.crs.to_epsg(),
        located=first.located,
        resolution=ground_resolution(box),
        bounds=_bounds(box),
        center=_center(box),
        bands=tuple(zip(first.layout.dtypes, first.layout.roles, first.nodatas, strict=True)),
        names=tuple(band.label for band in names_of(first.layout)),
        used=dataset.band_names,
        exact=exact,
        counted=math.prod(seen.geobox.shape),
        valid=int(greys.sum()),
        stretch=fitted.name,
        histogram=tuple(histogram.tolist()),
        mean=mean,
        std=std,
        cut=cut,
        overviews=first.overviews,
        in_metres=dataset.in_metres,
        warnings=(*seen.warnings, *fitted.warnings),
        axis=axis_of(dataset, fitted),
        mean_beyond=beyond / max(int(greys.sum()), 1) / (GREY_LEVELS - 1),
        interval=f"{low:.7g},{high:.7g}",
    )


def _count(
    dataset: Dataset, stretch: Stretch | StretchSpec | str, map: Map, progress: Progress | None
) -> tuple[Stretch, Integers, int]:
    """Return the stretch, the histogram of grey levels under it, and the sum of greys beyond it."""
    shape = dataset.geobox.shape
    windows = tiles(shape, tile_side(shape, dataset.file_block))
    fitted = fit_stretch(dataset, stretch, TilePass(windows, map))
    greys, beyond = np.zeros(GREY_LEVELS, np.int64), 0
    for counts, more in map(partial(_grey_histogram, dataset, fitted), windows, progress):
        greys += counts
        beyond += more
    return fitted, greys, beyond


def _grey_histogram(dataset: Dataset, stretch: Stretch, window: Window) -> tuple[Integers, int]:
    values, valid = dataset.read(window)
    grey = stretch.apply(values, valid)
    beyond = greys_beyond(values, valid, grey, stretch)
    more = 0 if beyond is None else int(beyond.sum(dtype=np.int64))
    shown = (grey if valid is None else grey[valid]).reshape(-1)
    return np.bincount(shown, minlength=GREY_LEVELS), more


def _binned(greys: Integers) -> Integers:
    """Return histogram in equal bins of v; v = 1 belongs to the last bin."""
    bins = np.minimum(np.arange(GREY_LEVELS) * HISTOGRAM_BINS // (GREY_LEVELS - 1), HISTOGRAM_BINS - 1)
    return np.bincount(bins, weights=greys, minlength=HISTOGRAM_BINS).astype(np.int64)


def _moments(greys: Integers) -> tuple[float, float]:
    if not greys.any():
        return math.nan, math.nan
    v = np.arange(GREY_LEVELS) / (GREY_LEVELS - 1)
    mean = float(np.average(v, weights=greys))
    return mean, float(np.sqrt(np.average((v - mean) ** 2, weights=greys)))


def _otsu_threshold(greys: Integers) -> float:
    """Return Otsu's threshold at a bin edge; the middle one of equally good edges between empty bins."""
    classes = multi_otsu(_binned(greys), 2)
    if len(classes) < 2:
        return 0.5
    [below], [above] = classes[1].ends, classes[1].starts
    return round((below + above + 1) // 2 / HISTOGRAM_BINS, 2)


def _bounds(box: GeoBox) -> tuple[float, float, float, float]:
    x, y = box.corners
    return float(x.min()), float(y.min()), float(x.max()), float(y.max())


def _center(box: GeoBox) -> tuple[float, float] | None:
    if box.crs is None:
        return None
    lon, lat = box.lonlat_from_xy(*box.xy_from_pixel(box.shape[0] / 2, box.shape[1] / 2))
    return (float(lon), float(lat)) if np.isfinite(lon) and np.isfinite(lat) else None


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
