"""The words one types in Python: options as plain arguments, answers as values of the field's libraries."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from uavseg.errors import ParameterError
from uavseg.given import area_of, dataset_of, map_of, warn_of, warn_that, workers_of
from uavseg.occupancy.classify import Classification
from uavseg.occupancy.classify import classify as _classify
from uavseg.occupancy.free import FreeCells
from uavseg.occupancy.maps import open_map
from uavseg.occupancy.rosmap import is_ros_map
from uavseg.occupancy.ways import Way, WayParams, find_way
from uavseg.parallel import Progress
from uavseg.raster.skipping import BadBlock, listing
from uavseg.raster.stretch import fit
from uavseg.regions.extract import ExtractParams, Small, windows_of
from uavseg.regions.extract import divide as _divide
from uavseg.regions.extract import extract as _extract
from uavseg.regions.levels import extract_levels
from uavseg.regions.like import Disc, parse_like
from uavseg.regions.match import MatchParams
from uavseg.regions.match import match as _match
from uavseg.regions.suggest import Suggestion, suggest_from_blocks
from uavseg.regions.suggest import suggest as _suggest
from uavseg.segmentation.blockfile import is_block_map, load
from uavseg.segmentation.pipeline import SegmentParams
from uavseg.segmentation.segments import IntensityRange, Levels, StateLimits
from uavseg.segmentation.source import GreySource

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
    smooth_outline: float | None = None,
    simplify: float | None = None,
    tile: int | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
    resume: str | os.PathLike[str] | None = None,
    skip_bad_tiles: bool = False,
) -> GeoDataFrame:
    """Regions of a raster whose mean intensity lies in a range.

    Parameters
    ----------
    source : path, sequence of paths, DataArray, (rows, cols) array or Dataset
        Many paths are one mosaic. A DataArray wants rioxarray's `.rio`.
    range : (float, float)
        Of v in [0, 1], both ends in it.
    band, rgb, nodata, stretch, method, refine, threshold, intensity_step
        As the options of `uavseg extract`.
    min_area, fill_holes : float or str, optional
        Square metres, or pixels as "64px". Holes are filled first, then regions dropped.
    smooth_outline : float, optional
        Metres that outlines without stairs may leave the pixel edges, at most half a pixel.
    simplify : float, optional
        Metres; smoothed outlines are simplified. Columns stay those of the pixels.
    tile, threads : int, optional
        Change no result.
    progress : callable, optional
        Called with (done, total).
    resume : path, optional
        A folder in which finished tiles are kept, so that a run that was stopped goes on where it stopped. It
        stays there in the end, and may be removed.
    skip_bad_tiles : bool
        Whether blocks of a file that cannot be read count as nodata. Each is told of in a warning.

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
    dataset = dataset_of(source, band, rgb, nodata, skip_bad_tiles)
    segment = SegmentParams(method, threshold, intensity_step, refine)  # type: ignore[arg-type]
    params = ExtractParams(
        segment, stretch, area_of(fill_holes), area_of(min_area), simplify, tile, smooth_outline
    )
    bad: set[BadBlock] = set()
    run = listing(workers_of(threads, resume), bad)
    found = _extract(dataset, IntensityRange(*range), params, run, progress)
    warn_of(bad)
    return found.regions.frame()


def levels(
    source: Any,
    width: float,
    *,
    band: int | None = None,
    rgb: tuple[int, int, int] | None = None,
    nodata: float | None = None,
    stretch: str = "auto",
    method: str = "adaptive",
    threshold: float = 1.2,
    intensity_step: float = 0.05,
    min_area: float | str | None = None,
    small: Small = "merge",
    smooth_outline: float | None = None,
    simplify: float | None = None,
    tile: int | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
    resume: str | os.PathLike[str] | None = None,
    skip_bad_tiles: bool = False,
) -> GeoDataFrame:
    """A raster divided into levels of equal width, and each of them into segments of adjacent blocks.

    Parameters
    ----------
    source
        As of `extract`; or the path of a ROS map's YAML file, which is never stretched. For another map of
        probabilities, give ``stretch="none"``.
    width : float
        Of a level, in v: above 0 and at most 1. A value on an edge belongs to the level below it.
    small : {"merge", "drop"}
        What becomes of segments of less than `min_area`: the smallest first, each becomes part of the
        neighbour with the longest common border; or they are dropped.
    band, ..., skip_bad_tiles
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
    if isinstance(source, str | os.PathLike) and is_ros_map(source):
        source, stretch = open_map(source)[0], "none"
    dataset = dataset_of(source, band, rgb, nodata, skip_bad_tiles)
    segment = SegmentParams(method, threshold, intensity_step, "none")  # type: ignore[arg-type]
    params = ExtractParams(segment, stretch, None, area_of(min_area), simplify, tile, smooth_outline, small)
    bad: set[BadBlock] = set()
    run = listing(workers_of(threads, resume), bad)
    found = extract_levels(dataset, Levels(width), params, run, progress)
    warn_of(bad)
    return found.regions.frame()


def match(
    source: Any,
    like: str | os.PathLike[str] | tuple[float, float, float],
    *,
    window: int = 32,
    similarity: float = 0.9,
    intensity: float = 1.0,
    band: int | None = None,
    rgb: tuple[int, int, int] | None = None,
    nodata: float | None = None,
    stretch: str = "auto",
    refine: str = "pixel",
    min_area: float | str | None = None,
    fill_holes: float | str | None = None,
    simplify: float | None = None,
    tile: int | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
    resume: str | os.PathLike[str] | None = None,
    skip_bad_tiles: bool = False,
) -> GeoDataFrame:
    """Regions of a raster whose texture and intensity are like those of a sample of it.

    Texture is compared by G, the log-likelihood ratio between joint histograms of LBP codes and contrast.

    Parameters
    ----------
    source
        As of `extract`.
    like : path or (float, float, float)
        A file of polygons, in any coordinate system; or x, y and radius of a disc in the raster's coordinates
        (the radius in their unit; in metres where they are degrees).
    window : int
        Side in pixels of the window whose texture is compared: 16, 24, 32, 48, 64, 96 or 128.
    similarity : float
        How like the sample's own windows a window must be: above 0 and at most 1; less finds more.
    intensity : float
        By how many of the sample's standard deviations the mean may differ; infinite for texture alone.
    refine : {"pixel", "none"}
        Boundaries to the pixel, or at the edges of cells of 8 pixels.
    band, ..., skip_bad_tiles
        As of `extract`.

    Returns
    -------
    regions : geopandas.GeoDataFrame
        With the columns of `extract` and `similarity`: 1 where a region is as like the sample as the sample
        is to itself. `range_low` and `range_high` are the means that windows may have.

    Raises
    ------
    UavsegError
        As of `extract`; and if the sample is not on the raster, too small, on nodata, or no polygon.

    Examples
    --------
    >>> import numpy as np
    >>> field = np.random.default_rng(0).integers(0, 256, (128, 256)).astype(np.uint8)
    >>> field[:, 128:] = np.arange(128) // 2 % 2 * 255  # rows, of the same mean
    >>> pixels = match(field, like=(64, 64, 40))["pixels"].sum()
    >>> f"{pixels / field.size:.0%}"
    '50%'
    """
    wanted = Disc(*like) if isinstance(like, tuple) else parse_like(os.fspath(like))
    dataset = dataset_of(source, band, rgb, nodata, skip_bad_tiles)
    holes, smallest = area_of(fill_holes), area_of(min_area)
    params = MatchParams(window, similarity, intensity, refine, stretch, holes, smallest, simplify, tile)
    bad: set[BadBlock] = set()
    found = _match(dataset, wanted, params, listing(workers_of(threads, resume), bad), progress)
    warn_of(bad)
    return found.found.regions.frame()


def classify(
    source: Any,
    *,
    free_below: float = 0.498,
    occupied_above: float = 0.502,
    band: int | None = None,
    nodata: float | None = None,
    stretch: str | None = None,
    method: str = "paper",
    refine: str = "scan",
    threshold: float = 1.2,
    intensity_step: float = 0.05,
    min_area: float | str | None = None,
    simplify: float | None = None,
    tile: int | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
    resume: str | os.PathLike[str] | None = None,
) -> Classification:
    """What is free, unknown and occupied in a map of probabilities.

    Parameters
    ----------
    source : path, DataArray, (rows, cols) array, OccupancyGrid or Dataset
        The path is of a raster or of the YAML file of a ROS map. Integers are divided by the largest of their
        type; floats lie in 0..1.
    free_below, occupied_above : float
        The limits of the probability of being occupied.
    stretch : str, optional
        For a map that holds no probabilities, such as "0,100" for one in per cent. Integers are divided by
        the largest of their type, floats are taken as they are, if left out.
    min_area, simplify
        Of the objects: as of `extract`.
    band, ..., resume
        As of `extract`.

    Returns
    -------
    found : Classification
        `states`, a (rows, cols) uint8 array: 1 free, 2 unknown, 3 occupied, 0 no data. `frame()`, the
        occupied objects as a GeoDataFrame with the columns of `extract` and x_min, y_min, x_max and y_max.
        `occupied_in_free`: how many cells are called free though their own v is that of an occupied one.

    Raises
    ------
    UavsegError
        If the map cannot be read, has no valid cell or holds numbers that are no probabilities, or a
        parameter is wrong.

    Examples
    --------
    >>> import numpy as np
    >>> walls = np.zeros((64, 64))
    >>> walls[16:32, 16:48] = 1.0
    >>> found = classify(walls)
    >>> found.cells[3], found.frame()["pixels"].tolist()
    (512, [512])
    """
    segment = SegmentParams(method, threshold, intensity_step, refine)  # type: ignore[arg-type]
    params = ExtractParams(segment, min_area=area_of(min_area), simplify_m=simplify, tile=tile)
    limits = StateLimits(free_below, occupied_above)
    dataset, wanted = map_of(source, band, nodata, stretch)
    run = workers_of(threads, resume)
    grey = GreySource(dataset, fit(dataset, wanted, run, windows_of(dataset, tile)))
    return _classify(grey, limits, params, True, run, progress)


def divide(
    source: Any,
    *,
    stretch: str = "auto",
    tile: int | None = None,
    threads: int | None = None,
    resume: str | os.PathLike[str] | None = None,
    skip_bad_tiles: bool = False,
) -> BlockMap:
    """The block map of a raster, from which `uavseg.segmentation` answers any range.

    Parameters
    ----------
    source : path, sequence of paths, DataArray or Dataset
    stretch : str
    tile, threads : int, optional
    resume : path, optional
    skip_bad_tiles : bool
        As of `extract`.
    """
    bad: set[BadBlock] = set()
    run = listing(workers_of(threads, resume), bad)
    blocks, _ = _divide(dataset_of(source, skip_bad_tiles=skip_bad_tiles), stretch, tile, run)
    warn_of(bad)
    return blocks


def suggest(
    source: Any,
    classes: int | str = "auto",
    *,
    band: int | None = None,
    rgb: tuple[int, int, int] | None = None,
    nodata: float | None = None,
    stretch: str = "auto",
    method: str = "adaptive",
    threshold: float = 1.2,
    intensity_step: float = 0.05,
    tile: int | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
    resume: str | os.PathLike[str] | None = None,
    skip_bad_tiles: bool = False,
) -> list[Suggestion]:
    """Ranges of v that a raster suggests by itself: the classes of the means of its leaves.

    Parameters
    ----------
    source
        As of `extract`; or the path of a block map, which answers by itself.
    classes : int or "auto"
        How many ranges, 2 to 8; as many as the histogram of means has by itself, if left out.
    band, ..., skip_bad_tiles
        As of `extract`.

    Returns
    -------
    ranges : list of Suggestion
        The darkest first: `low` and `high`, together `range`; valid `pixels` and their `share` of all;
        `regions`, their number before boundaries are refined. Empty where all leaves have one mean. What
        makes the ranges doubtful is told in a warning.

    Raises
    ------
    UavsegError
        As of `extract`, and if no pixel is valid.

    Examples
    --------
    >>> import numpy as np
    >>> import uavseg
    >>> field = np.full((64, 64), 60, np.uint8)
    >>> field[16:32, 16:48] = 200
    >>> for found in uavseg.suggest(field):
    ...     print(found.range, found.share, found.regions)
    (0.0, 0.51) 0.875 1
    (0.51, 1.0) 0.125 1
    """
    number = _number_of(classes)
    segment = SegmentParams(method, threshold, intensity_step, "none")  # type: ignore[arg-type]
    params = ExtractParams(segment, stretch, tile=tile)
    bad: set[BadBlock] = set()
    if isinstance(source, str | os.PathLike) and is_block_map(source):
        if (band, rgb, nodata, stretch) != (None, None, None, "auto"):
            raise ParameterError("a block map has its bands, nodata and stretch already")
        found = suggest_from_blocks(load(source), number, params)
    else:
        dataset = dataset_of(source, band, rgb, nodata, skip_bad_tiles)
        run = listing(workers_of(threads, resume), bad)
        found = _suggest(dataset, number, params, run, progress)
    warn_of(bad)
    warn_that(found.warnings)
    return list(found.ranges)


def _number_of(classes: int | str) -> int | None:
    if classes == "auto":
        return None
    if not isinstance(classes, int):
        raise ParameterError(f'classes are "auto" or a number, not {classes!r}')
    return classes


def path(
    source: Any,
    range: tuple[float, float],
    start: tuple[float, float],
    goal: tuple[float, float],
    *,
    clearance: float = 0.0,
    smooth: bool = False,
    band: int | None = None,
    nodata: float | None = None,
    stretch: str | None = None,
    method: str = "adaptive",
    threshold: float = 1.2,
    intensity_step: float = 0.05,
    tile: int | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
    resume: str | os.PathLike[str] | None = None,
) -> Way:
    """The shortest path between two places of one region of a map.

    It leads from cell to cell in eight directions, cuts no corner, and never enters a cell whose own value is
    out of the range.

    Parameters
    ----------
    source : path, DataArray, (rows, cols) array, OccupancyGrid or Dataset
        A map of probabilities, as of `classify`.
    range : (float, float)
        Of v in [0, 1], both ends in it: what is passable, such as (0, 0.45).
    start, goal : (float, float)
        x and y in the map's coordinates.
    clearance : float
        Metres from the centres of the path's cells to everything that is not passable.
    smooth : bool
        Whether the path is pulled tight, at any angle.
    band : int, optional
    nodata : float, optional
    stretch : str, optional
        For a map that holds no probabilities. Integers are divided by the largest of their type, floats are
        taken as they are, if left out.
    method, threshold, intensity_step
        As of `extract`.
    tile, threads : int, optional
        Change no result.
    progress : callable, optional
        Called with (done, total).
    resume : path, optional
        As of `extract`.

    Returns
    -------
    way : Way
        Its corners are `way.xy` on the map; its length is `way.length_m`, in units of the map where that has
        no CRS; what is to be told is in `way.warnings`.

    Raises
    ------
    PathError
        If a place lies outside of the map or in no region, the two lie in different regions, or no path leads
        from one to the other.
    UavsegError
        If the map cannot be read or answered rightly, or a parameter is wrong.

    Examples
    --------
    >>> import uavseg
    >>> from uavseg.occupancy.scenes import lens
    >>> way = uavseg.path(lens().run(), range=(0, 0.45), start=(1.605, 2.805), goal=(2.305, 0.705))
    >>> [round(float(number), 3) for number in way.xy[-1]]
    [2.305, 0.705]
    """
    how = WayParams(clearance, smooth)
    dataset, wanted = map_of(source, band, nodata, stretch)
    segment = SegmentParams(method, threshold, intensity_step)  # type: ignore[arg-type]
    params = ExtractParams(segment, wanted, tile=tile)
    free = FreeCells.of(dataset, IntensityRange(*range), params, workers_of(threads, resume), progress)
    return find_way(free, start, goal, how, workers_of(threads, None))
