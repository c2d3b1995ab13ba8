"""Layer of labels: contours of the segments of a label raster."""

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import RasterError
from uavseg.plot.frame import Frame
from uavseg.plot.layers.raster_layer import read_coarsely
from uavseg.raster.dataset import Dataset
from uavseg.raster.geobox import GeoBox
from uavseg.raster.tiling import Window
from uavseg.regions.outline.trace import trace

Contours = tuple[NDArray[np.float64], ...]


@dataclass(frozen=True)
class LabelsLayer:
    """Contours of segments in plot coordinates.

    Parameters
    ----------
    contours : tuple of (n, 2) float64 arrays
        Closed lines around the segments.
    count : int
        Number of segments.
    is_whole : bool
        Whether each pixel was read; else small segments may be missing.
    """

    contours: Contours
    count: int
    is_whole: bool

    @classmethod
    def of(cls, source: Dataset | str | os.PathLike[str], frame: Frame, max_side: int) -> "LabelsLayer":
        """Segments of a file that `uavseg original` wrote, or another command with `--labels`, or a dataset.

        Parameters
        ----------
        max_side : int
            Largest number of rows and columns that is read.

        Raises
        ------
        RasterError
            If it holds something other than labels, or lies in another coordinate system.
        """
        dataset = source if isinstance(source, Dataset) else Dataset.open(source, band=1)
        coarse = read_coarsely(dataset, frame, max_side)
        values, valid = coarse.read(Window(0, 0, *coarse.geobox.shape))
        labels = values[0] if valid is None else np.where(valid, values[0], 0)
        if labels.dtype.kind not in "iu" or labels.min() < 0 or labels.max() >= 1 << 32:
            raise RasterError(
                f"{dataset.source} does not hold labels (whole numbers, 0 outside of segments); "
                "uavseg original makes such a raster, and --labels of other commands"
            )
        count = int(np.count_nonzero(np.unique(labels)))
        is_whole = coarse.geobox.shape == dataset.geobox.shape
        return cls(contours_of(labels.astype(np.uint32), coarse.geobox, frame), count, is_whole)

    def title_parts(self, has_crs: bool) -> list[str]:
        """The number of segments."""
        least = "" if self.is_whole else "at least "
        return [f"{least}{self.count:,} segment{'s' if self.count != 1 else ''}"]

    def draw(self, ax: Any, point: float) -> None:
        """Draw on axes; `point` is the length of one point (1/72 inch) in plot coordinates."""
        from matplotlib.collections import LineCollection

        for color, width in (("#222222", 1.7), ("white", 0.8)):  # white, with an edge for light ground
            ax.add_collection(LineCollection(self.contours, colors=color, lw=width, zorder=2.7))


def contours_of(labels: NDArray[np.uint32], geobox: GeoBox, frame: Frame) -> Contours:
    """Closed lines around the segments of a label image, in plot coordinates."""
    rings = trace(labels)
    vertices = frame.plot_from_xy(np.stack(geobox.xy_from_pixel(*rings.vertices.T), axis=1))
    parts = np.split(vertices, rings.starts[1:-1])
    return tuple(np.concatenate([part, part[:1]]) for part in parts if len(part))
