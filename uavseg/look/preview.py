"""Preview: one picture of a raster with its regions and the mission over them."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from affine import Affine

from uavseg.atomic import check_target, whole_file
from uavseg.errors import OutputError, ParameterError
from uavseg.look.coarse import Coarse
from uavseg.look.frame import Frame
from uavseg.look.furniture import INK, draw_north, draw_scale_bar, length_text
from uavseg.look.missionlayer import MissionLayer
from uavseg.look.regionlayer import RegionLayer
from uavseg.parallel import serial
from uavseg.raster.dataset import Dataset
from uavseg.raster.ground import ground_resolution
from uavseg.raster.stretch import StretchSpec, fit
from uavseg.raster.tiling import Window

if TYPE_CHECKING:
    from uavseg.flight.mission import Mission

WIDTH_IN, HEAD_IN, FOOT_IN, MARGIN_IN = 9.0, 0.62, 0.34, 0.15  # the page; text keeps its size on it
LEAST_HEIGHT_IN, MOST_HEIGHT_IN = 2.6, 13.0
POINTS = 72  # per inch
QUIET = "#666666"


def preview(
    raster: Any,
    out: str | os.PathLike[str],
    regions: Any = None,
    mission: "Mission | str | os.PathLike[str] | None" = None,
    *,
    stretch: StretchSpec | str = "auto",
    width_px: int = 1400,
    overwrite: bool = False,
) -> Path:
    """Draw a raster in grey, with regions and a mission if there are, and write it as a PNG.

    However large the raster is, no more of it is read than the picture can show, and the stretch is
    fitted on that.

    Parameters
    ----------
    raster : Dataset, path or sequence of paths
        Many paths are one mosaic.
    out : path
        The picture, .png.
    regions : path or GeoDataFrame, optional
    mission : Mission or path, optional
        A path to a .plan or .waypoints file.
    stretch : StretchSpec or str
    width_px : int
        Width of the picture, 200 to 8000 pixels.
    overwrite : bool
        Whether a picture that is there may be replaced.

    Returns
    -------
    out : Path

    Raises
    ------
    OutputError
        If the picture is there already, cannot be written there, or is not called .png.
    ParameterError, RasterError, RegionError, MissionError
        If what is to be drawn cannot be.
    """
    if not 200 <= width_px <= 8000:
        raise ParameterError(f"a picture is 200 to 8000 pixels wide, not {width_px}")
    if Path(out).suffix.lower() != ".png":
        raise OutputError(f"a preview is a PNG picture; call it {Path(out).stem}.png, not {Path(out).name}")
    target = check_target(out, overwrite)
    dataset = raster if isinstance(raster, Dataset) else Dataset.open(raster)
    frame = Frame(dataset.geobox)
    shapes = None if regions is None else RegionLayer.of(regions, frame)
    flight = None if mission is None else MissionLayer.of(mission, frame)
    figure = _figure(dataset, frame, stretch, shapes, flight, width_px / WIDTH_IN)
    with whole_file(target, overwrite) as temporary:
        figure.savefig(temporary, metadata={"Software": "uavseg"})
    return target


def _figure(
    dataset: Dataset,
    frame: Frame,
    stretch: StretchSpec | str,
    shapes: RegionLayer | None,
    flight: MissionLayer | None,
    dpi: float,
) -> Any:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    view = _view(frame, flight)
    width, height = WIDTH_IN - 2 * MARGIN_IN, _height(view)
    page = height + HEAD_IN + FOOT_IN
    figure = Figure(figsize=(WIDTH_IN, page), dpi=dpi, facecolor="white")
    FigureCanvasAgg(figure)
    ax = figure.add_axes((MARGIN_IN / WIDTH_IN, FOOT_IN / page, width / WIDTH_IN, height / page))
    unit = _fit_axes(ax, view, width, height)
    grey_name = _draw_raster(ax, dataset, frame, stretch)
    for layer in (shapes, flight):
        if layer is not None:
            layer.draw(ax, unit)
    draw_scale_bar(ax, frame, unit)
    draw_north(ax, frame, unit)
    if flight is not None:
        ax.legend(loc="lower right", fontsize=7, framealpha=0.8, borderpad=0.6).set_zorder(10)
    _write_around(figure, dataset, grey_name, shapes, flight)
    return figure


def _view(frame: Frame, flight: MissionLayer | None) -> tuple[float, float, float, float]:
    """left, right, bottom, top on the sheet: the raster, and a mission up to half a raster beyond it."""
    corners = frame.corners
    low, high = corners.min(axis=0), corners.max(axis=0)
    if flight is not None:
        reach = (high - low) / 2
        near = flight.path[np.isfinite(flight.path).all(axis=1)]
        near = np.clip(near, low - reach, high + reach)
        low, high = np.minimum(low, near.min(axis=0)), np.maximum(high, near.max(axis=0))
    margin = 0.02 * float((high - low).max())
    return low[0] - margin, high[0] + margin, low[1] - margin, high[1] + margin


def _height(view: tuple[float, float, float, float]) -> float:
    left, right, bottom, top = view
    height = (WIDTH_IN - 2 * MARGIN_IN) * (top - bottom) / (right - left)
    return min(max(height, LEAST_HEIGHT_IN), MOST_HEIGHT_IN)


def _fit_axes(ax: Any, view: tuple[float, float, float, float], width: float, height: float) -> float:
    """Show the view, centred; returns the length on the sheet of one point."""
    left, right, bottom, top = view
    unit = max((right - left) / width, (top - bottom) / height) / POINTS
    x, y = (left + right) / 2, (bottom + top) / 2
    ax.set_xlim(x - unit * POINTS * width / 2, x + unit * POINTS * width / 2)
    ax.set_ylim(y - unit * POINTS * height / 2, y + unit * POINTS * height / 2)
    ax.set(xticks=[], yticks=[], autoscale_on=False)
    for side in ax.spines.values():
        side.set(color="#bbbbbb", lw=0.6)
    return unit


def _draw_raster(ax: Any, dataset: Dataset, frame: Frame, stretch: StretchSpec | str) -> str:
    """Grey where pixels are valid, hatched where they are not; returns the name of the stretch."""
    from matplotlib.patches import Polygon
    from matplotlib.transforms import Affine2D

    coarse = Coarse.of(dataset, _most_pixels(ax))
    window = Window(0, 0, *coarse.geobox.shape)
    fitted = fit(coarse, stretch, serial, [window])
    values, valid = coarse.read(window)
    picture = np.full((window.rows, window.cols, 4), 255, np.uint8)
    picture[..., :3] = (fitted.apply(values, valid) >> 8).astype(np.uint8)[..., None]
    if valid is not None:
        picture[..., 3] = np.where(valid, 255, 0)
        ax.add_patch(Polygon(frame.corners, fc="#f4f4f4", ec="#cfcfcf", hatch="////", lw=0, zorder=1))
    t = frame.affine * coarse.geobox.transform
    image = ax.imshow(
        picture,
        extent=(0, window.cols, window.rows, 0),
        transform=Affine2D.from_values(t.a, t.d, t.b, t.e, t.c, t.f) + ax.transData,
        interpolation="nearest" if _is_enlarged(ax, t) else "antialiased",
        aspect="auto",
        zorder=2,
    )
    image.set_clip_path(ax.patch)
    return fitted.name


def _most_pixels(ax: Any) -> int:
    box = ax.get_window_extent()
    return int(2 * max(box.width, box.height))


def _is_enlarged(ax: Any, transform: Affine) -> bool:
    """Whether a pixel of the raster is larger than two of the picture."""
    left, right = ax.get_xlim()
    return bool(abs(transform.determinant) ** 0.5 > 2 * (right - left) / ax.get_window_extent().width)


def _write_around(
    figure: Any, dataset: Dataset, grey_name: str, shapes: RegionLayer | None, flight: MissionLayer | None
) -> None:
    """Title above, what the raster is below."""
    page = figure.get_figheight()
    x, more = MARGIN_IN / WIDTH_IN, len(dataset.paths) - 1
    title = dataset.source + (f" and {more} more" if more else "")
    figure.text(x, 1 - 0.14 / page, title, size=12, weight="bold", color=INK, va="top")
    figure.text(
        x,
        1 - 0.37 / page,
        " · ".join(_counts(shapes, flight, dataset.geobox.crs is not None)),
        size=9,
        color=INK,
        va="top",
    )
    figure.text(x, 0.12 / page, " · ".join(_about(dataset, grey_name)), size=7.5, color=QUIET, va="bottom")


def _counts(shapes: RegionLayer | None, flight: MissionLayer | None, on_globe: bool) -> list[str]:
    found = []
    if shapes is not None:
        found.append(f"{len(shapes.ids)} region{'s' if len(shapes.ids) != 1 else ''}")
        if on_globe and shapes.area_m2 is not None:
            found.append(area_text(shapes.area_m2))
    if flight is not None:
        minutes = max(round(flight.duration_s / 60), 1)
        found.append(
            f"mission of {flight.items} items, {flight.distance_m / 1000:.2g} km, about {minutes} min"
        )
    return found or ["the raster alone"]


def area_text(area_m2: float) -> str:
    """An area for people.

    Examples
    --------
    >>> area_text(512.3), area_text(29000.0), area_text(31e6)
    ('512 m²', '2.9 ha', '31 km²')
    """
    if area_m2 < 10_000:
        return f"{area_m2:.0f} m²"
    return f"{area_m2 / 1e4:.3g} ha" if area_m2 < 1e7 else f"{area_m2 / 1e6:.3g} km²"


def _about(dataset: Dataset, grey_name: str) -> list[str]:
    box = dataset.geobox
    rows, cols = box.shape
    found = [f"{cols} x {rows} pixels"]
    if box.crs is None:
        found.append("no coordinate reference system")
    else:
        epsg = box.crs.to_epsg()
        across, _ = ground_resolution(box)
        found += [
            f"EPSG:{epsg}" if epsg else "custom CRS",
            f"{length_text(float(f'{across:.3g}'), 'm')}/pixel",
        ]
    return [*found, dataset.band_names, f"grey: {grey_name}"]
