"""Layer of states: free, unknown and occupied in colour, contours of the segments in white."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from uavseg.errors import MapError
from uavseg.occupancy.ros.ros_map import is_ros_map, read_ros_map
from uavseg.plain_text import shown
from uavseg.plot.layers.labels_layer import Contours, contours_of
from uavseg.plot.layers.raster_layer import draw_image, read_coarsely
from uavseg.plot.page.frame import Frame
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.dataset import Dataset
from uavseg.units import FREE, OCCUPIED, UNKNOWN

_STATE_COLORS = {
    FREE: ("free", "#2f9e44"),
    UNKNOWN: ("unknown", "#8a8f98"),
    OCCUPIED: ("occupied", "#e8590c"),
}
_ALPHA = 0.55


@dataclass(frozen=True)
class StatesLayer:
    """States in plot coordinates.

    Parameters
    ----------
    states : (rows, cols) uint8 array
        1 free, 2 unknown, 3 occupied; 0 no data.
    pixels : Affine
        From pixel corners (col, row) to plot coordinates.
    contours : tuple of (n, 2) float64 arrays
        Closed lines around the segments.
    """

    states: NDArray[np.uint8]
    plot_from_pixel: Affine
    contours: Contours

    @classmethod
    def of(cls, source: Dataset | str | os.PathLike[str], frame: Frame, max_side: int) -> "StatesLayer":
        """States of a file that `uavseg classify` wrote, a GeoTIFF or a ROS map, or of a dataset.

        Parameters
        ----------
        most : int
            Largest number of rows and columns that is read.

        Raises
        ------
        MapError
            If it holds values other than states.
        """
        dataset = source if isinstance(source, Dataset) else _open_states(source)
        coarse = read_coarsely(dataset, frame, max_side)
        values, valid = coarse.read(Window(0, 0, *coarse.geobox.shape))
        states = values[0] if valid is None else np.where(valid, values[0], 0)
        if not np.isin(states, (0, *_STATE_COLORS)).all():
            raise MapError(
                f"{dataset.source} does not hold states (1 free, 2 unknown, 3 occupied); "
                "uavseg classify makes such a raster"
            )
        plot_from_pixel = frame.plot_from_map * coarse.geobox.transform
        contours = contours_of(states.astype(np.uint32), plot_from_pixel)
        return cls(states.astype(np.uint8), plot_from_pixel, contours)

    def title_parts(self, has_crs: bool) -> list[str]:
        """The share of each state."""
        total = max(int(np.count_nonzero(self.states)), 1)
        shares = (
            (name, np.count_nonzero(self.states == k) / total) for k, (name, _) in _STATE_COLORS.items()
        )
        return [f"{name} {share:.1%}" for name, share in shares]

    def draw(self, ax: Any, point: float) -> None:
        """Draw on axes; `point` is the length of one point (1/72 inch) in plot coordinates."""
        from matplotlib.collections import LineCollection
        from matplotlib.colors import to_rgba

        table = np.zeros((256, 4), np.uint8)
        for state, (name, color) in _STATE_COLORS.items():
            table[state] = np.round(255 * np.array(to_rgba(color, _ALPHA)))
            ax.scatter([], [], s=40, marker="s", color=color, label=name)
        draw_image(ax, table[self.states], self.plot_from_pixel, zorder=2.4)
        ax.add_collection(LineCollection(self.contours, colors="white", lw=1.1, zorder=2.6))


def _open_states(source: str | os.PathLike[str]) -> Dataset:
    if not isinstance(source, str | os.PathLike):
        raise MapError(f"states to draw are a file or a Dataset, not {shown(source)}")
    if not is_ros_map(source):
        return Dataset.open(source, band=1)
    found = read_ros_map(source)
    states = np.select(
        [found.cells < 0, found.cells == 0, found.cells == 100], [UNKNOWN, FREE, OCCUPIED], 255
    )
    return Dataset.of_values(states.astype(np.uint8), found.geobox, Path(source).name)
