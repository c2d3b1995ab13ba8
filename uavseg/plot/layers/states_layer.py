"""States in a picture: free, unknown and occupied in colour, the contours of segments in white."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from uavseg.errors import MapError
from uavseg.occupancy.ros.ros_map import is_ros_map, read_ros_map
from uavseg.plot.frame import Frame
from uavseg.plot.layers.raster_layer import coarse_of, show
from uavseg.raster.dataset import Dataset
from uavseg.raster.tiling import Window
from uavseg.regions.outline.rings import Rings
from uavseg.regions.outline.trace import trace

COLORS = {1: ("free", "#2f9e44"), 2: ("unknown", "#8a8f98"), 3: ("occupied", "#e8590c")}
ALPHA = 0.55


@dataclass(frozen=True)
class StatesLayer:
    """States on the sheet.

    Parameters
    ----------
    states : (rows, cols) uint8 array
        1 free, 2 unknown, 3 occupied; 0 nothing.
    pixels : Affine
        From pixel corners (col, row) to the sheet.
    contours : tuple of (n, 2) float64 arrays
        Closed lines around the segments, on the sheet.
    """

    states: NDArray[np.uint8]
    pixels: Affine
    contours: tuple[NDArray[np.float64], ...]

    @classmethod
    def of(cls, source: Dataset | str | os.PathLike[str], frame: Frame, most: int) -> "StatesLayer":
        """States of a file that `uavseg classify` wrote, a GeoTIFF or a ROS map, or of a dataset.

        Parameters
        ----------
        most : int
            Rows and columns that are read at most.

        Raises
        ------
        MapError
            If it holds anything but states.
        """
        dataset = source if isinstance(source, Dataset) else _opened(source)
        coarse = coarse_of(dataset, frame, most)
        values, valid = coarse.read(Window(0, 0, *coarse.geobox.shape))
        states = values[0] if valid is None else np.where(valid, values[0], 0)
        if not np.isin(states, (0, *COLORS)).all():
            raise MapError(
                f"{dataset.source} does not hold states (1 free, 2 unknown, 3 occupied); "
                "uavseg classify makes such a raster"
            )
        rings = trace(states.astype(np.uint32))
        around = frame.sheet_from_xy(np.stack(coarse.geobox.xy_from_pixel(*rings.vertices.T), axis=1))
        pixels = frame.affine * coarse.geobox.transform
        return cls(states.astype(np.uint8), pixels, tuple(_closed(around, rings)))

    def told(self, on_globe: bool) -> list[str]:
        """The share of each state."""
        total = max(int(np.count_nonzero(self.states)), 1)
        shares = ((name, np.count_nonzero(self.states == k) / total) for k, (name, _) in COLORS.items())
        return [f"{name} {share:.1%}" for name, share in shares]

    def draw(self, ax: Any, unit: float) -> None:
        """Draw on axes, where `unit` is the length on the sheet of one point (1/72 inch)."""
        from matplotlib.collections import LineCollection
        from matplotlib.colors import to_rgba

        table = np.zeros((256, 4), np.uint8)
        for state, (name, color) in COLORS.items():
            table[state] = np.round(255 * np.array(to_rgba(color, ALPHA)))
            ax.scatter([], [], s=40, marker="s", color=color, label=name)
        show(ax, table[self.states], self.pixels, zorder=2.4)
        ax.add_collection(LineCollection(self.contours, colors="white", lw=1.1, zorder=2.6))


def _closed(vertices: NDArray[np.float64], rings: Rings) -> list[NDArray[np.float64]]:
    parts = np.split(vertices, rings.starts[1:-1])
    return [np.concatenate([part, part[:1]]) for part in parts if len(part)]


def _opened(source: str | os.PathLike[str]) -> Dataset:
    if not is_ros_map(source):
        return Dataset.open(source, band=1)
    found = read_ros_map(source)
    states = np.select([found.cells < 0, found.cells == 0, found.cells == 100], [2, 1, 3], 255)
    return Dataset.of_values(states.astype(np.uint8), found.geobox, Path(source).name)
