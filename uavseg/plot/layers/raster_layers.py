"""Layers read from rasters: grey, contours of labels, states of an occupancy map, leaves of the quadtree."""

import os
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.patches import Polygon
from matplotlib.transforms import Affine2D
from numpy.typing import NDArray

from uavseg.arrays import Floats, Integers, Path_, Uint8s, Uint16s, Uint32s
from uavseg.dataclass import dataclass
from uavseg.errors import MapError, ParameterError, RasterError
from uavseg.occupancy.ros.ros_map import is_ros_map, read_ros_map
from uavseg.plain_text import shown
from uavseg.plot.page.page import Frame
from uavseg.raster.collar.find import without_collar
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import TilePass, Window
from uavseg.raster.intensity.stretch import Stretch, StretchSpec, fit_stretch
from uavseg.raster.read.dataset import Dataset, DatasetOverview
from uavseg.regions.outline.trace import trace
from uavseg.units import CELL, FREE, GREY_MAX, OCCUPIED, UNKNOWN

_STATE_COLORS = {
    FREE: ("free", "#2f9e44"),
    UNKNOWN: ("unknown", "#8a8f98"),
    OCCUPIED: ("occupied", "#e8590c"),
}
_STATE_ALPHA = 0.55
_LEAF_SIDES = (64, 32, 16, 8)
_SIDE_BAND = 2  # band of a block map that holds the side of each leaf
_LEAF_COLOR = "#ffd43b"

AnyStretch = Stretch | StretchSpec | str
Contours = tuple[NDArray[np.float64], ...]
_MAX_OVERSAMPLING = 1.5  # pixels of a raster beside one of the picture; with more, four become one


def draw_raster(
    ax: Any, dataset: Dataset, frame: Frame, stretch: AnyStretch, collar: str = "keep", in_color: bool = True
) -> str:
    """Draw a raster, hatched where it is invalid, and return what of it is drawn and the name of the stretch.

    Three bands are drawn in their colours, or with `in_color` False as the grey that ranges are of. With
    `collar` "auto", the raster's collar is searched for in what is drawn and left out, with a warning.
    """
    coarse = DatasetOverview.of(dataset, _max_side(ax))
    window = Window(0, 0, *coarse.geobox.shape)
    if collar == "auto":
        cleaned = without_collar(coarse, TilePass([window]))
        for note in cleaned.warnings[len(coarse.warnings) :]:
            warnings.warn(note, stacklevel=2)
        coarse = cleaned
    fitted = fit_stretch(coarse, stretch, TilePass([window]))
    values, valid = coarse.read(window)
    is_colored = in_color and len(values) == 3
    shown = values if is_colored else fitted.apply(values, valid)[None]
    as_bytes = fitted if is_colored else Stretch(0, GREY_MAX, fitted.name)
    picture, step = as_bytes.colored(shown, valid).transpose(1, 2, 0), 1
    if max(picture.shape) > _MAX_OVERSAMPLING * _max_side(ax) / 2:
        picture, step = mean_of_four(picture), 2
    if valid is not None:
        ax.add_patch(Polygon(frame.corners, fc="#f4f4f4", ec="#cfcfcf", hatch="////", lw=0, zorder=1))
    draw_image(ax, picture, frame.plot_from_map * coarse.geobox.transform * Affine.scale(step), zorder=2)
    return f"{'colours' if is_colored else 'grey'}: {fitted.name}"


def mean_of_four(picture: Uint8s) -> Uint8s:
    """Downsample a picture by two: matplotlib takes 90 bytes for each pixel that it is given.

    It is (rows, cols, 4), with an alpha of 255 where a pixel is valid, and 0 elsewhere. The result is half as
    large, rounded up: the mean of the valid pixels, and their share as alpha.

    Examples
    --------
    >>> grey = np.array([[2, 4, 9]], np.uint8)
    >>> mean_of_four(np.stack([grey, grey, grey, np.array([[255, 255, 0]], np.uint8)], axis=-1)).tolist()
    [[[3, 3, 3, 127], [0, 0, 0, 0]]]
    """
    is_valid = (picture[..., 3:] > 0).astype(np.uint16)
    total, count = _sum_of_four(picture[..., :3] * is_valid), _sum_of_four(is_valid)
    return np.concatenate([total // np.maximum(count, 1), count * 255 // 4], axis=-1).astype(np.uint8)


def _sum_of_four(image: Uint16s) -> Uint16s:
    rows, cols = image.shape[:2]
    even = np.pad(image, ((0, rows % 2), (0, cols % 2), (0, 0)))
    return even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2]


def draw_image(ax: Any, picture: Uint8s, transform: Affine, zorder: float) -> None:
    """Draw an RGBA image, (rows, cols, 4); the transform is from pixel corners (col, row) to the plot."""
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


def _max_side(ax: Any) -> int:
    box = ax.get_window_extent()
    return int(2 * max(box.width, box.height))


def is_enlarged(ax: Any, transform: Affine) -> bool:
    """Return whether a pixel of the raster, placed by a transform, is larger than two of the picture."""
    left, right = ax.get_xlim()
    return bool(abs(transform.determinant) ** 0.5 > 2 * (right - left) / ax.get_window_extent().width)


@dataclass(frozen=True)
class LabelsLayer:
    """Labels in plot coordinates, drawn as contours of their segments."""

    labels: Uint32s  # 0 outside of segments
    plot_from_pixel: Affine
    is_whole: bool  # each pixel was read; else small segments may be missing

    @classmethod
    def of(cls, source: Dataset | Path_, frame: Frame, max_side: int) -> "LabelsLayer":
        """Read the labels of a file that `uavseg original` wrote, or another command with `--labels`.

        Two pixels of the picture show `max_side` rows and columns; half of them are read, since a line is a
        pixel wide.
        """
        dataset = source if isinstance(source, Dataset) else Dataset.open(source, band=1)
        labels, box = _read_band(dataset, frame, max_side // 2)
        if labels.dtype.kind not in "iu" or labels.min() < 0 or labels.max() >= 1 << 32:
            raise RasterError(
                f"{dataset.source} does not hold labels (whole numbers, 0 outside of segments); "
                "uavseg original makes such a raster, and --labels of other commands"
            )
        is_whole = box.shape == dataset.geobox.shape
        return cls(labels.astype(np.uint32), frame.plot_from_map * box.transform, is_whole)

    def title_parts(self, has_crs: bool) -> list[str]:
        """Return the number of segments."""
        prefix, count = "" if self.is_whole else "at least ", int(np.count_nonzero(np.unique(self.labels)))
        return [f"{prefix}{count:,} segment{'s' if count != 1 else ''}"]

    def draw(self, ax: Any, point: float) -> None:
        """Draw on axes, white with a dark edge; `point` is the length of one point (1/72 inch) on them."""
        if is_enlarged(ax, self.plot_from_pixel):
            contours = contours_of(self.labels, self.plot_from_pixel)
            for color, width in (("#222222", 1.7), ("white", 0.8)):
                ax.add_collection(LineCollection(contours, colors=color, lw=width, zorder=2.7))
        else:  # as many lines as there are pixels would take minutes
            draw_image(ax, _borders(self.labels), self.plot_from_pixel, zorder=2.7)


def _read_band(dataset: Dataset, frame: Frame, max_side: int) -> tuple[NDArray[Any], GeoBox]:
    """Read the first band coarsely, 0 where it is invalid."""
    if dataset.geobox.crs != frame.geobox.crs:
        raise RasterError(
            f"{dataset.source} has another coordinate system than the raster of the picture; "
            "draw it over the one that it was made from"
        )
    coarse = DatasetOverview.of(dataset, max_side)
    values, valid = coarse.read(Window(0, 0, *coarse.geobox.shape))
    band = values[0] if valid is None else np.where(valid, values[0], 0)
    return band, coarse.geobox


def contours_of(labels: Uint32s, plot_from_pixel: Affine) -> Contours:
    """Trace closed lines, (n, 2), around labels; the transform is from pixel corners (col, row)."""
    rings = trace(labels)
    x, y = plot_from_pixel * rings.vertices[:, ::-1].T.astype(np.float64)
    parts = np.split(np.stack([x, y], axis=1), rings.starts[1:-1])
    return tuple(np.concatenate([part, part[:1]]) for part in parts if len(part))


def _borders(labels: Uint32s) -> Uint8s:
    """Draw an RGBA picture: white along borders of segments, dark beside them."""
    border, beside = np.zeros((2, *labels.shape), bool)
    border[:-1] |= labels[1:] != labels[:-1]
    border[:, :-1] |= labels[:, 1:] != labels[:, :-1]
    beside[1:] |= border[:-1]
    beside[:, 1:] |= border[:, :-1]
    picture = np.zeros((*labels.shape, 4), np.uint8)
    picture[beside] = (34, 34, 34, 255)
    picture[border] = 255
    return picture


@dataclass(frozen=True)
class StatesLayer:
    """States in plot coordinates, in colour, with white contours of the segments."""

    states: Uint8s  # 1 free, 2 unknown, 3 occupied; 0 no data
    plot_from_pixel: Affine

    @classmethod
    def of(cls, source: Dataset | Path_, frame: Frame, max_side: int) -> "StatesLayer":
        """Read the states of a file that `uavseg classify` wrote, a GeoTIFF or a ROS map, or of a dataset."""
        dataset = source if isinstance(source, Dataset) else _open_states(source)
        states, box = _read_band(dataset, frame, max_side)
        if not np.isin(states, (0, *_STATE_COLORS)).all():
            raise MapError(
                f"{dataset.source} does not hold states (1 free, 2 unknown, 3 occupied); "
                "uavseg classify makes such a raster"
            )
        return cls(states.astype(np.uint8), frame.plot_from_map * box.transform)

    def title_parts(self, has_crs: bool) -> list[str]:
        """Return the share of each state."""
        total = max(int(np.count_nonzero(self.states)), 1)
        return [
            f"{name} {np.count_nonzero(self.states == state) / total:.1%}"
            for state, (name, _) in _STATE_COLORS.items()
        ]

    def draw(self, ax: Any, point: float) -> None:
        table = np.zeros((256, 4), np.uint8)
        for state, (name, color) in _STATE_COLORS.items():
            table[state] = np.round(255 * np.array(to_rgba(color, _STATE_ALPHA)))
            ax.scatter([], [], s=40, marker="s", color=color, label=name)
        draw_image(ax, table[self.states], self.plot_from_pixel, zorder=2.4)
        contours = contours_of(self.states.astype(np.uint32), self.plot_from_pixel)
        ax.add_collection(LineCollection(contours, colors="white", lw=1.1, zorder=2.6))


def _open_states(source: Path_) -> Dataset:
    if not isinstance(source, str | os.PathLike):
        raise MapError(f"states to draw are a file or a Dataset, not {shown(source)}")
    if not is_ros_map(source):
        return Dataset.open(source, band=1)
    ros_map = read_ros_map(source)
    cells = ros_map.cells
    states = np.select([cells < 0, cells == 0, cells == 100], [UNKNOWN, FREE, OCCUPIED], 255)
    return Dataset.of_values(states.astype(np.uint8), ros_map.geobox, Path(source).name)


@dataclass(frozen=True)
class LeavesLayer:
    """Leaves of the quadtree in plot coordinates, drawn as outlines."""

    corners: Floats  # (n, 4, 2), clipped to the raster
    sides: Integers  # 64, 32, 16 or 8 pixels

    @classmethod
    def of(cls, source: Path_, frame: Frame, max_side: int) -> "LeavesLayer":
        """Read the leaves of the block map that `uavseg divide` wrote for this raster."""
        box = frame.geobox
        cells = box.coarsen(CELL)
        if max(cells.shape) > max_side:
            raise ParameterError(
                f"leaves of a raster of {box.shape[1]:,} x {box.shape[0]:,} pixels are too small to be seen; "
                "give a larger --width, or draw a part of it (gdal_translate -srcwin)"
            )
        dataset = Dataset.open(source, band=_SIDE_BAND)
        sides, sides_box = _read_band(dataset, frame, max_side)
        if sides.shape != cells.shape or not sides_box.transform.almost_equals(cells.transform):
            what = "the block map of this raster"
            raise RasterError(f"{dataset.source} is not {what}; uavseg divide makes one")
        if not np.isin(sides, _LEAF_SIDES).all():
            raise RasterError(f"{dataset.source} is not a block map; uavseg divide makes one")
        squares, lengths = leaf_squares(sides.astype(np.int64), box.shape)
        xy = np.stack(box.xy_from_pixel(*squares.reshape(-1, 2).T), axis=1)
        return cls(frame.plot_from_xy(xy).reshape(-1, 4, 2), lengths)

    def title_parts(self, has_crs: bool) -> list[str]:
        """Return the number of leaves."""
        return [f"{len(self.sides):,} {'leaf' if len(self.sides) == 1 else 'leaves'}"]

    def draw(self, ax: Any, point: float) -> None:
        outlines = PolyCollection(list(self.corners), facecolor="none", edgecolor=_LEAF_COLOR, label="leaf")
        outlines.set(lw=0.5, alpha=0.85, zorder=2.8)
        ax.add_collection(outlines)


def leaf_squares(sides: Integers, shape: tuple[int, int]) -> tuple[Integers, Integers]:
    """List the leaves that cells of 8 x 8 pixels belong to: corners, (k, 4, 2), and sides, (k,), in pixels.

    `sides`, (m, n), are those of the leaf of each cell in pixels. Leaves are clipped to the shape of the
    raster.

    Examples
    --------
    >>> corners, sides = leaf_squares(np.array([[16, 16, 8], [16, 16, 8]]), (16, 20))
    >>> corners[:, [0, 2]].tolist(), sides.tolist()
    ([[[0, 0], [16, 16]], [[0, 16], [8, 20]], [[8, 16], [16, 20]]], [16, 8, 8])
    """
    row, col = np.ogrid[: sides.shape[0], : sides.shape[1]]
    first = (CELL * row % sides == 0) & (CELL * col % sides == 0)
    top, left = (CELL * cells for cells in np.nonzero(first))
    side = sides[first]
    bottom, right = np.minimum(top + side, shape[0]), np.minimum(left + side, shape[1])
    corners = [(top, left), (top, right), (bottom, right), (bottom, left)]
    return np.stack([np.stack(corner, axis=-1) for corner in corners], axis=1), side
