"""Similarity to a sample by colour, a posterior probability read like an intensity, and the next sample."""

import math
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.arrays import Bools, Floats, Integers, Uint8s, Uint16s, Uint32s
from uavseg.dataclass import dataclass
from uavseg.errors import SampleError
from uavseg.raster.geodesy.globe import is_geographic
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import ground_steps
from uavseg.raster.grid.tiling import TilePass, Window, spread_windows, tile_side
from uavseg.raster.intensity.stretch import Stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.read.raster_file import MOST_UNCHOSEN
from uavseg.regions.sample.place import Disc, SampleMask, sample_mask
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.sample.similarity_table import BLUR_HALO, Axes, SimilarityTable, blurred
from uavseg.segmentation.source import GreySource, GreyTile
from uavseg.units import BLOCK, CELL, GREY_MAX

MIN_PIXELS = 64  # of a sample
_WINDOWS = 32  # along each side of the raster, in which its colours are sampled
_WINDOW = 12  # pixels, at most
_STEP = 4  # pixels between those that are sampled
_BETWEEN = 2000  # values between two windows, read in less time than another read takes
_MIN_SHARE = 0.05  # of the raster that is undecided, below which no sample is proposed
_MIN_UNCERTAINTY = 0.5  # of the pixels of a disc on average
_MIN_RADIUS, _MAX_RADIUS = 8.0, 16.0  # pixels
_GAP = 2  # radii from the samples
_CANDIDATES = 16  # discs whose pixels are read
_NEAR = 0.5  # root mean square difference of colours, in deviations of the raster, of one kind of ground
_SURPRISE = 0.1  # minimum probability that a colour is not what it seems to be
_MIN_PART = 0.9  # of the pixels of a disc, that are valid and within the raster
_MIN_GAIN = 0.02  # of what is found, that an answer is expected to change
_MAX_ASPECT = 4  # of a pixel: longer ones make a disc of too few cells
_STRIP = 1 << 20  # cells that are scored at a time, in whole rows
_FORBIDDEN = -(1 << 40)  # score of a cell that no disc may touch: no disc can outweigh it
_VALUES = 1 << 22  # of many bands that are read at a time
_BULK = (0.02, 0.98)  # quantiles of a band, of which the range is mapped to the middle third of its greys
_FULL = CELL * CELL  # pixels of a cell
_CERTAIN = _FULL * GREY_MAX  # sum of a cell whose similarity is 1


@dataclass(frozen=True)
class SimilaritySource(GreySource):
    """Similarity to a sample in place of grey, 65535 for certain; valid where all bands are."""

    bands: "BlurredBands"
    table: SimilarityTable

    @property
    def is_intensity(self) -> bool:
        """False: where colors overlap, similarity is bimodal, and small structures are noise."""
        return False

    def read(self, window: Window, margin: int, excess: bool = False) -> GreyTile:
        """Read a window; parameters as of `GreySource.read`."""
        planes, valid = self.bands.read(window, margin)
        grey = self.table.apply(planes)
        all_valid = bool(valid.all())
        if not all_valid:
            grey[valid == 0] = 0
        return GreyTile(grey, valid, all_valid)


class BlurredBands:
    """Blurred bands of a raster, which several similarities share; each thread caches its last window.

    With axes, what is blurred are sums of bands.
    """

    def __init__(self, bands: Sequence[GreySource], axes: Axes | None = None) -> None:
        self.bands, self.axes = tuple(bands), axes
        self._last = threading.local()

    def __reduce__(self) -> tuple[type["BlurredBands"], tuple[tuple[GreySource, ...], Axes | None]]:
        return BlurredBands, self.fingerprint()

    def fingerprint(self) -> tuple[tuple[GreySource, ...], Axes | None]:
        """Return the bands and axes: no result depends on the cache."""
        return self.bands, self.axes

    def read(self, window: Window, margin: int) -> tuple[list[Uint16s], Uint8s]:
        """Read blurred bands of a window, and where all are valid; do not change the arrays."""
        if getattr(self._last, "place", None) != (window, margin):
            self._last.tile = _read_blurred(self.bands, window, margin, self.axes)
            self._last.place = window, margin
        tile: tuple[list[Uint16s], Uint8s] = self._last.tile
        return tile


@dataclass(frozen=True)
class SampledColors:
    """Blurred colours, each (n, bands): `points` all over a raster, a sample, and samples of other areas."""

    points: Uint16s
    sample: Uint16s
    unlike: Uint16s | None

    def table(self, finer: bool = False) -> SimilarityTable:
        """Fit the model of the samples, or one of finer kinds, against the whole raster as background."""
        return SimilarityTable.fit(self.points, self.sample, self.unlike, finer)

    def similarity(self, bands: BlurredBands, finer: bool = False) -> SimilaritySource:
        """Return the raster as similarity to the samples, of the bands from which the colours are."""
        first, table = bands.bands[0], self.table(finer)
        if _stack_of(bands.bands) is not None:
            bands, table = BlurredBands(bands.bands, table.axes), table.on_axes
        return SimilaritySource(first.dataset, first.stretch, bands, table)


def sample_colors(
    bands: Sequence[GreySource],
    places: Sequence[SampleMask],
    tile_pass: TilePass,
    unlike: Sequence[SampleMask] = (),
    name: str = "the sample",
    spread: Uint16s | None = None,
) -> SampledColors:
    """Collect colours of samples, and of pixels all over the raster.

    The bands are of one raster; `places` are samples of the target, called `name` in errors, `unlike` those
    of other areas. `spread`, (n, bands), is from `spread_colors`, where several samples are compared. The
    result depends neither on the executor of the pass nor on its tiles. A SampleError says that either have
    fewer than 64 valid pixels, or that some have pixels in common.
    """
    if any(place.meets(other) for place in places for other in unlike):
        raise SampleError(
            "a sample of what is wanted and one of what is not have pixels in common; draw them apart"
        )
    run = tile_pass.silent
    sample = _colors_of(run, bands, places, name)
    others = _colors_of(run, bands, unlike, "the sample of what is unlike") if unlike else None
    if spread is None:
        spread = spread_colors(bands, tile_pass)
    return SampledColors(np.concatenate([spread, sample[:1]]), sample, others)


def spread_colors(bands: Sequence[GreySource], tile_pass: TilePass) -> Uint16s:
    """Return colours of pixels in small windows that are spread evenly over a raster: (n, bands) uint16."""
    return np.concatenate(window_colors(bands, tile_pass))


def window_colors(bands: Sequence[GreySource], tile_pass: TilePass) -> list[Uint16s]:
    """Return colours of pixels in each of the windows of `spread_colors`."""
    return _spread(partial(_colors, bands), _stack_of(bands) or bands[0].dataset, tile_pass)


def spread_stretches(dataset: Dataset, tile_pass: TilePass) -> list[Stretch]:
    """Return a stretch of each band of a stack, by quantiles in small windows all over the raster."""
    found = np.concatenate(_spread(partial(_values, dataset), dataset, tile_pass))
    lows, highs = np.quantile(found, _BULK, axis=0) if len(found) else np.zeros((2, len(dataset.bands)))
    wide = np.where(np.abs(highs) + np.abs(lows) < np.finfo(np.float32).max, highs - lows, 0)
    ends = zip((lows - wide).tolist(), (highs + wide).tolist(), strict=True)
    return [Stretch(low, high, f"quantiles -> {low:g}..{high:g}") for low, high in ends]


def _spread(
    read: Callable[[Sequence[Window]], list[NDArray[Any]]], dataset: Dataset, tile_pass: TilePass
) -> list[NDArray[Any]]:
    """Read small windows spread evenly over a raster, in the order of the file's blocks."""
    rows, cols = dataset.file_block
    groups = _groups(spread_windows(dataset.geobox.shape, _WINDOWS, _WINDOW), cols, len(dataset.bands))
    order = sorted(range(len(groups)), key=lambda k: (groups[k][0].row // rows, groups[k][0].col // cols))
    found = dict(zip(order, tile_pass.silent.run(read, [groups[k] for k in order]), strict=True))
    return [one for k in range(len(groups)) for one in found[k]]


def _groups(windows: Sequence[Window], cols: int, bands: int) -> list[list[Window]]:
    """Divide windows, row by row, into groups that are read at once, as no other blocks lie between them.

    A block of the file has so many columns.
    """
    result: list[list[Window]] = []
    for window in windows:
        last = result[-1][-1] if result else window
        end = last.col + last.cols
        near = window.col // cols - (end - 1) // cols <= 1 and (window.col - end) * bands <= _BETWEEN
        if result and last.row == window.row and near:
            result[-1].append(window)
        else:
            result.append([window])
    return result


def _around(windows: Sequence[Window]) -> tuple[Window, list[tuple[slice, slice]]]:
    """Return the window around windows of one row, and every fourth pixel of each in every fourth row."""
    first, last = windows[0], windows[-1]
    around = replace(first, cols=last.col + last.cols - first.col)
    down = slice(_STEP // 2, first.rows, _STEP)
    parts = [one.relative_to(around) for one in windows]
    return around, [(down, slice(one.col + _STEP // 2, one.col + one.cols, _STEP)) for one in parts]


def _values(dataset: Dataset, windows: Sequence[Window]) -> list[Floats]:
    """Return stored values of every fourth pixel of windows in every fourth row: each (n, bands)."""
    around, places = _around(windows)
    values, valid = dataset.read(around)
    known = np.ones(values.shape[1:], bool) if valid is None else valid
    return [values[:, *chosen][:, known[chosen]].T.astype(np.float64) for chosen in places]


def _colors_of(
    tile_pass: TilePass, bands: Sequence[GreySource], places: Sequence[SampleMask], name: str
) -> Uint16s:
    colors = np.concatenate(list(tile_pass.run(partial(_sample_colors, bands), places)))
    if len(colors) == 0:
        raise SampleError(f"{name} has no valid pixel; it probably lies on nodata")
    if len(colors) < MIN_PIXELS:
        pixels = "1 valid pixel" if len(colors) == 1 else f"{len(colors)} valid pixels"
        raise SampleError(
            f"{name} has {pixels}; expected at least {MIN_PIXELS}, as a disc with a radius of 5 pixels "
            "has; give a larger one"
        )
    return colors


def _colors(bands: Sequence[GreySource], windows: Sequence[Window]) -> list[Uint16s]:
    """Return blurred colours of every fourth pixel of windows in every fourth row: each (n, bands)."""
    around, places = _around(windows)
    if bands[0].dataset.is_empty(around):
        return [np.empty((0, len(bands)), np.uint16) for _ in windows]
    planes, valid = _read_blurred(bands, around, 0)
    return [np.stack([plane[chosen][valid[chosen] != 0] for plane in planes], 1) for chosen in places]


def _sample_colors(bands: Sequence[GreySource], place: SampleMask) -> Uint16s:
    """Return blurred colours of the pixels of a sample: (m, bands)."""
    planes, valid = _read_blurred(bands, place.window, 0)
    chosen = valid != 0
    rows, cols = place.window.rows, place.window.cols
    chosen[:rows, :cols] &= place.mask
    chosen[rows:], chosen[:, cols:] = False, False
    return np.stack([plane[chosen] for plane in planes], 1)


def _read_blurred(
    bands: Sequence[GreySource], window: Window, margin: int, axes: Axes | None = None
) -> tuple[list[Uint16s], Uint8s]:
    """Read blurred bands, or sums of them, of a window with a margin, and where all bands are valid."""
    inner = np.s_[BLUR_HALO:-BLUR_HALO, BLUR_HALO:-BLUR_HALO]
    stack, grown = _stack_of(bands), window.grown(margin + BLUR_HALO)
    if stack is not None:
        shape = grown.rows + -window.rows % BLOCK, grown.cols + -window.cols % BLOCK
        greys = np.zeros((len(bands) if axes is None else len(axes.weights), *shape), np.uint16)
        valid = np.zeros(shape, np.uint8)
        for part in _parts(stack, grown.clipped(stack.geobox.shape)):
            here = part.relative_to(grown).slices
            values, mask = stack.read(part)
            if values.dtype.itemsize <= 2:
                values = values.astype(np.float32)  # of the same greys, and without a table for each band
            planes = (band.stretch.apply(plane[None]) for band, plane in zip(bands, values, strict=True))
            greys[:, *here] = list(planes) if axes is None else axes.of(planes)
            valid[here] = 1 if mask is None else mask
        return [blurred(plane, valid) for plane in greys], np.ascontiguousarray(valid[inner])
    tiles = [band.read(window, margin + BLUR_HALO) for band in bands]
    valid = np.bitwise_and.reduce([tile.valid[inner] for tile in tiles])
    return [blurred(tile.grey, tile.valid) for tile in tiles], np.ascontiguousarray(valid)


def _stack_of(bands: Sequence[GreySource]) -> Dataset | None:
    """Return the raster of which many bands are read together; None for few, or those of several types."""
    choices = [band.dataset.choice for band in bands]
    if len(bands) <= MOST_UNCHOSEN or len({choice.dtype for choice in choices}) > 1:
        return None
    numbers = tuple(choice.bands[0] for choice in choices)
    return replace(bands[0].dataset, choice=replace(choices[0], bands=numbers, stacked=True))


def _parts(dataset: Dataset, window: Window) -> Iterator[Window]:
    """Yield the parts of a window of which all bands are read at a time, whose memory is about the same."""
    rows, cols = tile_side(dataset.geobox.shape, dataset.file_block, _VALUES // len(dataset.bands))
    down, across = window.blocks(rows, cols)
    for row in range(down.start, down.stop):
        for col in range(across.start, across.stop):
            yield Window(row * rows, col * cols, rows, cols).common(window)


def next_place(
    source: SimilaritySource, blocks: BlockMap, samples: Sequence[SampleMask], tile_pass: TilePass
) -> Disc | None:
    """Return the disc on the map whose pixels are the least certain; None where hardly any are uncertain.

    Active learning by uncertainty sampling (D. Lewis and W. Gale, A sequential algorithm for training text
    classifiers, SIGIR 1994): cells -> a few discs of uncertain cells, far enough from all samples -> the one
    of the most uncertain pixels.

    It lies on valid pixels as a whole and outside of all samples, and is about as large as these are, with a
    radius of 8 to 16 pixels; of 8 where no larger one fits. The blocks are of the similarity, the samples
    those of the target and of other areas. The result depends neither on the executor of the pass nor on its
    tiles.
    """
    if source.table.uncertain < _MIN_SHARE:
        return None
    geobox = source.dataset.geobox
    for radius, reach in _radii(geobox, samples):
        taken = _cells_near(samples, blocks.counts.shape, _GAP * radius)
        cells = most_uncertain_cells(blocks.sums, blocks.counts, taken, reach, _CANDIDATES, _MIN_UNCERTAINTY)
        discs = [_disc(geobox, row, col, reach) for row, col in cells.tolist()]
        masks = [_mask_apart(disc, source.dataset.geobox, samples) for disc in discs]
        candidates = [(disc, mask) for disc, mask in zip(discs, masks, strict=True) if mask is not None]
        values = list(tile_pass.silent.run(partial(_uncertainty, source), [mask for _, mask in candidates]))
        first = max(range(len(values)), key=values.__getitem__, default=None)
        if first is not None and values[first] >= _MIN_UNCERTAINTY:
            return candidates[first][0]
    return None


def _radii(geobox: GeoBox, samples: Sequence[SampleMask]) -> list[tuple[float, float]]:
    """Return radii of a disc in pixels, and along the shorter side of these; none where no disc is round."""
    long, wide = _pixel_extents(geobox, geobox.shape[0] / 2, geobox.shape[1] / 2)
    aspect = long / wide if wide > 0 and math.isfinite(long) else math.inf
    if aspect > _MAX_ASPECT:
        return []
    pixels = np.mean([np.count_nonzero(place.mask) for place in samples])
    mean_radius = float(min(max(round(math.sqrt(pixels / math.pi)), _MIN_RADIUS), _MAX_RADIUS))
    return [(one, one * math.sqrt(aspect)) for one in dict.fromkeys((mean_radius, _MIN_RADIUS))]


def place_to_ask(
    bands: Sequence[GreySource],
    colors: Sequence[Uint16s],
    samples: Sequence[SampleMask],
    unlike: Sequence[SampleMask],
    skipped: Sequence[SampleMask],
    tile_pass: TilePass,
) -> Disc | None:
    """Return the disc about which an answer is expected to change most; None where that is hardly anything.

    The expected change is the sum of the probabilities that windows of `window_colors` are decided wrongly,
    each by how near its colour is to the place and how far from all samples, over the windows expected to be
    found (expected error reduction, by a kernel of colours; N. Roy and A. McCallum, ICML 2001). Mixed ground
    counts less. `skipped` are places without an answer. The disc is as of `next_place`.
    """
    known = [*samples, *unlike, *skipped]
    table = sample_colors(bands, samples, tile_pass, unlike, spread=np.concatenate(colors)).table()
    full = max(map(len, colors))
    whole = [k for k, one in enumerate(colors) if len(one) == full > 0]
    if not whole:
        return None
    pixels = np.stack([colors[k] for k in whole])
    similar = table.of(pixels.reshape(-1, len(bands))).reshape(-1, full).mean(1) / GREY_MAX
    scale = np.maximum(pixels.std((0, 1)), 1)
    means, pure = pixels.mean(1) / scale, 1 / (1 + (pixels.std(1) / scale).mean(1) / _NEAR)
    of_known = list(tile_pass.silent.run(partial(_sample_colors, bands), known))
    unknown = 1 - _nearness(means, np.stack([one.mean(0) / scale for one in of_known if len(one)]))
    wrong = np.maximum(np.minimum(similar, 1 - similar), _SURPRISE) * unknown.prod(1) * pure
    gains = (_nearness(means, means) * wrong).sum(1) / max(float(similar.sum()), 1.0)
    geobox, windows = bands[0].dataset.geobox, spread_windows(bands[0].shape, _WINDOWS, _WINDOW)
    order = np.argsort(-gains * pure, kind="stable")
    for (radius, reach), k in product(_radii(geobox, known), order[gains[order] >= _MIN_GAIN].tolist()):
        window = windows[whole[k]]
        cell = (window.row + window.rows // 2) // CELL, (window.col + window.cols // 2) // CELL
        disc = _disc(geobox, *cell, reach)
        mask = _mask_apart(disc, geobox, known)
        read = [] if mask is None else tile_pass.silent.run(partial(_sample_colors, bands), [mask])
        if any(len(one) >= _MIN_PART * math.pi * radius**2 for one in read):
            return disc
    return None


def _nearness(colors: Floats, others: Floats) -> Floats:
    """Return how near (n, bands) colours are to (m, bands) others, 1 where they are equal: (n, m)."""
    squares = sum(np.subtract.outer(one, other) ** 2 for one, other in zip(colors.T, others.T, strict=True))
    return np.asarray(np.exp(-squares / (2 * _NEAR**2 * colors.shape[1])))


def _uncertainty(source: SimilaritySource, place: SampleMask) -> float:
    """Compute the mean uncertainty of the pixels of a place, 0 to 1; 0 if one of them is not valid."""
    tile, inside = source.read(place.window, 0), place.mask
    rows, cols = inside.shape
    if not tile.valid[:rows, :cols][inside].all():
        return 0.0
    grey = tile.grey[:rows, :cols][inside].astype(np.int64)
    return float((GREY_MAX - np.abs(2 * grey - GREY_MAX)).sum()) / (GREY_MAX * len(grey))


def _mask_apart(disc: Disc, geobox: GeoBox, samples: Sequence[SampleMask]) -> SampleMask | None:
    """Return the pixels of a disc; None where they are too few, or some belong to a sample."""
    try:
        place = sample_mask(disc, geobox)
    except SampleError:
        return None
    is_large = np.count_nonzero(place.mask) >= MIN_PIXELS
    return place if is_large and not any(map(place.meets, samples)) else None


def _cells_near(samples: Sequence[SampleMask], shape: tuple[int, ...], gap: float) -> Bools:
    """Return the cells within a gap of samples: (m, n) bool."""
    from scipy.ndimage import binary_dilation

    taken = np.zeros(shape, bool)
    disc = _disc_cells(half_widths(gap))
    reach = len(disc) // 2
    for place in samples:
        near = binary_dilation(np.pad(place.cell_counts() > 0, reach), disc)
        first = Window(place.window.row // CELL - reach, place.window.col // CELL - reach, *near.shape)
        part = first.clipped((shape[0], shape[1]))
        taken[part.slices] |= near[part.relative_to(first).slices]
    return taken


def _disc_cells(widths: Integers) -> Bools:
    """Return the cells that a disc touches, from its half-widths."""
    side = int(widths.max())
    return np.asarray(np.abs(np.arange(-side, side + 1)) <= widths[:, None])


def _pixel_extents(geobox: GeoBox, row: float, col: float) -> tuple[float, float]:
    """Return the longest and the shortest extent of a pixel in the unit of a radius."""
    if is_geographic(geobox.wkt):
        steps = ground_steps(geobox, row, col)
        return max(steps), min(steps)
    t = geobox.transform
    values = np.linalg.svd(np.array([[t.a, t.b], [t.d, t.e]]), compute_uv=False)
    return float(values[0]), float(values[1])


def _disc(geobox: GeoBox, row: int, col: int, reach: float) -> Disc:
    """Return the disc on the map around the middle of a cell, with a radius in pixels at most `reach`."""
    middle = ((row + 0.5) * CELL, (col + 0.5) * CELL)
    x, y = (float(value) for value in geobox.xy_from_pixel(*middle))
    t = geobox.transform
    digits = 1 - math.floor(math.log10(min(math.hypot(t.a, t.d), math.hypot(t.b, t.e))))  # 0.1 pixels or less
    radius = reach * _pixel_extents(geobox, *middle)[1]
    of_radius = 2 - math.floor(math.log10(radius))
    unit = 10.0**of_radius
    rounded_down = round(math.floor(radius * unit + 1e-6) / unit, max(of_radius, 0))
    return Disc(round(x, digits), round(y, digits), rounded_down)


def half_widths(radius: float) -> Integers:
    """Return how far a disc around the middle of a cell reaches in each row of cells, from -k to k.

    The radius is in pixels, the (2 k + 1,) half-widths in cells.

    Examples
    --------
    >>> half_widths(8), half_widths(16)
    (array([1, 1, 1]), array([1, 2, 2, 2, 1]))
    """
    reach = int(np.ceil((radius - CELL / 2) / CELL))
    gaps = np.maximum(np.abs(np.arange(-reach, reach + 1)) * CELL - CELL / 2, 0)
    widths = np.ceil((np.sqrt(np.maximum(radius**2 - gaps**2, 0)) - CELL / 2) / CELL)
    return np.asarray(np.maximum(widths, 0).astype(np.int64))


def most_uncertain_cells(
    sums: Uint32s, counts: Uint8s, taken: Bools, radius: float, count: int, minimum: float
) -> Integers:
    """Return the cells around which a disc of valid pixels is most uncertain, in descending order: (k, 2).

    The uncertainty of a cell is 1 where its mean similarity is one half, and 0 where that is 0 or 1; that of
    a disc is `minimum`, 0 to 1, or more. Sums and counts are of the similarity, as in a block map. No disc,
    whose radius is in pixels, may touch the cells `taken`. `count` is the maximum number; of equal ones the
    first by row and column.
    """
    widths = half_widths(radius)
    limit = int(np.ceil(minimum * _CERTAIN * int((2 * widths + 1).sum())))
    scores, cells = np.empty(0, np.int64), np.empty((0, 2), np.int64)
    for top, strip in _strips(sums, counts, taken, _disc_cells(widths)):
        places = np.flatnonzero(strip >= limit)
        if len(places) > count:
            at_places = strip.ravel()[places]
            places = places[at_places >= np.partition(at_places, -count)[-count]]
        rows, cols = np.divmod(places, strip.shape[1])
        scores = np.concatenate([scores, strip.ravel()[places]])
        cells = np.concatenate([cells, np.stack([rows + top, cols], 1)])
        best = np.argsort(-scores, kind="stable")[:count]
        scores, cells = scores[best], cells[best]
    return cells


def _strips(sums: Uint32s, counts: Uint8s, taken: Bools, disc: Bools) -> Iterator[tuple[int, Integers]]:
    """Yield the first row of each strip, and the score of a disc around each of its cells."""
    from scipy.ndimage import correlate

    reach, rows, step = len(disc) // 2, len(sums), max(_STRIP // sums.shape[1], 1)
    for top in range(0, rows, step):
        first = max(top - reach, 0)
        part = np.s_[first : top + step + reach]
        around = _CERTAIN - np.abs(2 * sums[part].astype(np.int64) - _CERTAIN)
        around[(counts[part] != _FULL) | taken[part]] = _FORBIDDEN
        # In double precision, which holds these sums exactly.
        scores = correlate(around, disc, np.int64, mode="constant", cval=_FORBIDDEN)
        yield top, scores[top - first :][:step]
