"""Picture of suggested ranges: their cells or pixels in colour over the map, beside the histogram."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from matplotlib.colors import to_rgba

from uavseg.arrays import Path_, Uint8s
from uavseg.jobs.source.inputs import keep_inputs
from uavseg.jobs.suggest import Suggestions
from uavseg.plot.layers.raster_layers import draw_image, draw_raster
from uavseg.plot.page import page
from uavseg.raster.grid.geobox import scaled
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.dataset import Dataset, DatasetOverview
from uavseg.raster.spectral.bands import ValueAxis
from uavseg.units import CELL, GREY_MAX

RANGE_COLORS = ("#3b5bdb", "#19c3f0", "#2fd05f", "#b5e61d", "#ffe119", "#ff8c1a", "#e8362e", "#f032e6")
_DARK_PART_COLOR, _BRIGHT_PART_COLOR = "#19c3f0", "#f032e6"  # of ranges that are parts of the outermost ones
_ALPHA = 0.42
_WIDTH_IN, _MAP_IN, _PLOT_IN = 10.0, 6.3, 2.6  # the page, the raster and the histogram
_VALUES_IN = 0.55  # the axis of values beside the histogram
_HEAD_IN, _FOOT_IN, _MARGIN_IN, _LINE_IN = 0.42, 0.34, 0.15, 0.2
_SMALL, _TITLE_IN = 0.8, 0.14  # a line of values, as a share of a line; the title of their axis
_MIN_PLOT_IN, _MAX_HEIGHT_IN = 2.0, 11.0
_WIDTH_PX = 1600
_MAX_PIXELS = 2 * _WIDTH_PX
_BINS = 256


def draw_suggestions(
    suggestions: Suggestions, out: Path_, dataset: Dataset | None = None, overwrite: bool = False
) -> Path:
    """Draw the ranges over the raster, or without it the cells, and their histogram with bounds, as PNG."""
    target = page.check_png_target(out, overwrite)
    keep_inputs([target], dataset.paths if dataset is not None else ())
    figure = _figure(suggestions, dataset)
    page.save_figure(figure, target, overwrite)
    return target


def _figure(suggestions: Suggestions, dataset: Dataset | None) -> Any:
    source = suggestions.source
    frame = page.Frame(source.geobox, source.in_metres and source.geobox.crs is None)
    view, height = _view(frame, _MIN_PLOT_IN + _legend_height(suggestions))
    page_in = height + _HEAD_IN + _FOOT_IN
    figure = page.new_figure(_WIDTH_IN, page_in, _WIDTH_PX / _WIDTH_IN)
    ax = figure.add_axes((_MARGIN_IN / _WIDTH_IN, _FOOT_IN / page_in, _MAP_IN / _WIDTH_IN, height / page_in))
    point = page.fit_axes(ax, view, _MAP_IN, height)
    _draw_map(ax, point, frame, suggestions, dataset)
    left = _WIDTH_IN - _MARGIN_IN - _PLOT_IN
    plot_width = _PLOT_IN - (0 if source.axis is None else _VALUES_IN)
    plot_height = height - 0.1 - _legend_height(suggestions)
    box = (left / _WIDTH_IN, (_FOOT_IN + 0.1) / page_in, plot_width / _WIDTH_IN, plot_height / page_in)
    plot = figure.add_axes(box)
    _draw_histogram(plot, suggestions)
    _write_legend(figure, left / _WIDTH_IN, suggestions)
    x = _MARGIN_IN / _WIDTH_IN
    figure.text(x, 1 - 0.12 / page_in, source.name, size=12, weight="bold", color=page.TEXT_COLOR, va="top")
    caption = page.raster_caption(source.geobox, source.band_names, f"grey: {source.stretch.name}")
    figure.text(x, 0.12 / page_in, caption, size=7.5, color=page.CAPTION_COLOR, va="bottom")
    return figure


def _view(frame: page.Frame, min_height: float) -> tuple[page.View, float]:
    """Return the view of the raster, and the height of the map in inches."""
    margin = 0.02 * float(np.ptp(frame.corners, axis=0).max())
    left, bottom = (float(end) - margin for end in frame.corners.min(axis=0))
    right, top = (float(end) + margin for end in frame.corners.max(axis=0))
    height = _MAP_IN * (top - bottom) / (right - left)
    return (left, right, bottom, top), min(max(height, min_height), _MAX_HEIGHT_IN)


def _draw_map(
    ax: Any, point: float, frame: page.Frame, suggestions: Suggestions, dataset: Dataset | None
) -> None:
    counts = suggestions.blocks.counts
    if dataset is not None:
        draw_raster(ax, dataset, frame, suggestions.source.stretch, in_color=False)
    else:
        greys = (suggestions.blocks.sums // np.maximum(counts, 1) >> 8).astype(np.uint8)
        grey, plot_from_pixel = upsample_cells(greys, frame, _MAX_PIXELS)
        alpha, _ = upsample_cells(np.where(counts > 0, np.uint8(255), np.uint8(0)), frame, _MAX_PIXELS)
        draw_image(ax, np.stack([grey, grey, grey, alpha], axis=-1), plot_from_pixel, zorder=2)
    if suggestions.ranges and suggestions.by_pixel and dataset is not None:
        coarse = DatasetOverview.of(dataset, _MAX_PIXELS)
        values, valid = coarse.read(Window(0, 0, *coarse.geobox.shape))
        v = suggestions.source.stretch.apply(values, valid) / GREY_MAX
        intervals = np.zeros(v.shape, np.uint8)  # the range of each pixel, counted from 1; 0 for none
        for number, one in enumerate(suggestions.by_intensity, 1):
            intervals[(v >= one.range[0]) & (v <= one.range[1])] = number
        intervals = intervals * (np.uint8(1) if valid is None else valid)
        _draw_ranges(ax, intervals, frame.plot_from_map * coarse.geobox.transform, _colors(suggestions))
    elif suggestions.ranges:
        intervals = suggestions.intervals * (counts > 0)  # a leaf may extend into nodata
        _draw_ranges(ax, *upsample_cells(intervals, frame, _MAX_PIXELS), _colors(suggestions))
    page.draw_furniture(ax, frame, point)


def upsample_cells(cells: Uint8s, frame: page.Frame, max_side: int) -> tuple[Uint8s, Affine]:
    """Upsample cells of 8 x 8 pixels to the extent of the raster (nearest neighbour).

    The picture has `max_side` rows and columns at most. The transform is from its pixel corners (col, row) to
    plot coordinates.
    """
    box = frame.geobox
    step = max(-(-max(box.shape) // max_side), 1)
    rows, cols = (max(length // step, 1) for length in box.shape)
    row, col = (
        ((np.arange(n) + 0.5) * length / n).astype(np.int64) // CELL
        for n, length in zip((rows, cols), box.shape, strict=True)
    )
    plot_from_pixel = frame.plot_from_map * scaled(box.transform, box.shape[0] / rows, box.shape[1] / cols)
    return cells[np.ix_(row, col)], plot_from_pixel


def _draw_ranges(ax: Any, intervals: Uint8s, transform: Affine, colors: Sequence[str]) -> None:
    """Draw each range in its colour, translucent over grey."""
    table = np.zeros((len(colors) + 1, 4), np.uint8)
    for k, color in enumerate(colors, start=1):
        table[k] = np.round(255 * np.array(to_rgba(color, _ALPHA)))
    draw_image(ax, table[intervals], transform, zorder=2.2)


def _colors(suggestions: Suggestions) -> list[str]:
    """Return the colours of the ranges by intensity, parts last."""
    ranges = suggestions.by_intensity
    parts = [_DARK_PART_COLOR if one.low == 0 else _BRIGHT_PART_COLOR for one in ranges if one.part]
    return range_colors(len(ranges) - len(parts)) + parts


def range_colors(count: int) -> list[str]:
    """Choose the colours of `count` ranges, the darkest range first.

    Examples
    --------
    >>> range_colors(2)
    ['#3b5bdb', '#e8362e']
    """
    last = len(RANGE_COLORS) - 2 if count < len(RANGE_COLORS) else len(RANGE_COLORS) - 1
    return [RANGE_COLORS[round(k * last / max(count - 1, 1))] for k in range(count)]


def _draw_histogram(ax: Any, suggestions: Suggestions) -> None:
    """Draw v upwards, the square root of the area to the right, so that rare values stay visible."""
    counts = suggestions.histogram.reshape(_BINS, -1).sum(axis=1)
    used = np.flatnonzero(counts)
    v = (np.arange(_BINS) + 0.5) / _BINS
    colors_of = list(zip(suggestions.by_intensity, _colors(suggestions), strict=True))
    edges = [one.high for one, _ in colors_of if not one.part][:-1]
    colors = np.array(range_colors(len(edges) + 1))[np.searchsorted(edges, v)]
    ax.barh(v, np.sqrt(counts / counts.max()), 1 / _BINS, color=colors, lw=0)
    ax.set(xlim=(0, 1.28), ylim=(max(used[0] / _BINS - 0.03, 0), min((used[-1] + 1) / _BINS + 0.03, 1)))
    for edge in edges:
        ax.axhline(edge, color=page.TEXT_COLOR, lw=0.9)
        ax.text(
            1.27, edge, f"{edge:.7g}", size=8, weight="bold", color=page.TEXT_COLOR, ha="right", va="bottom"
        )
    for one, color in colors_of:
        if one.part:
            ax.axhline(one.high if one.low == 0 else one.low, color=color, lw=1.2, ls=(0, (3, 2)))
    ax.set_xticks([])
    ax.tick_params(labelsize=7, colors=page.CAPTION_COLOR, length=2.5)
    ax.set_ylabel("v", size=8, color=page.CAPTION_COLOR, rotation=0, labelpad=6)
    ax.set_xlabel("area (root)", size=7, color=page.CAPTION_COLOR)
    if suggestions.source.axis is not None:
        _draw_values(ax, suggestions.source.axis)
    page.draw_spines(ax)


def _draw_values(ax: Any, axis: ValueAxis) -> None:
    """Draw the same axis in values, on the right."""
    ends = np.asarray(axis.values(ax.get_ylim()))
    if not np.isfinite(ends).all() or ends[0] == ends[1]:  # a damaged file may say anything of its scale
        return
    other = ax.twinx()
    other.set_ylim(ends)
    other.tick_params(labelsize=7, colors=page.CAPTION_COLOR, length=2.5)
    other.ticklabel_format(useOffset=False)
    other.set_title(axis.unit or "value", size=7, color=page.CAPTION_COLOR, loc="right", pad=3)
    for side in other.spines.values():
        side.set_visible(False)


def _legend_height(suggestions: Suggestions) -> float:
    lines = sum(1 + bool(one.values_text) * _SMALL for one in suggestions.ranges)
    return _LINE_IN * max(lines, 1) + 0.1 + (0 if suggestions.source.axis is None else _TITLE_IN)


def _write_legend(figure: Any, x: float, suggestions: Suggestions) -> None:
    """Write the result of each range, the brightest first as in the histogram."""
    page_in = figure.get_figheight()
    y = 1 - (_HEAD_IN + 0.02) / page_in
    if not suggestions.ranges:
        figure.text(x, y, "one class: no range to choose", size=8, color=page.TEXT_COLOR, va="top")
    colored = zip(suggestions.by_intensity, _colors(suggestions), strict=True)
    for chosen, color in sorted(colored, key=lambda pair: pair[0].range)[::-1]:
        figure.text(x, y, "◆" if chosen.part else "■", size=10, color=color, va="top")
        count = f"{chosen.regions_text} region{'s' if chosen.regions != 1 else ''}"
        first = (0.2, str(chosen).replace(",", " to "), "left")  # inches from the left, text, and alignment
        for x_in, text, side in (first, (1.65, f"{chosen.share:.1%}", "right"), (_PLOT_IN, count, "right")):
            figure.text(x + x_in / _WIDTH_IN, y, text, size=8, color=page.TEXT_COLOR, va="top", ha=side)
        y -= _LINE_IN / page_in
        if chosen.values_text:
            figure.text(
                x + 0.2 / _WIDTH_IN, y, chosen.values_text, size=7, color=page.CAPTION_COLOR, va="top"
            )
            y -= _SMALL * _LINE_IN / page_in
