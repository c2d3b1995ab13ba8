"""Raster layer: the raster of the picture in grey, read from overviews; images placed by a transform."""

import warnings
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from uavseg.errors import RasterError
from uavseg.plot.page.frame import Frame
from uavseg.raster.collar.find import without_collar
from uavseg.raster.grid.tiling import TilePass, Window
from uavseg.raster.intensity.stretch import Stretch, StretchSpec, fit_stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.read.overview import DatasetOverview

_MAX_OVERSAMPLING = 1.5  # pixels of a raster beside one of the picture; with more, four become one


def draw_raster(
    ax: Any, dataset: Dataset, frame: Frame, stretch: Stretch | StretchSpec | str, collar: str = "keep"
) -> str:
    """Draw a raster in grey, hatched where it is invalid, and return the name of the stretch.

    With `collar` "auto", the raster's collar is searched for in what is drawn and left out, with a warning.
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
    grey, step = (fitted.apply(values, valid) >> 8).astype(np.uint8), 1
    opaque = None if valid is None else np.where(valid, np.uint8(255), np.uint8(0))
    if max(grey.shape) > _MAX_OVERSAMPLING * _max_side(ax) / 2:
        (grey, opaque), step = mean_of_four(grey, opaque), 2
    picture = np.full((*grey.shape, 4), 255, np.uint8)
    picture[..., :3] = grey[..., None]
    if opaque is not None:
        picture[..., 3] = opaque
        ax.add_patch(Polygon(frame.corners, fc="#f4f4f4", ec="#cfcfcf", hatch="////", lw=0, zorder=1))
    draw_image(ax, picture, frame.plot_from_map * coarse.geobox.transform * Affine.scale(step), zorder=2)
    return fitted.name


def mean_of_four(
    grey: NDArray[np.uint8], opaque: NDArray[np.uint8] | None
) -> tuple[NDArray[np.uint8], NDArray[np.uint8] | None]:
    """Downsample a picture by two: matplotlib takes 90 bytes for each pixel that it is given.

    Both arrays are (rows, cols): `opaque` is 255 where a pixel is valid, and 0 elsewhere; None where all are.
    Those that are returned are half as large, rounded up: the mean of the valid pixels, and their share.

    Examples
    --------
    >>> mean_of_four(np.array([[2, 4, 9]], np.uint8), np.array([[255, 255, 0]], np.uint8))
    (array([[3, 0]], dtype=uint8), array([[127,   0]], dtype=uint8))
    """
    is_valid = np.ones(grey.shape, np.uint16) if opaque is None else (opaque > 0).astype(np.uint16)
    total, count = _sum_of_four(grey * is_valid), _sum_of_four(is_valid)
    mean = (total // np.maximum(count, 1)).astype(np.uint8)
    return mean, None if opaque is None else (count * 255 // 4).astype(np.uint8)


def _sum_of_four(image: NDArray[np.uint16]) -> NDArray[np.uint16]:
    rows, cols = image.shape
    even = np.pad(image, ((0, rows % 2), (0, cols % 2)))
    return even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2]


def draw_image(ax: Any, picture: NDArray[np.uint8], transform: Affine, zorder: float) -> None:
    """Draw an RGBA image, (rows, cols, 4), that an affine transform places.

    It is from pixel corners (col, row) to plot coordinates.
    """
    from matplotlib.transforms import Affine2D

    t = transform
    image = ax.imshow(
        picture,
        extent=(0, picture.shape[1], picture.shape[0], 0),
        transform=Affine2D.from_values(t.a, t.d, t.b, t.e, t.c, t.f) + ax.transData,
        interpolation="nearest" if is_enlarged(ax, t) else "antialiased",
        aspect="auto",
        zorder=zorder,
    )
    image.set_clip_path(ax.patch)


def read_overview(dataset: Dataset, frame: Frame, max_side: int) -> DatasetOverview:
    """Reduce another raster over that of the picture to at most `max_side` rows and columns."""
    if dataset.geobox.crs != frame.geobox.crs:
        raise RasterError(
            f"{dataset.source} has another coordinate system than the raster of the picture; "
            "draw it over the one that it was made from"
        )
    return DatasetOverview.of(dataset, max_side)


def _max_side(ax: Any) -> int:
    box = ax.get_window_extent()
    return int(2 * max(box.width, box.height))


def is_enlarged(ax: Any, transform: Affine) -> bool:
    """Return whether a pixel of the raster, placed by a transform, is larger than two of the picture."""
    left, right = ax.get_xlim()
    return bool(abs(transform.determinant) ** 0.5 > 2 * (right - left) / ax.get_window_extent().width)
