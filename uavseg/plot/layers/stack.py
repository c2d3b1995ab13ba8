"""What may be drawn over a raster, in the order in which it is drawn."""

import os
from typing import Any, Protocol

from uavseg.plot.frame import Frame
from uavseg.plot.layers.leaves_layer import LeavesLayer
from uavseg.plot.layers.levels_layer import LevelsLayer
from uavseg.plot.layers.mission_layer import MissionLayer
from uavseg.plot.layers.path_layer import PathLayer
from uavseg.plot.layers.region_layer import RegionLayer
from uavseg.plot.layers.states_layer import StatesLayer
from uavseg.raster.dataset import Dataset

File = str | os.PathLike[str]


class Layer(Protocol):
    """Something drawn over a raster."""

    def draw(self, ax: Any, unit: float) -> None:
        """Draw on axes, where `unit` is the length on the sheet of one point (1/72 inch)."""

    def told(self, on_globe: bool) -> list[str]:
        """What the title says of it; `on_globe` where the raster has a CRS, so that metres are known."""


def layers_over(
    frame: Frame,
    most: int,
    levels: Any = None,
    states: Dataset | File | None = None,
    leaves: File | None = None,
    regions: Any = None,
    path: Any = None,
    mission: Any = None,
) -> list[Layer]:
    """The layers that are wanted, each as `uavseg.plot.preview` takes it, the lowest first.

    Parameters
    ----------
    frame : Frame
        The sheet.
    most : int
        Rows and columns of a raster that are read at most.
    """
    found: list[Layer | None] = [
        None if levels is None else LevelsLayer.of(levels, frame),
        None if states is None else StatesLayer.of(states, frame, most),
        None if leaves is None else LeavesLayer.of(leaves, frame, most),
        None if regions is None else RegionLayer.of(regions, frame),
        None if path is None else PathLayer.of(path, frame),
        None if mission is None else MissionLayer.of(mission, frame),
    ]
    return [layer for layer in found if layer is not None]
