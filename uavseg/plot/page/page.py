"""Page layout shared by all pictures: target file, figure, axes of the map, caption."""

import os
from pathlib import Path
from typing import Any

from uavseg.errors import OutputError
from uavseg.output.atomic import check_target
from uavseg.plain_text import printable
from uavseg.plot.page.map_furniture import length_text
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import ground_resolution

POINTS = 72  # per inch
CAPTION_COLOR = "#666666"


def check_png_target(path: str | os.PathLike[str], overwrite: bool) -> Path:
    """Check that a picture may be written to a path, and return the path.

    Raises
    ------
    OutputError
        If the file exists, cannot be written there, or does not end in .png.
    """
    if Path(path).suffix.lower() != ".png":
        raise OutputError(f"a preview is a PNG picture; call it {Path(path).stem}.png, not {Path(path).name}")
    return check_target(path, overwrite)


def new_figure(width: float, height: float, dpi: float) -> Any:
    """A white page of `width` x `height` inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=dpi, facecolor="white")
    figure.set_layout_engine("none")  # whatever the user has set
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Any, path: Path) -> None:
    """Write a page as PNG; equal pages give equal bytes."""
    figure.savefig(path, metadata={"Software": "uavseg"})


def fit_axes(ax: Any, view: tuple[float, float, float, float], width: float, height: float) -> float:
    """Fit the axes to a view, with equal units in x and y.

    Parameters
    ----------
    ax : matplotlib Axes
    view : (float, float, float, float)
        left, right, bottom, top in plot coordinates.
    width, height : float
        Of the axes in inches.

    Returns
    -------
    point : float
        Length of one point (1/72 inch) in plot coordinates.
    """
    left, right, bottom, top = view
    point = max((right - left) / width, (top - bottom) / height) / POINTS
    x, y = (left + right) / 2, (bottom + top) / 2
    ax.set_xlim(x - point * POINTS * width / 2, x + point * POINTS * width / 2)
    ax.set_ylim(y - point * POINTS * height / 2, y + point * POINTS * height / 2)
    ax.set(xticks=[], yticks=[], autoscale_on=False)
    for side in ax.spines.values():
        side.set(color="#bbbbbb", lw=0.6)
    return point


def draw_legend(ax: Any) -> None:
    """Draw a legend of what has a label, each label once; none if nothing has one."""
    handles, labels = ax.get_legend_handles_labels()
    named = dict(zip(labels, handles, strict=True))
    if named:
        look = {"loc": "lower right", "fontsize": 7, "framealpha": 0.8, "borderpad": 0.6}
        ax.legend(named.values(), named.keys(), **look).set_zorder(10)


def raster_caption(box: GeoBox, band_names: str, grey_name: str, local_metres: bool = False) -> str:
    """Size, CRS, resolution, bands and grey of a raster in one line."""
    rows, cols = box.shape
    found = [f"{cols} x {rows} pixels"]
    if box.crs is None:
        found.append("local metres" if local_metres else "no coordinate reference system")
    else:
        epsg = box.crs.to_epsg()
        found.append(f"EPSG:{epsg}" if epsg else "custom CRS")
    if box.crs is not None or local_metres:
        across, _ = ground_resolution(box)
        found.append(f"{length_text(float(f'{across:.3g}'), 'm')}/pixel")
    return printable(" · ".join([*found, band_names, f"grey: {grey_name}"]))
