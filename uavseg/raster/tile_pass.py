"""Pass over the tiles of a raster: windows, executor and progress as one value."""

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from uavseg.execution.executors import Map, Progress, serial, split_progress
from uavseg.raster.dataset import Dataset, windows_of
from uavseg.raster.tiling import Window

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class TilePass:
    """One pass over the tiles of a raster.

    Parameters
    ----------
    windows : sequence of Window
        Tiles that cover the raster, each after those above it and to its left in its panel.
    map : Map
        The executor.
    progress : callable, optional
        Called with (done, total).
    """

    windows: Sequence[Window]
    map: Map = serial
    progress: Progress | None = None

    @classmethod
    def over(
        cls, dataset: Dataset, tile: int | None = None, map: Map = serial, progress: Progress | None = None
    ) -> "TilePass":
        """A pass over a dataset, in tiles of this side or of one that suits its files.

        Raises
        ------
        ParameterError
            If the side is not a positive multiple of 64.
        """
        return cls(windows_of(dataset, tile), map, progress)

    def run(
        self, function: Callable[[Any], Result], items: Sequence[Any] | None = None
    ) -> Generator[Result, None, None]:
        """Results of a function for each window, or for each of some other items, in their order."""
        return self.map(function, self.windows if items is None else items, self.progress)

    def stages(self, count: int) -> list["TilePass"]:
        """The pass `count` times, each of which reports its share of the progress."""
        if self.progress is None:
            return [self] * count
        return [replace(self, progress=progress) for progress in split_progress(self.progress, count)]

    @property
    def silent(self) -> "TilePass":
        """The pass without progress."""
        return replace(self, progress=None)
