"""Segmentation of rasters: regions of a range, levels, and the block map that answers later ranges."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

from uavseg.access import Folders, allowing
from uavseg.api._values import regions_of, warn, work
from uavseg.arguments import checked
from uavseg.arrays import GeoDataFrame
from uavseg.errors import ParameterError
from uavseg.execution.executors import Progress
from uavseg.jobs.divide import divide as run_divide
from uavseg.jobs.segment_classes import Small
from uavseg.jobs.source.open_source import open_source
from uavseg.options.option import build
from uavseg.options.regions import DivideOptions, ExtractOptions, LevelsOptions
from uavseg.segmentation.blocks.block_map import BlockMap


@checked
def extract(
    source: Any,
    range: tuple[float, float] | str | None = None,
    *,
    values: Sequence[float | None] | str | None = None,
    percentile: Sequence[float | None] | str | None = None,
    classes: Mapping[str, Any] | str | os.PathLike[str] | None = None,
    band: int | str | None = None,
    rgb: tuple[int | str, int | str, int | str] | None = None,
    index: str | None = None,
    expr: str | None = None,
    band_names: str | None = None,
    nodata: float | str | None = None,
    stretch: str = "auto",
    flatten: float | str | None = None,
    method: str = "adaptive",
    refine: str | None = None,
    threshold: float = 1.2,
    intensity_step: float = 0.05,
    connectivity: int = 4,
    detail: float | str | None = None,
    thin_lines: bool = False,
    min_area: float | str | None = None,
    fill_holes: float | str | None = None,
    min_confidence: float | None = None,
    smooth_outline: float | None = None,
    regularize: float | None = None,
    simplify: float | None = None,
    stats: str | None = None,
    tile: int | None = None,
    threads: int | None = None,
    progress: Progress | bool | None = None,
    resume: str | os.PathLike[str] | None = None,
    skip_bad_tiles: bool = False,
    collar: str = "auto",
    bounds: tuple[float, float, float, float] | None = None,
    aoi: str | os.PathLike[str] | None = None,
    warp: bool = False,
    allow_path: Folders = (),
    allow_network: bool = False,
) -> GeoDataFrame:
    """Extract regions of a raster whose mean intensity lies in a range, or of several classes.

    Parameters
    ----------
    source : path, sequence of paths, array, DataArray, open raster of rasterio, or Dataset
        Many paths are one mosaic, and so are a folder of rasters, a pattern (``"tiles/*.tif"``) and the names
        in a text file (``"@list.txt"``); `each` answers for each one by itself. ``"item.json#visual"`` is an
        asset of a STAC item. The path of a block map is answered from it, and refined with its raster where
        that is at hand. An array of numpy (or dask, ...) is (rows, cols), or has at most 16 bands first or
        last; it has no place on the map, and what a masked array masks is left out. A DataArray (which needs
        rioxarray) lies where its coordinates say, else its transform; rows, columns, bands in any order.
    range : (float, float), optional
        Of v in [0, 1], both ends in it. Exactly one of `range`, `values`, `percentile` and `classes` is
        given; the first three may be texts, such as "0.55,1".
    values : (float or None, float or None), optional
        In the raster's own units, after its scale and offset; None for an open end. Of three bands, in the
        units of their luminance.
    percentile : (float or None, float or None), optional
        Percentiles of all valid pixels, in 0..100.
    classes : mapping or path, optional
        Names with their ranges of v, ``{"water": (0, 0.2), "sand": (0.6, 0.8, "#e0c080")}``,
        or a .csv or .yaml file of them. Each pixel is in one class at most; an end that two ranges share
        belongs to the lower one.
    band : int or str, optional
        The band to use, counted from 1, or by its name in any case: its description in the file ("B8"), a
        colour or a common name ("nir").
    rgb : three ints or texts, optional
        The bands whose luminance is used.
    index : str, optional
        A spectral index in place of a band: "ndvi", "ndwi", "ndbi", "exg", "vari", ...
    expr : str, optional
        Band arithmetic in place of a band: "(nir - red) / (nir + red)", where b1, b2, ... are bands too.
    band_names : str, optional
        Names for the bands: "red,green,blue,nir", or of some "nir=4".
    nodata, stretch, method, refine, threshold, intensity_step
        As the options of `uavseg extract`.
    connectivity : {4, 8}
        Neighbours of a pixel. With 8, regions (of one class) that touch at a corner of a pixel are one
        MultiPolygon, after holes are filled and before small regions are dropped.
    flatten : float or str, optional
        Metres, or pixels as "200px": light that changes slowly over this width is taken away, and `range` is
        of v without it; several times the width of what is sought. Columns of values are then empty.
    detail : float or str, optional
        Metres, or pixels as "8px": narrower structures are left out, necks cut and gaps closed, before holes.
    thin_lines : bool
        Whether lines of 1 to 3 pixels are added by their contrast along 15 pixels; for one range.
    min_area, fill_holes : float or str, optional
        Square metres, or pixels as "64px". Holes are filled first, then regions dropped.
    min_confidence : float, optional
        0 to 1: regions of a lower confidence are dropped at last.
    smooth_outline : float, optional
        Metres that outlines without stairs may leave the pixel edges, at most half a pixel.
    regularize : float, optional
        Metres, two pixels or more, that outlines with right angles may leave the pixel edges; others stay.
    simplify : float, optional
        Metres; outlines as they are drawn are simplified. Columns stay those of the pixels.
    stats : {"bands"}, optional
        Adds mean_<band>, std_<band>, min_<band> and max_<band> of each band but alpha, in its own values; a
        pixel counts by the part of it in the region as drawn. Needs ``pip install "uavseg[stats]"``.
    tile, threads : int, optional
        Change no result.
    progress : callable or bool, optional
        Called with (done, total); True draws a bar on stderr, in notebooks too.
    resume : path, optional
        A folder in which finished tiles are kept, so that a run that was stopped goes on where it stopped. It
        stays there in the end, and may be removed.
    skip_bad_tiles : bool
        Whether blocks of a file that cannot be read count as nodata. Each gives a warning.
    collar : {"auto", "keep"}
        Whether an untagged black or white collar along the edge counts as nodata, with a warning, or is kept.
    bounds : (float, float, float, float), optional
        West, south, east and north in the coordinates of the raster, which ends there: it has the pixels
        whose centres lie between them.
    aoi : path, optional
        The area of interest, a file of polygons in any CRS. The raster ends at its bounding box; of this,
        pixels whose centres lie in no polygon count as nodata.
        An array in memory has none.
    warp : bool
        Whether files of a mosaic of another CRS or resolution, or a shifted grid, are read on the grid of the
        first, by nearest neighbour, with a warning; no effect on a single raster.
    allow_path : path or sequence of paths
        Folders in which the contents of files may name others (sources of a VRT, the image of a ROS map, the
        raster of a block map), beside their own folder.
    allow_network : bool
        Whether the contents of files may name addresses.

    Returns
    -------
    regions : geopandas.GeoDataFrame
        In the raster's CRS, the region with most pixels first: id, confidence, area_m2, perimeter_m, mean,
        std, pixels, holes, lon, lat, range_low, range_high, source. With classes also class, and color if one
        has a color. The confidence is the probability that a region is right, fitted on real pictures and
        drawn scenes; NaN where regions end at block edges.

    Raises
    ------
    UavsegError
        If the raster cannot be read or answered rightly, or a parameter is wrong.

    Examples
    --------
    >>> import uavseg
    >>> regions = uavseg.extract("tile.tif", range=(0.55, 1))  # doctest: +SKIP
    """
    return regions_of(source, build(ExtractOptions, locals()), progress)


@checked
def levels(
    source: Any,
    width: float | None = None,
    *,
    breaks: Sequence[float] | str | None = None,
    band: int | str | None = None,
    rgb: tuple[int | str, int | str, int | str] | None = None,
    index: str | None = None,
    expr: str | None = None,
    band_names: str | None = None,
    nodata: float | str | None = None,
    stretch: str = "auto",
    flatten: float | str | None = None,
    method: str = "adaptive",
    threshold: float = 1.2,
    intensity_step: float = 0.05,
    refine: str | None = None,
    connectivity: int = 4,
    detail: float | str | None = None,
    min_area: float | str | None = None,
    small: Small = "merge",
    min_confidence: float | None = None,
    smooth_outline: float | None = None,
    regularize: float | None = None,
    simplify: float | None = None,
    stats: str | None = None,
    tile: int | None = None,
    threads: int | None = None,
    progress: Progress | bool | None = None,
    resume: str | os.PathLike[str] | None = None,
    skip_bad_tiles: bool = False,
    collar: str = "auto",
    bounds: tuple[float, float, float, float] | None = None,
    aoi: str | os.PathLike[str] | None = None,
    warp: bool = False,
    allow_path: Folders = (),
    allow_network: bool = False,
) -> GeoDataFrame:
    """Divide a raster into levels of v, and each of them into segments of adjacent pixels.

    Parameters
    ----------
    source
        As of `extract`; or the path of a ROS map's YAML file, which is never stretched. For another map of
        probabilities, give ``stretch="none"``.
    width : float, optional
        Of a level, in v: above 0 and at most 1. A value on an edge belongs to the level below it.
    breaks : sequence of float or str, optional
        In place of a width: the values of v between levels, or "otsu" (levels with the smallest variance
        within, as `suggest` has them), "otsu:K", "quantile" (as many pixels in each of 5) or "quantile:K".
    refine : {"tv", "none", "pixels"}, optional
        By total variation to the pixel, or left at the edges of blocks, which is the default with
        ``method="paper"`` and for more than 127 levels; or every pixel by its own value.
    detail : float or str, optional
        Metres, or pixels as "8px": what is narrower becomes part of the levels near it.
    small : {"merge", "drop"}
        What becomes of segments of less than `min_area`: the smallest first, each becomes part of the
        neighbour with the longest common border; or they are dropped.
    min_confidence : float, optional
        0 to 1: segments of a lower confidence are dropped at last.
    band, ..., allow_network
        As of `extract`.

    Returns
    -------
    segments : geopandas.GeoDataFrame
        With the columns of `extract` and `level`, from 0; `range_low` and `range_high` are the interval of
        that level.

    Raises
    ------
    UavsegError
        As of `extract`.

    Examples
    --------
    >>> import uavseg
    >>> segments = uavseg.levels("tile.tif", width=0.1)  # doctest: +SKIP
    """
    if (width is None) == (breaks is None):
        raise ParameterError("levels takes a width, such as width=0.1, or breaks; give one of them")
    return regions_of(source, build(LevelsOptions, locals()), progress)


@checked
def divide(
    source: Any,
    *,
    band: int | str | None = None,
    rgb: tuple[int | str, int | str, int | str] | None = None,
    index: str | None = None,
    expr: str | None = None,
    band_names: str | None = None,
    nodata: float | str | None = None,
    stretch: str = "auto",
    flatten: float | str | None = None,
    tile: int | None = None,
    threads: int | None = None,
    resume: str | os.PathLike[str] | None = None,
    skip_bad_tiles: bool = False,
    collar: str = "auto",
    bounds: tuple[float, float, float, float] | None = None,
    aoi: str | os.PathLike[str] | None = None,
    warp: bool = False,
    allow_path: Folders = (),
    allow_network: bool = False,
) -> BlockMap:
    """Compute the block map of a raster, from which `uavseg.segmentation` answers any range.

    Parameters
    ----------
    source : path, sequence of paths, array, DataArray, open raster of rasterio, Dataset or OccupancyGrid
        The YAML file of a ROS map too.
    band, rgb, index, expr, band_names, nodata, stretch, flatten
    tile, threads : int, optional
    resume : path, optional
    skip_bad_tiles, warp, allow_network : bool
    collar : {"auto", "keep"}
    bounds : (float, float, float, float), optional
    aoi : path, optional
    allow_path : path or sequence of paths
        As of `extract`.
    """
    options = build(DivideOptions, locals())
    with allowing(allow_path, allow_network):
        found = run_divide(open_source(source, options.read), work=work(options.run))
    warn(found.warnings)
    return found.saved.blocks
