"""Stack of layers over a raster, in drawing order."""

import os
from dataclasses import dataclass
from typing import Any, Protocol

from uavseg.plot.layers.fence_layer import FenceLayer
from uavseg.plot.layers.labels_layer import LabelsLayer
from uavseg.plot.layers.leaves_layer import LeavesLayer
from uavseg.plot.layers.levels_layer import LevelsLayer
from uavseg.plot.layers.mission_layer import mission_layers, read_missions
from uavseg.plot.layers.path_layer import PathLayer
from uavseg.plot.layers.region_layer import RegionLayer
from uavseg.plot.layers.states_layer import StatesLayer
from uavseg.plot.page.frame import Frame
from uavseg.raster.read.dataset import Dataset

File = str | os.PathLike[str]


class Layer(Protocol):
    """A layer over a raster, in plot coordinates."""

    def draw(self, ax: Any, point: float) -> None:
        """Draw on axes; `point` is the length of one point (1/72 inch) in plot coordinates."""

    def title_parts(self, has_crs: bool) -> list[str]:
        """Parts of the title that describe the layer; lengths and areas are in metres if there is a CRS."""


@dataclass(frozen=True, slots=True)
class LayerSources:
    """Inputs of the layers, the lowest first; each as `uavseg.plot.preview` takes it, None for no layer."""

    levels: Any = None
    states: Dataset | File | None = None
    leaves: File | None = None
    labels: Dataset | File | None = None
    regions: Any = None
    path: Any = None
    mission: Any = None


def make_layers(sources: LayerSources, frame: Frame, max_side: int) -> list[Layer]:
    """The layers that have a source, the lowest first.

    Parameters
    ----------
    sources : LayerSources
    frame : Frame
    max_side : int
        Rasters are read with at most this many rows and columns.
    """
    levels, states, leaves = sources.levels, sources.states, sources.leaves
    labels, regions, path = sources.labels, sources.regions, sources.path
    flights = None if sources.mission is None else read_missions(sources.mission)
    layers: list[Layer | None] = [
        None if levels is None else LevelsLayer.of(levels, frame),
        None if states is None else StatesLayer.of(states, frame, max_side),
        None if leaves is None else LeavesLayer.of(leaves, frame, max_side),
        None if labels is None else LabelsLayer.of(labels, frame, max_side),
        None if regions is None else RegionLayer.of(regions, frame),
        None if path is None else PathLayer.of(path, frame),
        None if flights is None else FenceLayer.of([mission for _, mission in flights], frame),
    ]
    there = [layer for layer in layers if layer is not None]
    return there if flights is None else [*there, *mission_layers(flights, frame)]
