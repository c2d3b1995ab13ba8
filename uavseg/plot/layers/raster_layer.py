"""Raster layer: the raster of the picture in grey; coarse reads of other rasters over it."""

import os
import warnings
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from uavseg.errors import RasterError
from uavseg.plot.frame import Frame
from uavseg.raster.collar.find import without_collar
from uavseg.raster.dataset import Dataset
from uavseg.raster.intensity.stretch import Stretch, StretchSpec, fit_stretch
from uavseg.raster.overview import DatasetOverview
from uavseg.raster.tiling import TilePass, Window


def draw_raster(
    ax: Any, dataset: Dataset, frame: Frame, stretch: Stretch | StretchSpec | str, collar: str = "keep"
) -> str:
    """Draw a raster in grey, hatched where it is invalid; returns the name of the stretch.

    With `collar` "auto", its collar is searched for in what is drawn; a warning says what was found.
    """
    from matplotlib.patches import Polygon

    coarse = DatasetOverview.of(dataset, _max_side(ax))
    window = Window(0, 0, *coarse.geobox.shape)
    if collar == "auto":
        cleaned = without_collar(coarse, TilePass([window]))
        for note in cleaned.warnings[len(coarse.warnings) :]:
            warnings.warn(note, stacklevel=2)
        coarse = cleaned
    fitted = fit_stretch(coarse, stretch, TilePass([window]))
    values, valid = coarse.read(window)
    picture = np.full((window.rows, window.cols, 4), 255, np.uint8)
    picture[..., :3] = (fitted.apply(values, valid) >> 8).astype(np.uint8)[..., None]
    if valid is not None:
        picture[..., 3] = np.where(valid, 255, 0)
        ax.add_patch(Polygon(frame.corners, fc="#f4f4f4", ec="#cfcfcf", hatch="////", lw=0, zorder=1))
    draw_image(ax, picture, frame.plot_from_map * coarse.geobox.transform, zorder=2)
    return fitted.name


def draw_image(ax: Any, picture: NDArray[np.uint8], transform: Affine, zorder: float) -> None:
    """Draw an image.

    Parameters
    ----------
    ax : matplotlib Axes
    picture : (rows, cols, 4) uint8 array
        Red, green, blue and alpha.
    transform : Affine
        From pixel corners (col, row) to plot coordinates.
    zorder : float
    """
    from matplotlib.transforms import Affine2D

    t = transform
    image = ax.imshow(
        picture,
        extent=(0, picture.shape[1], picture.shape[0], 0),
        transform=Affine2D.from_values(t.a, t.d, t.b, t.e, t.c, t.f) + ax.transData,
        interpolation="nearest" if _is_enlarged(ax, t) else "antialiased",
        aspect="auto",
        zorder=zorder,
    )
    image.set_clip_path(ax.patch)


def open_coarse(
    path: str | os.PathLike[str], frame: Frame, max_side: int, band: int | None = None
) -> DatasetOverview:
    """Open another raster over that of the picture, with at most `max_side` rows and columns.

    Raises
    ------
    RasterError
        If its coordinate system differs.
    """
    return read_coarsely(Dataset.open(path, band=band), frame, max_side)


def read_coarsely(dataset: Dataset, frame: Frame, max_side: int) -> DatasetOverview:
    """As `open_coarse`, for an open dataset."""
    if dataset.geobox.crs != frame.geobox.crs:
        raise RasterError(
            f"{dataset.source} has another coordinate system than the raster of the picture; "
            "draw it over the one that it was made from"
        )
    return DatasetOverview.of(dataset, max_side)


def _max_side(ax: Any) -> int:
    box = ax.get_window_extent()
    return int(2 * max(box.width, box.height))


def _is_enlarged(ax: Any, transform: Affine) -> bool:
    """Whether a pixel of the raster is larger than two pixels of the picture."""
    left, right = ax.get_xlim()
    return bool(abs(transform.determinant) ** 0.5 > 2 * (right - left) / ax.get_window_extent().width)
