"""Suggested ranges in one look: where they are, and where they cut the histogram."""

import os
from pathlib import Path
from typing import Any

import numpy as np

from uavseg.atomic import atomic_file
from uavseg.jobs.suggest import Suggestion, Suggestions
from uavseg.plot.frame import Frame
from uavseg.plot.layers.range_layer import RangeLayer, colors_of, draw_cells
from uavseg.plot.layers.raster_layer import draw_raster
from uavseg.plot.map_furniture import INK, draw_north, draw_scale_bar
from uavseg.plot.page import QUIET, about_raster, check_picture, fit_axes, new_figure, save_figure
from uavseg.raster.dataset import Dataset

WIDTH_IN, MAP_IN, PLOT_IN = 10.0, 6.3, 2.6  # the page, the raster and the histogram
HEAD_IN, FOOT_IN, MARGIN_IN, LINE_IN = 0.42, 0.34, 0.15, 0.2
LEAST_PLOT_IN, MOST_HEIGHT_IN = 2.0, 11.0
WIDTH_PX = 1600
MOST_PIXELS = 2 * WIDTH_PX
BINS = 256


def draw_suggestions(
    found: Suggestions, out: str | os.PathLike[str], dataset: Dataset | None = None, overwrite: bool = False
) -> Path:
    """Draw the ranges in colours over the raster in grey, beside the histogram with its cuts; as a PNG.

    Parameters
    ----------
    found : Suggestions
    out : path
        The picture, .png.
    dataset : Dataset, optional
        The raster; without it, the cells of the block map are drawn in its place.
    overwrite : bool
        Whether a picture that is there may be replaced.

    Raises
    ------
    OutputError
        If the picture is there already, cannot be written there, or is not called .png.
    """
    target = check_picture(out, overwrite)
    figure = _figure(found, dataset)
    with atomic_file(target, overwrite) as temporary:
        save_figure(figure, temporary)
    return target


def _figure(found: Suggestions, dataset: Dataset | None) -> Any:
    frame = Frame(found.source.geobox)
    view, height = _view(frame, LEAST_PLOT_IN + _legend_in(found))
    page = height + HEAD_IN + FOOT_IN
    figure = new_figure(WIDTH_IN, page, WIDTH_PX / WIDTH_IN)
    ax = figure.add_axes((MARGIN_IN / WIDTH_IN, FOOT_IN / page, MAP_IN / WIDTH_IN, height / page))
    unit = fit_axes(ax, view, MAP_IN, height)
    _draw_map(ax, unit, frame, found, dataset)
    left = WIDTH_IN - MARGIN_IN - PLOT_IN
    plot = figure.add_axes(
        (
            left / WIDTH_IN,
            (FOOT_IN + 0.1) / page,
            PLOT_IN / WIDTH_IN,
            (height - 0.1 - _legend_in(found)) / page,
        )
    )
    _draw_histogram(plot, found)
    _write_legend(figure, left / WIDTH_IN, found)
    x, about = MARGIN_IN / WIDTH_IN, found.source
    figure.text(x, 1 - 0.12 / page, about.name, size=12, weight="bold", color=INK, va="top")
    told = about_raster(about.geobox, about.band_names, about.stretch.name)
    figure.text(x, 0.12 / page, told, size=7.5, color=QUIET, va="bottom")
    return figure


def _view(frame: Frame, least: float) -> tuple[tuple[float, float, float, float], float]:
    """left, right, bottom, top on the sheet, and the height of the picture in inches."""
    margin = 0.02 * float(np.ptp(frame.corners, axis=0).max())
    left, bottom = (float(end) - margin for end in frame.corners.min(axis=0))
    right, top = (float(end) + margin for end in frame.corners.max(axis=0))
    height = MAP_IN * (top - bottom) / (right - left)
    return (left, right, bottom, top), min(max(height, least), MOST_HEIGHT_IN)


def _draw_map(ax: Any, unit: float, frame: Frame, found: Suggestions, dataset: Dataset | None) -> None:
    counts = found.blocks.counts
    if dataset is not None:
        draw_raster(ax, dataset, frame, found.source.stretch)
    else:
        greys = (found.blocks.sums // np.maximum(counts, 1) >> 8).astype(np.uint8)
        draw_cells(ax, greys, counts > 0, frame, MOST_PIXELS)
    if found.ranges:
        seen = found.intervals * (counts > 0)  # a leaf may reach into nodata
        RangeLayer.of(seen, len(found.ranges), frame, MOST_PIXELS).draw(ax)
    draw_scale_bar(ax, frame, unit)
    draw_north(ax, frame, unit)


def _draw_histogram(ax: Any, found: Suggestions) -> None:
    """v upwards, area to the right; the root of it, so that what is rare is seen beside what is common."""
    counts = found.histogram.reshape(BINS, -1).sum(axis=1)
    held = np.flatnonzero(counts)
    v = (np.arange(BINS) + 0.5) / BINS
    edges = [chosen.high for chosen in found.ranges[:-1]]
    colors = np.array(colors_of(len(edges) + 1))[np.searchsorted(edges, v)]
    ax.barh(v, np.sqrt(counts / counts.max()), 1 / BINS, color=colors, lw=0)
    ax.set(xlim=(0, 1.28), ylim=(max(held[0] / BINS - 0.03, 0), min((held[-1] + 1) / BINS + 0.03, 1)))
    for edge in edges:
        ax.axhline(edge, color=INK, lw=0.9)
        ax.text(1.27, edge, f"{edge:.7g}", size=8, weight="bold", color=INK, ha="right", va="bottom")
    ax.set_xticks([])
    ax.tick_params(labelsize=7, colors=QUIET, length=2.5)
    ax.set_ylabel("v", size=8, color=QUIET, rotation=0, labelpad=6)
    ax.set_xlabel("area (root)", size=7, color=QUIET)
    for side in ax.spines.values():
        side.set(color="#bbbbbb", lw=0.6)


def _legend_in(found: Suggestions) -> float:
    return LINE_IN * max(len(found.ranges), 1) + 0.1


def _write_legend(figure: Any, x: float, found: Suggestions) -> None:
    """What each range would give, the brightest above as in the histogram."""
    page = figure.get_figheight()
    y = 1 - (HEAD_IN + 0.02) / page
    if not found.ranges:
        figure.text(x, y, "one class: no range to choose", size=8, color=INK, va="top")
    for color, chosen in reversed(list(zip(colors_of(len(found.ranges)), found.ranges, strict=True))):
        figure.text(x, y, "■", size=10, color=color, va="top")
        for place, text, side in _columns(chosen):
            figure.text(x + place / WIDTH_IN, y, text, size=8, color=INK, va="top", ha=side)
        y -= LINE_IN / page


def _columns(chosen: Suggestion) -> list[tuple[float, str, str]]:
    """Inches from the left, the text there, and which of its ends is there."""
    count = f"{chosen.regions:,} region{'s' if chosen.regions != 1 else ''}"
    return [
        (0.2, str(chosen).replace(",", " to "), "left"),
        (1.65, f"{chosen.share:.1%}", "right"),
        (PLOT_IN, count, "right"),
    ]
