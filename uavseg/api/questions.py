"""Questions to a raster: what it is, which regions are like a sample, which ranges to choose."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

from uavseg.access import Folders, allowing
from uavseg.api._values import is_given, regions_of, warn, work
from uavseg.arguments import checked
from uavseg.arrays import GeoDataFrame
from uavseg.errors import ParameterError
from uavseg.execution.executors import Progress
from uavseg.jobs.info import info as run_info, info_regions, names_regions, open_to_describe
from uavseg.jobs.match.ranges_of_sample import SampleRange, ranges_of_sample
from uavseg.jobs.match.request import Ask
from uavseg.jobs.requests import suggest_like_request, suggest_request
from uavseg.jobs.source.open_source import open_all_bands, open_source
from uavseg.jobs.suggest import Suggestion, suggest as run_suggest
from uavseg.options.option import build
from uavseg.options.regions import InfoOptions, MatchOptions, SuggestOptions
from uavseg.options.running import RunOptions
from uavseg.raster.summary import Summary
from uavseg.regions.formats.metadata import RegionFile

Sample = str | os.PathLike[str] | tuple[float, float, float]


@checked
def match(
    source: Any,
    like: Sample | Sequence[Sample] = (),
    *,
    unlike: Sequence[Sample] = (),
    classes: str | os.PathLike[str] | None = None,
    ask: Ask | None = None,
    window: int | None = None,
    similarity: float = 0.9,
    intensity: float = 1.0,
    by: str = "auto",
    answer: int = 1,
    bands: Sequence[int | str] = (),
    band: int | str | None = None,
    rgb: tuple[int | str, int | str, int | str] | None = None,
    index: str | None = None,
    expr: str | None = None,
    band_names: str | None = None,
    nodata: float | str | None = None,
    stretch: str = "auto",
    flatten: float | str | None = None,
    refine: str = "pixel",
    detail: float | str | None = None,
    min_area: float | str | None = None,
    fill_holes: float | str | None = None,
    min_confidence: float | None = None,
    simplify: float | None = None,
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
    """Find regions of a raster that are like a sample of it, by color and texture.

    By color, mixtures of few kinds of ground are fitted to the colors of the raster, and those that are far
    more frequent in the sample are its kind. Texture is compared by G, the log-likelihood ratio between joint
    histograms of LBP codes and contrast.

    Parameters
    ----------
    source
        As of `extract`.
    like : path or (float, float, float), or sequence of them
        A file of polygons, in any coordinate system; or x, y and radius of a disc in the raster's coordinates
        (the radius in their unit; in metres where they are degrees). Several are compared by color.
    unlike : sequence of path or (float, float, float)
        Samples of what is not wanted; they are compared by color.
    classes : path, optional
        In place of `like`: a file of polygons with a column `class`. The colors of the samples of each class
        are compared with those of all others; every pixel is of the likeliest class, or of none.
    ask : function, optional
        Called with the disc (x, y, radius) whose answer helps most, again and again until none helps much:
        True makes it a sample of what is wanted, False one of what is not, "skip" asks about another place,
        None ends the questions. The regions are those of `like` and `unlike` with these discs.
    window : int, optional
        Side in pixels of the window whose texture is compared: 16, 24, 32, 48, 64, 96 or 128. By default 32,
        or 24 or 16 where the sample is small.
    similarity : float
        How like the sample's own windows a window must be: above 0 and at most 1; less finds more.
    intensity : float
        By how many of the sample's standard deviations the mean may differ; infinite for texture alone.
    by : {"auto", "color", "texture"}
        What is compared: color, for which a disc with a radius of 8 pixels is enough, or texture with
        intensity. By default color, with texture where that clearly parts what has the colors of the sample;
        and texture where color hardly parts the sample from the raster, or one of `window`, `similarity` and
        `intensity` is given.
    answer : {1, 2, 3}
        1 for the whole kind; by color also 2, what touches the samples, of finer kinds (a thing among others
        of its color), and 3, finer kinds (where the whole kind takes too much).
    bands : sequence of int or str
        Bands to compare, each by itself; beside texture too. By default those of the intensity; all bands,
        by color, where none is chosen of more than four.
    refine : {"pixel", "none"}
        Boundaries to the pixel, or at the edges of cells of 8 pixels.
    min_confidence : float, optional
        0 to 1: regions of a lower confidence are dropped at last.
    band, ..., allow_network
        As of `extract`.

    Returns
    -------
    regions : geopandas.GeoDataFrame
        With the columns of `extract` and `similarity`: 1 where a region is as like the sample as the sample
        is to itself. Of regions by texture, `range_low` and `range_high` are the means that windows may have.
        Where color decided and left much of the raster undecided, `regions.attrs["uavseg"]["next_sample"]` is
        x, y and radius of the disc that would help most as another sample, of what is wanted or of what is
        not. Where several answers differ, "answers" there names them.

    Raises
    ------
    UavsegError
        As of `extract`; and if the sample is not on the raster, too small, on nodata, or no polygon.

    Examples
    --------
    >>> import numpy as np
    >>> field = np.random.default_rng(0).integers(0, 256, (128, 256)).astype(np.uint8)
    >>> field[:, 128:] = np.arange(128) // 2 % 2 * 255  # rows, of the same mean
    >>> pixels = match(field, like=(64, 64, 40), by="texture")["pixels"].sum()
    >>> f"{pixels / field.size:.0%}"
    '50%'
    """
    if classes is not None and (
        is_given(like)
        or is_given(unlike)
        or (ask, window, similarity, intensity, by, answer) != (None, None, 0.9, 1.0, "auto", 1)
    ):
        raise ParameterError(
            "classes compares the colors of all its samples; leave out like, unlike, ask, window, "
            "similarity, intensity, by and answer"
        )
    return regions_of(source, build(MatchOptions, locals()), progress)


@checked
def suggest(
    source: Any,
    classes: int | str = "auto",
    *,
    like: Sample | Sequence[Sample] = (),
    unlike: Sequence[Sample] = (),
    bands: Sequence[int | str] = (),
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
) -> list[Suggestion] | list[SampleRange]:
    """Suggest ranges of v for a raster: classes of its leaves, and what stands out in them.

    With a sample, the bands, indices and sums of bands and the ranges of their values that part it best.

    Parameters
    ----------
    source
        As of `extract`; or the path of a block map, which answers by itself.
    classes : int or "auto"
        How many ranges, 2 to 8, of Otsu's thresholds alone; as many as the raster has by itself, if left out.
    like, unlike
        Samples of what is wanted and of what is not, as of `match`.
    bands : sequence of int or str
        With a sample: the bands to look at, by number or name; by default all.
    band, ..., allow_network
        As of `extract`.

    Returns
    -------
    ranges : list of Suggestion, or with a sample list of SampleRange
        The class that looks most like things on a ground, the other classes, then parts: `low` and `high`,
        together `range`; valid `pixels` and their `share` of all; `regions`, the number that `extract` gives;
        where `exact` is false, an estimate of it; the `contrast` at its borders; whether it is a `part` of a
        class. Empty where all leaves have one mean. Doubt is a warning. With a sample, the best first:
        `extract(source, values=found.values, **found.words)` extracts one, which has the `agreement` that is
        expected, from 0 to 1.

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
    (0.52, 1.0) 0.125 1
    (0.0, 0.52) 0.875 1
    """
    options = build(SuggestOptions, locals())
    with allowing(allow_path, allow_network):
        if not any(map(is_given, (like, unlike, bands))):
            request = suggest_request(options)
            found = run_suggest(open_source(source, options.read), request, work(options.run, progress))
            warn(found.warnings)
            return list(found.ranges)
        if (classes, method, threshold, intensity_step, resume) != ("auto", "adaptive", 1.2, 0.05, None):
            raise ParameterError(
                "classes, method, threshold, intensity_step and resume are for ranges without a sample; "
                "leave them out"
            )
        samples = suggest_like_request(options)
        parting = ranges_of_sample(open_all_bands(source, options.read), samples, work(options.run, progress))
    warn(parting.warnings)
    return list(parting.ranges)


@checked
def info(
    source: Any,
    *,
    band: int | str | None = None,
    rgb: tuple[int | str, int | str, int | str] | None = None,
    index: str | None = None,
    expr: str | None = None,
    band_names: str | None = None,
    nodata: float | str | None = None,
    stretch: str = "auto",
    threads: int | None = None,
    skip_bad_tiles: bool = False,
    collar: str = "auto",
    bounds: tuple[float, float, float, float] | None = None,
    aoi: str | os.PathLike[str] | None = None,
    warp: bool = False,
    allow_path: Folders = (),
    allow_network: bool = False,
) -> Summary | RegionFile:
    """Describe a raster and its intensity, or what a file of regions holds.

    Parameters
    ----------
    source
        As of `extract`; or the path of a file of regions.
    band, ..., allow_network
        As of `extract`.

    Returns
    -------
    found : Summary or RegionFile
        Of a raster: size, CRS, resolution, bands, stretch and histogram of v; `command`, a command to try
        next; `warnings`. Of a file of regions: its format, CRS, extent and columns, and `metadata`, what they
        were made from and how. `as_dict()` is what ``uavseg info --json`` writes.

    Raises
    ------
    UavsegError
        If it cannot be read, or a parameter is wrong.

    Examples
    --------
    >>> import numpy as np
    >>> import uavseg
    >>> found = uavseg.info(np.full((64, 80), 51, np.uint8))
    >>> found.rows, found.cols, found.stretch, round(found.mean, 3)
    (64, 80, 'dtype -> 0..255', 0.2)
    """
    options = build(InfoOptions, locals())
    with allowing(allow_path, allow_network):
        if names_regions(source):
            return info_regions(source, options.read)
        opened = open_to_describe(source, options.read)
        return run_info(opened, work(RunOptions(threads=threads)), _names(source))


def _names(source: Any) -> list[str]:
    """Return the source as it was named; empty where it is no file."""
    parts = source if isinstance(source, list | tuple) else [source]
    return [os.fspath(part) for part in parts if isinstance(part, str | os.PathLike)]
