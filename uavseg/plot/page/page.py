"""Page layout shared by all pictures: target file, figure, axes, scale bar, north arrow, text."""

import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from uavseg.errors import OutputError, ParameterError
from uavseg.output.atomic import check_target
from uavseg.plain_text import printable
from uavseg.plot.page.frame import Frame
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import ground_resolution

_POINTS = 72  # per inch
TEXT_COLOR, CAPTION_COLOR, _PAPER_COLOR = "#1a1a1a", "#666666", "#ffffff"

View = tuple[float, float, float, float]
"""left, right, bottom, top in plot coordinates."""


def check_png_target(path: str | os.PathLike[str], overwrite: bool) -> Path:
    """Refuse a path to which a picture may not be written, else return it."""
    if Path(path).suffix.lower() != ".png":
        raise OutputError(f"a preview is a PNG picture; call it {Path(path).stem}.png, not {Path(path).name}")
    return check_target(path, overwrite)


def check_width(width_px: int) -> None:
    """Refuse the width of a picture that is out of bounds."""
    if not 200 <= width_px <= 8000:
        raise ParameterError(f"a picture is 200 to 8000 pixels wide, not {width_px}")


def new_figure(width: float, height: float, dpi: float) -> Any:
    """Make a white page of `width` x `height` inches with `dpi` pixels per inch."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=dpi, facecolor="white")
    figure.set_layout_engine("none")  # whatever the user has set
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Any, path: Path) -> None:
    """Write a page as PNG; equal pages give equal bytes."""
    figure.savefig(path, metadata={"Software": "uavseg"})


def fit_axes(ax: Any, view: View, width: float, height: float) -> float:
    """Fit axes of a size in inches to a view, with equal units in x and y.

    Returns the length of one point (1/72 inch) in plot coordinates.
    """
    left, right, bottom, top = view
    point = max((right - left) / width, (top - bottom) / height) / _POINTS
    x, y = (left + right) / 2, (bottom + top) / 2
    ax.set_xlim(x - point * _POINTS * width / 2, x + point * _POINTS * width / 2)
    ax.set_ylim(y - point * _POINTS * height / 2, y + point * _POINTS * height / 2)
    ax.set(xticks=[], yticks=[], autoscale_on=False)
    draw_spines(ax)
    return point


def draw_spines(ax: Any) -> None:
    """Draw thin grey borders around axes."""
    for spine in ax.spines.values():
        spine.set(color="#bbbbbb", lw=0.6)


def draw_furniture(ax: Any, frame: Frame, point: float) -> None:
    """Draw the map furniture: a scale bar in the lower left corner, a north arrow in the upper right one.

    The scale bar is in ground metres, or in map units where these are not known; without a CRS there is no
    arrow. `point` is the length of one point (1/72 inch) in plot coordinates.
    """
    _draw_scale_bar(ax, frame, point)
    if frame.north is not None:
        _draw_north_arrow(ax, frame.north, point)


def _draw_scale_bar(ax: Any, frame: Frame, point: float) -> None:
    from matplotlib.patches import Rectangle

    (left, right), bottom = ax.get_xlim(), ax.get_ylim()[0]
    local_unit = "px" if frame.geobox.transform.is_identity else "units"
    metres_per_unit, name = (frame.metres_per_unit, "m") if frame.metres_per_unit else (1.0, local_unit)
    length = bar_length((right - left) * metres_per_unit)
    width, height, room = length / metres_per_unit, 5 * point, 7 * point
    x, y = left + 2.4 * room, bottom + 2.4 * room
    back: dict[str, Any] = {"color": _PAPER_COLOR, "alpha": 0.78, "lw": 0, "zorder": 8}
    ax.add_patch(Rectangle((x - room, y - room), width + 2 * room, 4.3 * room, **back))
    for quarter in range(4):
        color = TEXT_COLOR if quarter % 2 == 0 else _PAPER_COLOR
        corner = (x + quarter * width / 4, y)
        ax.add_patch(Rectangle(corner, width / 4, height, fc=color, ec=TEXT_COLOR, lw=0.6, zorder=9))
    centred = {"ha": "center", "va": "bottom", "size": 7.5, "color": TEXT_COLOR, "zorder": 9}
    ax.text(x + width / 2, y + 8 * point, length_text(length, name), **centred)


def _draw_north_arrow(ax: Any, north: tuple[float, float], point: float) -> None:
    from matplotlib.patches import Circle, Polygon

    radius = 17 * point
    middle = np.array([ax.get_xlim()[1] - 1.5 * radius, ax.get_ylim()[1] - 1.5 * radius])
    ahead = np.array(north) * radius
    aside = np.array([-ahead[1], ahead[0]]) * 0.34
    tip, notch, tail = middle + 0.16 * ahead, middle - 0.5 * ahead, middle - 0.8 * ahead
    ax.add_patch(Circle(tuple(middle), radius, color=_PAPER_COLOR, alpha=0.78, lw=0, zorder=8))
    ax.add_patch(Polygon([tip, tail + aside, notch, tail - aside], color=TEXT_COLOR, lw=0, zorder=9))
    centred = {"ha": "center", "va": "center", "size": 7, "weight": "bold", "color": TEXT_COLOR, "zorder": 9}
    ax.text(*(middle + 0.5 * ahead), "N", **centred)


def bar_length(span: float) -> float:
    """Return a round length (1, 2 or 5 times a power of ten), at most a quarter of `span`.

    Examples
    --------
    >>> bar_length(320.0), bar_length(79.9), bar_length(0.05)
    (50.0, 10.0, 0.01)
    """
    room = span / 4
    power = 10.0 ** math.floor(math.log10(room))
    return max(round(digit * power, 12) for digit in (0.5, 1, 2, 5) if digit * power <= room * (1 + 1e-12))


def length_text(length: float, unit: str) -> str:
    """Format a length with a readable unit.

    Examples
    --------
    >>> length_text(2000.0, "m"), length_text(50.0, "m"), length_text(0.2, "m"), length_text(500.0, "px")
    ('2 km', '50 m', '20 cm', '500 px')
    """
    if unit == "m" and length >= 1000:
        return f"{length / 1000:g} km"
    if unit == "m" and length < 1:
        return f"{length * 100:g} cm"
    return f"{length:g} {unit}"


def area_text(area_m2: float) -> str:
    """Format an area with a readable unit.

    Examples
    --------
    >>> area_text(512.3), area_text(29000.0), area_text(31e6)
    ('512 m²', '2.9 ha', '31 km²')
    """
    if area_m2 < 10_000:
        return f"{area_m2:.0f} m²"
    return f"{area_m2 / 1e4:.3g} ha" if area_m2 < 1e7 else f"{area_m2 / 1e6:.3g} km²"


def draw_legend(ax: Any) -> None:
    """Draw a legend of what has a label, each label once."""
    handles, labels = ax.get_legend_handles_labels()
    named = dict(zip(labels, handles, strict=True))
    if named:
        look = {"loc": "lower right", "fontsize": 7, "framealpha": 0.8, "borderpad": 0.6}
        ax.legend(named.values(), named.keys(), **look).set_zorder(10)


def write_text(figure: Any, x: float, title: str, subtitle: str, caption: str, caption_in: float) -> None:
    """Write the title and the line below it at the top of a page, and the caption at its foot.

    `x` is the left end of the lines, as a share of the width, `caption_in` the height of the caption above
    the lower edge in inches.
    """
    page = figure.get_figheight()
    figure.text(x, 1 - 0.14 / page, title, size=12, weight="bold", color=TEXT_COLOR, va="top")
    figure.text(x, 1 - 0.37 / page, subtitle, size=9, color=TEXT_COLOR, va="top")
    figure.text(x, caption_in / page, caption, size=7.5, color=CAPTION_COLOR, va="bottom")


def raster_caption(box: GeoBox, band_names: str, grey_name: str, local_metres: bool = False) -> str:
    """Describe a raster in one line: size, CRS, resolution, bands that are used, and the stretch of the grey.

    `local_metres` tells whether coordinates without a CRS are metres.
    """
    rows, cols = box.shape
    parts = [f"{cols} x {rows} pixels"]
    if box.crs is None:
        parts.append("local metres" if local_metres else "no coordinate reference system")
    else:
        epsg = box.crs.to_epsg()
        parts.append(f"EPSG:{epsg}" if epsg else "custom CRS")
    if box.crs is not None or local_metres:
        across, _ = ground_resolution(box)
        parts.append(f"{length_text(float(f'{across:.3g}'), 'm')}/pixel")
    return printable(" · ".join([*parts, band_names, f"grey: {grey_name}"]))
