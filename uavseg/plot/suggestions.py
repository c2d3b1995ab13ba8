"""Picture of suggested ranges: their cells or pixels in colour on the map, beside the histogram."""

import os
from pathlib import Path
from typing import Any

import numpy as np

from uavseg.jobs.source.inputs import keep_inputs
from uavseg.jobs.suggestions import Suggestion, Suggestions
from uavseg.output.atomic import atomic_file
from uavseg.plot.layers.range_layer import (
    BRIGHT_PART_COLOR,
    DARK_PART_COLOR,
    RangeLayer,
    draw_cells,
    range_colors,
)
from uavseg.plot.layers.raster_layer import draw_raster
from uavseg.plot.page.frame import Frame
from uavseg.plot.page.map_furniture import TEXT_COLOR, draw_north_arrow, draw_scale_bar
from uavseg.plot.page.page import (
    CAPTION_COLOR,
    check_png_target,
    fit_axes,
    new_figure,
    raster_caption,
    save_figure,
)
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.read.overview import DatasetOverview
from uavseg.raster.spectral.value_scale import ValueAxis

_WIDTH_IN, _MAP_IN, _PLOT_IN = 10.0, 6.3, 2.6  # the page, the raster and the histogram
_VALUES_IN = 0.55  # the axis of values beside the histogram
_HEAD_IN, _FOOT_IN, _MARGIN_IN, _LINE_IN = 0.42, 0.34, 0.15, 0.2
_SMALL, _TITLE_IN = 0.8, 0.14  # a line of values, as a share of a line; the title of their axis
_MIN_PLOT_IN, _MAX_HEIGHT_IN = 2.0, 11.0
_WIDTH_PX = 1600
_MAX_PIXELS = 2 * _WIDTH_PX
_BINS = 256


def draw_suggestions(
    found: Suggestions, out: str | os.PathLike[str], dataset: Dataset | None = None, overwrite: bool = False
) -> Path:
    """Draw the ranges in colour over the raster in grey, beside the histogram with their bounds, as PNG.

    Parameters
    ----------
    found : Suggestions
    out : path
        The picture, .png.
    dataset : Dataset, optional
        The raster; without it, the cells of the block map are drawn instead.
    overwrite : bool
        Whether an existing picture may be replaced.

    Raises
    ------
    OutputError
        If the picture exists, cannot be written there, or does not end in .png.
    """
    target = check_png_target(out, overwrite)
    keep_inputs([target], dataset.paths if dataset is not None else ())
    figure = _figure(found, dataset)
    with atomic_file(target, overwrite) as temporary:
        save_figure(figure, temporary)
    return target


def _figure(found: Suggestions, dataset: Dataset | None) -> Any:
    source = found.source
    frame = Frame(source.geobox, source.in_metres and source.geobox.crs is None)
    view, height = _view(frame, _MIN_PLOT_IN + _legend_height(found))
    page = height + _HEAD_IN + _FOOT_IN
    figure = new_figure(_WIDTH_IN, page, _WIDTH_PX / _WIDTH_IN)
    ax = figure.add_axes((_MARGIN_IN / _WIDTH_IN, _FOOT_IN / page, _MAP_IN / _WIDTH_IN, height / page))
    point = fit_axes(ax, view, _MAP_IN, height)
    _draw_map(ax, point, frame, found, dataset)
    left = _WIDTH_IN - _MARGIN_IN - _PLOT_IN
    plot = figure.add_axes(
        (
            left / _WIDTH_IN,
            (_FOOT_IN + 0.1) / page,
            (_PLOT_IN - (0 if found.source.axis is None else _VALUES_IN)) / _WIDTH_IN,
            (height - 0.1 - _legend_height(found)) / page,
        )
    )
    _draw_histogram(plot, found)
    _write_legend(figure, left / _WIDTH_IN, found)
    x, about = _MARGIN_IN / _WIDTH_IN, found.source
    figure.text(x, 1 - 0.12 / page, about.name, size=12, weight="bold", color=TEXT_COLOR, va="top")
    caption = raster_caption(about.geobox, about.band_names, about.stretch.name)
    figure.text(x, 0.12 / page, caption, size=7.5, color=CAPTION_COLOR, va="bottom")
    return figure


def _view(frame: Frame, min_height: float) -> tuple[tuple[float, float, float, float], float]:
    """left, right, bottom, top in plot coordinates, and the height of the map in inches."""
    margin = 0.02 * float(np.ptp(frame.corners, axis=0).max())
    left, bottom = (float(end) - margin for end in frame.corners.min(axis=0))
    right, top = (float(end) + margin for end in frame.corners.max(axis=0))
    height = _MAP_IN * (top - bottom) / (right - left)
    return (left, right, bottom, top), min(max(height, min_height), _MAX_HEIGHT_IN)


def _draw_map(ax: Any, point: float, frame: Frame, found: Suggestions, dataset: Dataset | None) -> None:
    counts = found.blocks.counts
    if dataset is not None:
        draw_raster(ax, dataset, frame, found.source.stretch)
    else:
        greys = (found.blocks.sums // np.maximum(counts, 1) >> 8).astype(np.uint8)
        draw_cells(ax, greys, counts > 0, frame, _MAX_PIXELS)
    if found.ranges and found.by_pixel and dataset is not None:
        coarse, ranges = DatasetOverview.of(dataset, _MAX_PIXELS), [one.range for one in found.by_intensity]
        RangeLayer.of_pixels(coarse, found.source.stretch, ranges, _colors(found), frame).draw(ax)
    elif found.ranges:
        seen = found.intervals * (counts > 0)  # a leaf may extend into nodata
        RangeLayer.of(seen, _colors(found), frame, _MAX_PIXELS).draw(ax)
    draw_scale_bar(ax, frame, point)
    draw_north_arrow(ax, frame, point)


def _colors(found: Suggestions) -> list[str]:
    """Colours of the ranges by intensity, parts last."""
    ranges = found.by_intensity
    parts = [DARK_PART_COLOR if one.low == 0 else BRIGHT_PART_COLOR for one in ranges if one.part]
    return range_colors(len(ranges) - len(parts)) + parts


def _draw_histogram(ax: Any, found: Suggestions) -> None:
    """v upwards, the square root of the area to the right, so that rare values stay visible."""
    counts = found.histogram.reshape(_BINS, -1).sum(axis=1)
    held = np.flatnonzero(counts)
    v = (np.arange(_BINS) + 0.5) / _BINS
    colors_of = list(zip(found.by_intensity, _colors(found), strict=True))
    edges = [one.high for one, _ in colors_of if not one.part][:-1]
    colors = np.array(range_colors(len(edges) + 1))[np.searchsorted(edges, v)]
    ax.barh(v, np.sqrt(counts / counts.max()), 1 / _BINS, color=colors, lw=0)
    ax.set(xlim=(0, 1.28), ylim=(max(held[0] / _BINS - 0.03, 0), min((held[-1] + 1) / _BINS + 0.03, 1)))
    for edge in edges:
        ax.axhline(edge, color=TEXT_COLOR, lw=0.9)
        ax.text(1.27, edge, f"{edge:.7g}", size=8, weight="bold", color=TEXT_COLOR, ha="right", va="bottom")
    for one, color in colors_of:
        if one.part:
            ax.axhline(one.high if one.low == 0 else one.low, color=color, lw=1.2, ls=(0, (3, 2)))
    ax.set_xticks([])
    ax.tick_params(labelsize=7, colors=CAPTION_COLOR, length=2.5)
    ax.set_ylabel("v", size=8, color=CAPTION_COLOR, rotation=0, labelpad=6)
    ax.set_xlabel("area (root)", size=7, color=CAPTION_COLOR)
    if found.source.axis is not None:
        _draw_values(ax, found.source.axis)
    for side in ax.spines.values():
        side.set(color="#bbbbbb", lw=0.6)


def _draw_values(ax: Any, axis: ValueAxis) -> None:
    """The same axis in values, on the right."""
    ends = np.asarray(axis.values(ax.get_ylim()))
    if not np.isfinite(ends).all() or ends[0] == ends[1]:  # a damaged file may say anything of its scale
        return
    other = ax.twinx()
    other.set_ylim(ends)
    other.tick_params(labelsize=7, colors=CAPTION_COLOR, length=2.5)
    other.ticklabel_format(useOffset=False)
    other.set_title(axis.unit or "value", size=7, color=CAPTION_COLOR, loc="right", pad=3)
    for side in other.spines.values():
        side.set_visible(False)


def _legend_height(found: Suggestions) -> float:
    lines = sum(1 + bool(one.values_text) * _SMALL for one in found.ranges)
    return _LINE_IN * max(lines, 1) + 0.1 + (0 if found.source.axis is None else _TITLE_IN)


def _write_legend(figure: Any, x: float, found: Suggestions) -> None:
    """Write the result of each range, the brightest first as in the histogram."""
    page = figure.get_figheight()
    y = 1 - (_HEAD_IN + 0.02) / page
    if not found.ranges:
        figure.text(x, y, "one class: no range to choose", size=8, color=TEXT_COLOR, va="top")
    colored = sorted(zip(found.by_intensity, _colors(found), strict=True), key=lambda pair: pair[0].range)
    for chosen, color in reversed(colored):
        figure.text(x, y, "◆" if chosen.part else "■", size=10, color=color, va="top")
        for place, text, side in _columns(chosen):
            figure.text(x + place / _WIDTH_IN, y, text, size=8, color=TEXT_COLOR, va="top", ha=side)
        y -= _LINE_IN / page
        if chosen.values_text:
            figure.text(x + 0.2 / _WIDTH_IN, y, chosen.values_text, size=7, color=CAPTION_COLOR, va="top")
            y -= _SMALL * _LINE_IN / page


def _columns(chosen: Suggestion) -> list[tuple[float, str, str]]:
    """Inches from the left, text, and alignment of each column."""
    count = f"{chosen.regions_text} region{'s' if chosen.regions != 1 else ''}"
    return [
        (0.2, str(chosen).replace(",", " to "), "left"),
        (1.65, f"{chosen.share:.1%}", "right"),
        (_PLOT_IN, count, "right"),
    ]
