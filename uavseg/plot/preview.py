"""Preview: a raster with the results drawn over it as layers, written as PNG."""

import os
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from uavseg.arrays import Path_
from uavseg.dataclass import dataclass
from uavseg.execution.executors import decided, phase
from uavseg.flight.mission.mission import Mission
from uavseg.jobs.source.inputs import keep_inputs
from uavseg.occupancy.map_file import open_map, stretch_of
from uavseg.occupancy.paths.find_path import PlannedPath
from uavseg.occupancy.ros.ros_map import is_ros_map
from uavseg.plain_text import printable
from uavseg.plot.layers import mission_layer
from uavseg.plot.layers.raster_layers import AnyStretch, LabelsLayer, LeavesLayer, StatesLayer, draw_raster
from uavseg.plot.layers.region_layer import LevelsLayer, RegionLayer
from uavseg.plot.page import page
from uavseg.raster.collar.find import check_collar
from uavseg.raster.grid.tiling import TilePass, Window
from uavseg.raster.intensity.stretch import Stretch, StretchSpec, fit_stretch
from uavseg.raster.read.dataset import Dataset, DatasetOverview
from uavseg.regions.sample.place import Disc, sample_mask
from uavseg.regions.table import Regions

_WIDTH_IN, _HEAD_IN, _FOOT_IN, _MARGIN_IN = 9.0, 0.62, 0.34, 0.15  # the page; text keeps its size on it
_MIN_HEIGHT_IN, _MAX_HEIGHT_IN = 2.6, 13.0
_ANSWER_IN, _ANSWER_DPI = 5.0, 160  # width of the raster under each of several answers
_PLACE_IN, _AROUND = 6.0, 4  # width of the picture of a disc, whose surroundings are so many times as wide
_MAX_FITTED = 1024  # rows and columns to which its stretch is fitted


def preview(
    raster: Any,
    out: Path_,
    regions: Any = None,
    mission: Mission | Path_ | Sequence[Mission | Path_] | None = None,
    *,
    levels: Any = None,
    states: Dataset | Path_ | None = None,
    leaves: Path_ | None = None,
    labels: Dataset | Path_ | None = None,
    path: PlannedPath | Path_ | None = None,
    stretch: Stretch | StretchSpec | str = "auto",
    collar: str = "auto",
    width_px: int = 1400,
    overwrite: bool = False,
) -> Path:
    """Draw a raster with results over it, and write the picture as PNG.

    However large the raster is, no more of it is read than the picture can show, and the stretch is
    fitted on that. In a map of probabilities free cells are black and occupied cells white.

    Parameters
    ----------
    raster : Dataset, path or sequence of paths
        Several paths form one mosaic; the YAML file of a ROS map is a raster too.
    out : path
        The picture, .png.
    regions, mission, levels, states, leaves, labels, path : optional
        As of `uavseg.preview`; states and labels may be a Dataset too. Without a raster, see
        `uavseg.plot.preview_missions`.
    stretch : Stretch, StretchSpec or str
        With "auto", a raster under states or a path is a map of probabilities, which is not stretched.
    collar : {"auto", "keep"}
        Whether an untagged black or white collar is left out, with a warning, or is drawn. A map of
        probabilities has none.
    width_px, overwrite
        As `width` and `overwrite` of `uavseg.preview`.

    Raises
    ------
    OutputError
        If the picture exists, cannot be written there, or does not end in .png.
    ParameterError, RasterError, RegionError, PathError, MissionError
        If an input cannot be read or does not belong to the raster.
    """
    page.check_width(width_px)
    target = page.check_png_target(out, overwrite)
    inputs = [regions, mission, levels, _paths_of(states), leaves, _paths_of(labels), path]
    keep_inputs([target], [_paths_of(raster), *inputs])
    is_map = states is not None or path is not None
    dataset, grey = _open_raster(raster, stretch, is_map)
    collar = "keep" if is_map else check_collar(collar)
    frame = page.Frame(dataset.geobox, dataset.local_metres)
    with phase("layers"):
        sources = {"levels": levels, "states": states, "leaves": leaves, "labels": labels, "regions": regions}
        layers = make_layers(frame, 2 * width_px, mission, **sources, path=path)
    with phase("picture"):
        figure = _figure(dataset, frame, grey, collar, layers, width_px / _WIDTH_IN)
        page.save_figure(figure, target, overwrite)
    return target


def draw_answers(
    dataset: Dataset,
    out: Path_,
    answers: Mapping[str, Regions],
    stretch: AnyStretch = "auto",
    overwrite: bool = False,
) -> None:
    """Draw the regions of several answers over a raster, beside each other under their names, as PNG.

    OutputError if the picture may not be written.
    """
    target = page.check_png_target(out, overwrite)
    frame = page.Frame(dataset.geobox, dataset.local_metres)
    view = _view(frame, ())
    height = _height(view, _ANSWER_IN)
    page_in, step = height + _HEAD_IN + _MARGIN_IN, _ANSWER_IN + _MARGIN_IN
    width = step * len(answers) + _MARGIN_IN
    figure = page.new_figure(width, page_in, _ANSWER_DPI)
    for k, (name, regions) in enumerate(answers.items()):
        left, layer = _MARGIN_IN + k * step, RegionLayer.of(regions, frame)
        box = (left / width, _MARGIN_IN / page_in, _ANSWER_IN / width, height / page_in)
        _draw_map(figure.add_axes(box), view, (_ANSWER_IN, height), dataset, frame, stretch, "keep", [layer])
        found = " · ".join(layer.title_parts(dataset.in_metres))
        page.write_text(figure, left / width, name, found)
    page.save_figure(figure, target, overwrite)


@dataclass(frozen=True)
class PlacePicture:
    """PNG of the surroundings of a disc, drawn anew for each; OutputError if it may not be written."""

    out: Path_
    overwrite: bool = False  # whether a picture that is there before the first may be replaced

    def __post_init__(self) -> None:
        page.check_png_target(self.out, self.overwrite)

    def draw(self, dataset: Dataset, disc: Disc, stretch: AnyStretch = "auto") -> None:
        """Draw a disc in the colours of a dataset of three bands, or on its grey."""
        place, shape = sample_mask(disc, dataset.geobox), dataset.geobox.shape
        window = place.window.grown(_AROUND * max(place.window.rows, place.window.cols)).clipped(shape)
        inside = np.zeros((window.rows, window.cols), bool)
        inside[place.window.relative_to(window).slices] = place.mask
        coarse = DatasetOverview.of(dataset, _MAX_FITTED)
        fitted = fit_stretch(coarse, stretch, TilePass([Window(0, 0, *coarse.geobox.shape)]))
        picture = fitted.colored(*dataset.read(window)).transpose(1, 2, 0)
        figure = page.new_figure(_PLACE_IN, _PLACE_IN * window.rows / window.cols, dpi=100)
        ax = figure.add_axes((0, 0, 1, 1))
        ax.set_axis_off()
        ax.imshow(picture, interpolation="nearest", aspect="auto")
        for color, width in (("black", 4), ("white", 1.5)):
            ax.contour(inside, [0.5], colors=color, linewidths=width)
        page.save_figure(figure, self.out, overwrite=True)


def _paths_of(raster: Any) -> Any:
    return list(raster.paths) if isinstance(raster, Dataset) else raster


def _open_raster(raster: Any, stretch: AnyStretch, is_map: bool) -> tuple[Dataset, AnyStretch]:
    """Open the raster; its stretch is that of a map of probabilities, unless another one is given."""
    if isinstance(raster, str | os.PathLike) and is_ros_map(raster):
        dataset, map_stretch = open_map(raster)
    else:
        dataset = raster if isinstance(raster, Dataset) else Dataset.open(raster)
        if not is_map:
            return dataset, stretch
        map_stretch = stretch_of(dataset)
    return dataset, map_stretch if stretch in ("auto", StretchSpec("auto")) else stretch


class Layer(Protocol):
    """A layer over a raster, in plot coordinates."""

    def draw(self, ax: Any, point: float) -> None:
        """Draw on axes; `point` is the length of one point (1/72 inch) in plot coordinates."""

    def title_parts(self, has_crs: bool) -> list[str]:
        """Return parts of the title; lengths and areas are in metres if there is a CRS."""


def make_layers(frame: page.Frame, max_side: int, mission: Any = None, **sources: Any) -> list[Layer]:
    """Read the layers that have a source, the lowest first; sources are as of `preview`.

    Rasters are read with at most `max_side` rows and columns.
    """
    flights = [] if mission is None else mission_layer.read_missions(mission)
    readers: dict[str, Callable[[Any, page.Frame], Layer]] = {
        "levels": LevelsLayer.of,
        "states": partial(StatesLayer.of, max_side=max_side),
        "leaves": partial(LeavesLayer.of, max_side=max_side),
        "labels": partial(LabelsLayer.of, max_side=max_side),
        "regions": RegionLayer.of,
        "path": mission_layer.PathLayer.of,
    }
    layers = [read(sources[name], frame) for name, read in readers.items() if sources.get(name) is not None]
    fences = [mission_layer.FenceLayer.of([flight for _, flight in flights], frame)] if flights else []
    return [*layers, *fences, *mission_layer.mission_layers(flights, frame)]


def _figure(
    dataset: Dataset, frame: page.Frame, stretch: AnyStretch, collar: str, layers: Sequence[Layer], dpi: float
) -> Any:
    view = _view(frame, layers)
    width = _WIDTH_IN - 2 * _MARGIN_IN
    height = _height(view, width)
    page_in = height + _HEAD_IN + _FOOT_IN
    figure = page.new_figure(_WIDTH_IN, page_in, dpi)
    ax = figure.add_axes((_MARGIN_IN / _WIDTH_IN, _FOOT_IN / page_in, width / _WIDTH_IN, height / page_in))
    drawn = _draw_map(ax, view, (width, height), dataset, frame, stretch, collar, layers)
    decided("%s, %s", dataset.band_names, drawn)
    page.draw_legend(ax)
    others = len(dataset.paths) - 1
    title = printable(dataset.source + (f" and {others} more" if others else ""))
    subtitle = " · ".join(_title_parts(layers, dataset.in_metres))
    caption = page.raster_caption(dataset.geobox, dataset.band_names, drawn, dataset.local_metres)
    page.write_text(figure, _MARGIN_IN / _WIDTH_IN, title, subtitle, caption, 0.12)
    return figure


def _height(view: page.View, width: float) -> float:
    """Return the height of a map of this width in inches."""
    left, right, bottom, top = view
    return min(max(width * (top - bottom) / (right - left), _MIN_HEIGHT_IN), _MAX_HEIGHT_IN)


def _draw_map(
    ax: Any,
    view: page.View,
    size: tuple[float, float],
    dataset: Dataset,
    frame: page.Frame,
    stretch: AnyStretch,
    collar: str,
    layers: Sequence[Layer],
) -> str:
    """Draw a raster and layers on axes of this width and height; return how the raster is drawn."""
    point = page.fit_axes(ax, view, *size)
    drawn = draw_raster(ax, dataset, frame, stretch, collar)
    for layer in layers:
        layer.draw(ax, point)
    page.draw_furniture(ax, frame, point)
    return drawn


def _view(frame: page.Frame, layers: Sequence[Layer]) -> page.View:
    """Return the view of the raster, and of a mission up to half a raster outside."""
    corners = frame.corners
    low, high = corners.min(axis=0), corners.max(axis=0)
    flights = [layer.path for layer in layers if isinstance(layer, mission_layer.MissionLayer)]
    if flights:
        reach, path = (high - low) / 2, np.concatenate(flights)
        near = np.clip(path[np.isfinite(path).all(axis=1)], low - reach, high + reach)
        low, high = np.minimum(low, near.min(axis=0)), np.maximum(high, near.max(axis=0))
    margin = 0.02 * float((high - low).max())
    return low[0] - margin, high[0] + margin, low[1] - margin, high[1] + margin


def _title_parts(layers: Sequence[Layer], has_crs: bool) -> list[str]:
    flights = [layer for layer in layers if isinstance(layer, mission_layer.MissionLayer)]
    others = [layer for layer in layers if not isinstance(layer, mission_layer.MissionLayer)]
    parts = [text for layer in others for text in layer.title_parts(has_crs)]
    return [*parts, *(mission_layer.mission_title(flights) if flights else [])] or ["the raster alone"]
