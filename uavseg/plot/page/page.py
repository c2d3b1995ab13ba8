"""Page layout and plot coordinates of all pictures: file, figure, axes, scale bar, north arrow, text."""

import math
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle
from numpy.typing import ArrayLike

from uavseg.arrays import Floats, Path_
from uavseg.dataclass import dataclass
from uavseg.errors import OutputError, ParameterError, RasterError
from uavseg.output.atomic import atomic_file, check_target
from uavseg.plain_text import printable
from uavseg.raster.geodesy.globe import WGS84, Transform, geod_of, is_geographic, transform_between
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import ground_resolution

_POINTS = 72  # per inch
TEXT_COLOR, CAPTION_COLOR, _PAPER_COLOR = "#1a1a1a", "#666666", "#ffffff"

View = tuple[float, float, float, float]
"""left, right, bottom, top in plot coordinates."""


@dataclass(frozen=True)
class Frame:
    """Transforms from map coordinates of the raster in the picture to plot coordinates.

    Map coordinates are large numbers and, in degrees, not equally long in x and y. In plot coordinates the
    middle of the raster is (0, 0), x points right, y up, and one unit is equally long in both directions.
    `local_metres` tells whether coordinates without a CRS are metres.
    """

    geobox: GeoBox
    local_metres: bool = False

    @cached_property
    def plot_from_map(self) -> Affine:
        """Return the transform from map to plot coordinates."""
        rows, cols = self.geobox.shape
        x, y = self.geobox.transform * (cols / 2, rows / 2)
        return Affine.scale(*self._scale(y)) * Affine.translation(-x, -y)

    def _scale(self, y: float) -> tuple[float, float]:
        wkt, transform = self.geobox.wkt, self.geobox.transform
        if wkt is None:
            return 1.0, -1.0 if transform.e > 0 else 1.0  # rows that count downwards: pixels, not a map
        return max(math.cos(math.radians(y)), 0.1) if is_geographic(wkt) else 1.0, 1.0

    @property
    def plot_from_pixel(self) -> Affine:
        """Return the transform from pixel corners (col, row) to plot coordinates."""
        return self.plot_from_map * self.geobox.transform

    @property
    def corners(self) -> Floats:
        """Return the raster's corners in plot coordinates, a (4, 2) array."""
        rows, cols = self.geobox.shape
        pixels = ((0, 0), (cols, 0), (cols, rows), (0, rows))
        return np.array([self.plot_from_pixel * corner for corner in pixels])

    def plot_from_xy(self, xy: ArrayLike) -> Floats:
        """Convert map coordinates to plot coordinates, (n, 2) to (n, 2)."""
        points, t = np.asarray(xy, np.float64), self.plot_from_map
        return np.asarray(points * (t.a, t.e) + (t.c, t.f))

    def plot_from_lonlat(self, lon: ArrayLike, lat: ArrayLike) -> Floats:
        """Convert degrees (WGS 84), each (n,), to plot coordinates, (n, 2)."""
        if self.geobox.crs is None:
            raise RasterError(
                "a mission has a place on the globe and this raster has none; "
                "give the raster a CRS (gdal_edit.py -a_srs), or leave the mission out"
            )
        x, y = self._map_from_lonlat(np.asarray(lon, np.float64), np.asarray(lat, np.float64))
        return self.plot_from_xy(np.column_stack([x, y]))

    @cached_property
    def _map_from_lonlat(self) -> Transform:
        return transform_between(WGS84, self.geobox.wkt)

    @cached_property
    def metres_per_unit(self) -> float | None:
        """Return the ground metres of one unit in x at the middle of the plot; None where it is not known."""
        wkt = self.geobox.wkt
        if wkt is None:
            return 1.0 if self.local_metres else None
        lon, lat = self._around_middle
        _, _, metres = geod_of(wkt).inv(lon[0], lat[0], lon[1], lat[1])
        return float(metres) / self._offset if math.isfinite(metres) and metres > 0 else None

    @cached_property
    def north(self) -> tuple[float, float] | None:
        """Return the unit vector towards true north in plot coordinates; None without a CRS."""
        if self.geobox.crs is None:
            return None
        _, lat = self._around_middle
        right, up = float(lat[1] - lat[0]), float(lat[2] - lat[0])
        length = math.hypot(right, up)
        return (right / length, up / length) if math.isfinite(length) and length > 0 else None

    @property
    def _offset(self) -> float:
        return float(np.abs(self.corners).max()) / 100

    @cached_property
    def _around_middle(self) -> tuple[Floats, Floats]:
        """Return longitudes and latitudes of the middle of the plot, a point to its right and one above."""
        points = [~self.plot_from_map * point for point in ((0, 0), (self._offset, 0), (0, self._offset))]
        x, y = np.array(points).T
        return self.geobox.lonlat_from_xy(x, y)


def check_png_target(path: Path_, overwrite: bool) -> Path:
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
    figure = Figure(figsize=(width, height), dpi=dpi, facecolor="white")
    figure.set_layout_engine("none")  # whatever the user has set
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Any, path: Path_, overwrite: bool = False) -> None:
    """Write a page as PNG, whole or not at all; equal pages give equal bytes.

    OutputError if the file may not be written, or exists and `overwrite` is false.
    """
    with atomic_file(path, overwrite) as temporary:
        figure.savefig(temporary, metadata={"Software": "uavseg"})


def fit_axes(ax: Any, view: View, width: float, height: float) -> float:
    """Fit axes, in inches, to a view with equal units; return a point (1/72 inch) in plot coordinates."""
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


def write_text(
    figure: Any, x: float, title: str, subtitle: str, caption: str = "", caption_in: float = 0
) -> None:
    """Write the title and the line below it at the top of a page, and the caption at its foot.

    `x` is the left end of the lines, as a share of the width, `caption_in` the height of the caption above
    the lower edge in inches.
    """
    page = figure.get_figheight()
    figure.text(x, 1 - 0.14 / page, title, size=12, weight="bold", color=TEXT_COLOR, va="top")
    figure.text(x, 1 - 0.37 / page, subtitle, size=9, color=TEXT_COLOR, va="top")
    figure.text(x, caption_in / page, caption, size=7.5, color=CAPTION_COLOR, va="bottom")


def raster_caption(box: GeoBox, band_names: str, drawn: str, local_metres: bool = False) -> str:
    """Describe a raster and how it is drawn; `local_metres` tells if coordinates without a CRS are metres."""
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
    return printable(" · ".join([*parts, band_names, drawn]))
