"""Preview: a raster in grey with the results drawn over it as layers, written as PNG."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from uavseg.errors import ParameterError
from uavseg.execution.phases import decided, phase
from uavseg.jobs.source.inputs import keep_inputs
from uavseg.occupancy.probability_map import open_map, stretch_of
from uavseg.occupancy.ros.ros_map import is_ros_map
from uavseg.output.atomic import atomic_file
from uavseg.plain_text import printable
from uavseg.plot.layers.mission_layer import MissionLayer, mission_title
from uavseg.plot.layers.raster_layer import draw_raster
from uavseg.plot.layers.stack import File, Layer, LayerSources, make_layers
from uavseg.plot.page.frame import Frame
from uavseg.plot.page.map_furniture import TEXT_COLOR, draw_north_arrow, draw_scale_bar
from uavseg.plot.page.page import (
    CAPTION_COLOR,
    check_png_target,
    draw_legend,
    fit_axes,
    new_figure,
    raster_caption,
    save_figure,
)
from uavseg.raster.collar.find import check_collar
from uavseg.raster.intensity.stretch import Stretch, StretchSpec
from uavseg.raster.read.dataset import Dataset

if TYPE_CHECKING:
    from uavseg.flight.mission.mission import Mission
    from uavseg.occupancy.paths.find_path import PlannedPath

_WIDTH_IN, _HEAD_IN, _FOOT_IN, _MARGIN_IN = 9.0, 0.62, 0.34, 0.15  # the page; text keeps its size on it
_MIN_HEIGHT_IN, _MAX_HEIGHT_IN = 2.6, 13.0


def preview(
    raster: Any,
    out: File,
    regions: Any = None,
    mission: "Mission | File | Sequence[Mission | File] | None" = None,
    *,
    levels: Any = None,
    states: Dataset | File | None = None,
    leaves: File | None = None,
    labels: Dataset | File | None = None,
    path: "PlannedPath | File | None" = None,
    stretch: Stretch | StretchSpec | str = "auto",
    collar: str = "auto",
    width_px: int = 1400,
    overwrite: bool = False,
) -> Path:
    """Draw a raster in grey with results over it, and write the picture as PNG.

    However large the raster is, no more of it is read than the picture can show, and the stretch is
    fitted on that. In a map of probabilities free cells are black and occupied cells white.

    Parameters
    ----------
    raster : Dataset, path or sequence of paths
        Several paths form one mosaic; the YAML file of a ROS map is a raster too.
    out : path
        The picture, .png.
    regions : path or GeoDataFrame, optional
    mission : Mission, path or sequence of these, optional
        Flights with their fence, or mission files; without a raster, see `uavseg.plot.preview_missions`.
    levels : path or GeoDataFrame, optional
        Segments with a column `level`, and `range_low` and `range_high` of v: drawn in grey.
    states : Dataset or path, optional
        A raster of states (1 free, 2 unknown, 3 occupied, 0 nothing), or a ROS map of them.
    leaves : path, optional
        The block map of this raster; its leaves are outlined.
    labels : Dataset or path, optional
        A raster of labels, 0 outside of segments; the segments are outlined.
    path : PlannedPath or path, optional
        A .geojson, .plan or .waypoints file.
    stretch : Stretch, StretchSpec or str
        With "auto", a raster under states or a path is a map of probabilities, which is not stretched.
    collar : {"auto", "keep"}
        Whether an untagged black or white collar is left out, with a warning, or is drawn. A map of
        probabilities has none.
    width_px : int
        Width of the picture, 200 to 8000 pixels.
    overwrite : bool
        Whether an existing picture may be replaced.

    Returns
    -------
    out : Path

    Raises
    ------
    OutputError
        If the picture exists, cannot be written there, or does not end in .png.
    ParameterError, RasterError, RegionError, PathError, MissionError
        If an input cannot be read or does not belong to the raster.
    """
    if not 200 <= width_px <= 8000:
        raise ParameterError(f"a picture is 200 to 8000 pixels wide, not {width_px}")
    target = check_png_target(out, overwrite)
    keep_inputs(
        [target],
        [_given(raster), regions, mission, levels, _given(states), leaves, _given(labels), path],
    )
    is_map = states is not None or path is not None
    dataset, grey = _open_raster(raster, stretch, is_map)
    collar = "keep" if is_map else check_collar(collar)
    frame = Frame(dataset.geobox, dataset.local_metres)
    sources = LayerSources(levels, states, leaves, labels, regions, path, mission)
    with phase("layers"):
        layers = make_layers(sources, frame, max_side=2 * width_px)
    with phase("picture"):
        figure = _figure(dataset, frame, (grey, collar), layers, width_px / _WIDTH_IN)
        with atomic_file(target, overwrite) as temporary:
            save_figure(figure, temporary)
    return target


def _given(raster: Any) -> Any:
    """The paths of a raster, however it is given."""
    return list(raster.paths) if isinstance(raster, Dataset) else raster


def _open_raster(
    raster: Any, stretch: Stretch | StretchSpec | str, is_map: bool
) -> tuple[Dataset, Stretch | StretchSpec | str]:
    """The raster and its stretch: that of a map of probabilities, unless another one is given."""
    if isinstance(raster, str | os.PathLike) and is_ros_map(raster):
        dataset, own = open_map(raster)
    else:
        dataset = raster if isinstance(raster, Dataset) else Dataset.open(raster)
        if not is_map:
            return dataset, stretch
        own = stretch_of(dataset)
    return dataset, own if stretch in ("auto", StretchSpec("auto")) else stretch


def _figure(
    dataset: Dataset,
    frame: Frame,
    reading: tuple[Stretch | StretchSpec | str, str],
    layers: Sequence[Layer],
    dpi: float,
) -> Any:
    view = _view(frame, layers)
    width, height = _WIDTH_IN - 2 * _MARGIN_IN, _height(view)
    page = height + _HEAD_IN + _FOOT_IN
    figure = new_figure(_WIDTH_IN, page, dpi)
    ax = figure.add_axes((_MARGIN_IN / _WIDTH_IN, _FOOT_IN / page, width / _WIDTH_IN, height / page))
    point = fit_axes(ax, view, width, height)
    grey_name = draw_raster(ax, dataset, frame, *reading)
    decided("%s, %s", dataset.band_names, grey_name)
    for layer in layers:
        layer.draw(ax, point)
    draw_scale_bar(ax, frame, point)
    draw_north_arrow(ax, frame, point)
    draw_legend(ax)
    _write_title_and_caption(figure, dataset, grey_name, layers)
    return figure


def _view(frame: Frame, layers: Sequence[Layer]) -> tuple[float, float, float, float]:
    """left, right, bottom, top in plot coordinates: the raster, and a mission up to half a raster beyond."""
    corners = frame.corners
    low, high = corners.min(axis=0), corners.max(axis=0)
    flights = [layer.path for layer in layers if isinstance(layer, MissionLayer)]
    if flights:
        reach, path = (high - low) / 2, np.concatenate(flights)
        near = np.clip(path[np.isfinite(path).all(axis=1)], low - reach, high + reach)
        low, high = np.minimum(low, near.min(axis=0)), np.maximum(high, near.max(axis=0))
    margin = 0.02 * float((high - low).max())
    return low[0] - margin, high[0] + margin, low[1] - margin, high[1] + margin


def _height(view: tuple[float, float, float, float]) -> float:
    left, right, bottom, top = view
    height = (_WIDTH_IN - 2 * _MARGIN_IN) * (top - bottom) / (right - left)
    return min(max(height, _MIN_HEIGHT_IN), _MAX_HEIGHT_IN)


def _write_title_and_caption(figure: Any, dataset: Dataset, grey_name: str, layers: Sequence[Layer]) -> None:
    """Write the title above the map and the caption below."""
    page = figure.get_figheight()
    x, more = _MARGIN_IN / _WIDTH_IN, len(dataset.paths) - 1
    title = dataset.source + (f" and {more} more" if more else "")
    figure.text(x, 1 - 0.14 / page, printable(title), size=12, weight="bold", color=TEXT_COLOR, va="top")
    figure.text(
        x,
        1 - 0.37 / page,
        " · ".join(_title_parts(layers, dataset.in_metres)),
        size=9,
        color=TEXT_COLOR,
        va="top",
    )
    figure.text(
        x,
        0.12 / page,
        raster_caption(dataset.geobox, dataset.band_names, grey_name, dataset.local_metres),
        size=7.5,
        color=CAPTION_COLOR,
        va="bottom",
    )


def _title_parts(layers: Sequence[Layer], has_crs: bool) -> list[str]:
    flights = [layer for layer in layers if isinstance(layer, MissionLayer)]
    others = [layer for layer in layers if not isinstance(layer, MissionLayer)]
    parts = [text for layer in others for text in layer.title_parts(has_crs)]
    return [*parts, *(mission_title(flights) if flights else [])] or ["the raster alone"]
