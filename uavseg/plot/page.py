"""What pages of pictures have in common: their target, the map on them, and the line at the foot."""

import os
from pathlib import Path
from typing import Any

from uavseg.atomic import check_target
from uavseg.errors import OutputError
from uavseg.plot.map_furniture import length_text
from uavseg.raster.geobox import GeoBox
from uavseg.raster.geodesy.ground import ground_resolution

POINTS = 72  # per inch
QUIET = "#666666"


def check_picture(path: str | os.PathLike[str], overwrite: bool) -> Path:
    """The path, if a picture may be written there.

    Raises
    ------
    OutputError
        If it is there already, cannot be written there, or is not called .png.
    """
    if Path(path).suffix.lower() != ".png":
        raise OutputError(f"a preview is a PNG picture; call it {Path(path).stem}.png, not {Path(path).name}")
    return check_target(path, overwrite)


def new_figure(width: float, height: float, dpi: float) -> Any:
    """A white page of so many inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=dpi, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Any, path: Path) -> None:
    """Write a page as PNG; the same page gives the same bytes."""
    figure.savefig(path, metadata={"Software": "uavseg"})


def fit_axes(ax: Any, view: tuple[float, float, float, float], width: float, height: float) -> float:
    """Show left, right, bottom and top of the sheet on so many inches; gives the length of one point."""
    left, right, bottom, top = view
    unit = max((right - left) / width, (top - bottom) / height) / POINTS
    x, y = (left + right) / 2, (bottom + top) / 2
    ax.set_xlim(x - unit * POINTS * width / 2, x + unit * POINTS * width / 2)
    ax.set_ylim(y - unit * POINTS * height / 2, y + unit * POINTS * height / 2)
    ax.set(xticks=[], yticks=[], autoscale_on=False)
    for side in ax.spines.values():
        side.set(color="#bbbbbb", lw=0.6)
    return unit


def about_raster(box: GeoBox, band_names: str, grey_name: str) -> str:
    """What a raster is, in one line."""
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
    return " · ".join([*found, band_names, f"grey: {grey_name}"])
