"""Layer of labels: contours of the segments of a label raster."""

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from uavseg.errors import RasterError
from uavseg.plot.layers.raster_layer import draw_image, is_enlarged, read_coarsely
from uavseg.plot.page.frame import Frame
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.dataset import Dataset
from uavseg.regions.outline.trace import trace

Contours = tuple[NDArray[np.float64], ...]


@dataclass(frozen=True)
class LabelsLayer:
    """Labels in plot coordinates.

    Parameters
    ----------
    labels : (rows, cols) uint32 array
        0 outside of segments.
    plot_from_pixel : Affine
        From pixel corners (col, row) to plot coordinates.
    is_whole : bool
        Whether each pixel was read; else small segments may be missing.
    """

    labels: NDArray[np.uint32]
    plot_from_pixel: Affine
    is_whole: bool

    @classmethod
    def of(cls, source: Dataset | str | os.PathLike[str], frame: Frame, max_side: int) -> "LabelsLayer":
        """Labels of a file that `uavseg original` wrote, or another command with `--labels`, or of a dataset.

        Parameters
        ----------
        max_side : int
            Rows and columns that two pixels of the picture show; half of them are read, since a line is a
            pixel wide.

        Raises
        ------
        RasterError
            If it holds something other than labels, or lies in another coordinate system.
        """
        dataset = source if isinstance(source, Dataset) else Dataset.open(source, band=1)
        coarse = read_coarsely(dataset, frame, max_side // 2)
        values, valid = coarse.read(Window(0, 0, *coarse.geobox.shape))
        labels = values[0] if valid is None else np.where(valid, values[0], 0)
        if labels.dtype.kind not in "iu" or labels.min() < 0 or labels.max() >= 1 << 32:
            raise RasterError(
                f"{dataset.source} does not hold labels (whole numbers, 0 outside of segments); "
                "uavseg original makes such a raster, and --labels of other commands"
            )
        is_whole = coarse.geobox.shape == dataset.geobox.shape
        return cls(labels.astype(np.uint32), frame.plot_from_map * coarse.geobox.transform, is_whole)

    def title_parts(self, has_crs: bool) -> list[str]:
        """The number of segments."""
        least, count = "" if self.is_whole else "at least ", int(np.count_nonzero(np.unique(self.labels)))
        return [f"{least}{count:,} segment{'s' if count != 1 else ''}"]

    def draw(self, ax: Any, point: float) -> None:
        """Draw on axes, white with a dark edge; `point` is the length of one point (1/72 inch) on them."""
        from matplotlib.collections import LineCollection

        if is_enlarged(ax, self.plot_from_pixel):
            contours = contours_of(self.labels, self.plot_from_pixel)
            for color, width in (("#222222", 1.7), ("white", 0.8)):
                ax.add_collection(LineCollection(contours, colors=color, lw=width, zorder=2.7))
        else:  # as many lines as there are pixels would take minutes
            draw_image(ax, _borders(self.labels), self.plot_from_pixel, zorder=2.7)


def contours_of(labels: NDArray[np.uint32], plot_from_pixel: Affine) -> Contours:
    """Closed lines around the segments of a label image, in plot coordinates."""
    rings = trace(labels)
    x, y = plot_from_pixel * rings.vertices[:, ::-1].T.astype(np.float64)
    parts = np.split(np.stack([x, y], axis=1), rings.starts[1:-1])
    return tuple(np.concatenate([part, part[:1]]) for part in parts if len(part))


def _borders(labels: NDArray[np.uint32]) -> NDArray[np.uint8]:
    """A picture of red, green, blue and alpha: white along borders of segments, dark beside them."""
    border = np.zeros(labels.shape, bool)
    border[:-1] |= labels[1:] != labels[:-1]
    border[:, :-1] |= labels[:, 1:] != labels[:, :-1]
    beside = np.zeros(labels.shape, bool)
    beside[1:] |= border[:-1]
    beside[:, 1:] |= border[:, :-1]
    picture = np.zeros((*labels.shape, 4), np.uint8)
    picture[beside] = (34, 34, 34, 255)
    picture[border] = 255
    return picture
