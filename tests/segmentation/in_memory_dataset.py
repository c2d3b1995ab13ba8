"""A dataset in memory that counts its reads, and random rasters: for tests of sources and the pipeline."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window
from uavseg.raster.intensity.stretch import Stretch
from uavseg.segmentation.source import GreySource


@dataclass
class InMemory:
    """Stands in for a dataset: an 8-bit array, read by window; counts what is read."""

    values: NDArray[np.uint8]
    valid: NDArray[np.bool_]
    reads: list[Window] = field(default_factory=list)

    @property
    def geobox(self) -> GeoBox:
        return GeoBox(self.valid.shape, Affine.identity(), None)

    def is_empty(self, window: Window) -> bool:
        return not self.valid[window.slices].any()

    def read(self, window: Window) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
        assert window.clipped(self.valid.shape) == window
        self.reads.append(window)
        valid = self.valid[window.slices]
        return self.values[window.slices][None], None if valid.all() else valid


def field_of(seed: int, shape: tuple[int, int]) -> InMemory:
    """Plains and textures, with holes and an empty corner."""
    rng = np.random.default_rng(seed)

    def coarse(some: NDArray[Any]) -> NDArray[Any]:
        return some.repeat(40, 0).repeat(40, 1)[: shape[0], : shape[1]]

    many = (shape[0] // 40 + 1, shape[1] // 40 + 1)
    noise = rng.normal(0, 1, shape) * coarse(rng.choice([0, 2, 40], many))
    values = np.clip(coarse(rng.integers(0, 256, many)) + noise, 0, 255).astype(np.uint8)
    valid = rng.random(shape) > coarse(rng.choice([0, 0, 0.1], many))
    valid[: int(rng.choice([0, 70])), : int(rng.choice([1, 140]))] = False
    return InMemory(values, valid)


def source_of(dataset: Any) -> GreySource:
    return GreySource(dataset, Stretch(0.0, 255.0, "dtype"))
