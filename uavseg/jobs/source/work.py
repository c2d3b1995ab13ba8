"""How a job is run: tiles, executor, checkpoint, progress and unreadable blocks as one value."""

import os
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import field, replace
from typing import TYPE_CHECKING, Any, TypeVar

from uavseg.dataclass import dataclass
from uavseg.execution.executors import Map, Progress, decided, serial
from uavseg.raster.grid.tiling import TilePass, Window
from uavseg.raster.read.bad_blocks import BadBlock, bad_block_warnings, recording_bad_blocks, with_bad_blocks
from uavseg.segmentation.blocks.block_map import check_memory

if TYPE_CHECKING:
    from uavseg.jobs.source.source import Pixels

Result = TypeVar("Result")


@dataclass(frozen=True)
class Work:
    """How a job is run; none of it changes a result.

    Each job has a set of bad blocks of its own, which grows as results come in. `resumed` is called for each
    stage of which tiles were found in the checkpoint, `started` with the windows.
    """

    tile: int | None = None  # side in pixels, a multiple of 64; by default one that suits the files
    executor: Map = serial  # runs the tiles
    local: Map = serial  # threads of this process, for steps that a cluster would slow down
    progress: Progress | None = None  # called with (done, total)
    checkpoint: str | os.PathLike[str] | None = None  # folder of finished tiles
    resumed: Callable[[str, int, int], object] | None = None  # called with (stage, done, total)
    started: Callable[[Sequence[Window]], object] | None = None  # called when the tiles of a source are known
    bad_blocks: set[BadBlock] = field(default_factory=set, repr=False, compare=False)

    def begun(self) -> "Work":
        """Return the work of one job, with a set of unreadable blocks of its own."""
        return replace(self, bad_blocks=set())

    def over(self, source: "Pixels", block_map: bool = True) -> TilePass:
        """Return the pass over the tiles of a source, which collects its unreadable blocks.

        `block_map` tells whether the work may hold the block map of the whole source; a RasterError says that
        it would not fit into memory. A ParameterError says that the side of a tile is not a multiple of 64,
        or that there is a checkpoint and the source is a ROS map, which is read whole, an OutputError that
        the folder of the checkpoint cannot be made.
        """
        if self.checkpoint is not None:
            source.check_resumable()
        if block_map:
            check_memory(source.geobox.shape)
        tile_pass = TilePass(source.dataset.windows(self.tile), self.map, self.progress)
        sides = max((window.rows, window.cols) for window in tile_pass.windows)
        decided("%d tiles of %d x %d pixels at most", len(tile_pass.windows), *sides)
        if self.started is not None:
            self.started(tile_pass.windows)
        return tile_pass

    @property
    def map(self) -> Map:
        """The executor with its checkpoint, which collects unreadable blocks."""
        run = self.executor
        if self.checkpoint is not None:
            from uavseg.execution.checkpoint import with_checkpoint

            run = with_checkpoint(run, self.checkpoint, self.resumed)
        return with_bad_blocks(run, self.bad_blocks)

    def reading_here(self) -> AbstractContextManager[None]:
        """Return a context in which this thread reads; it collects unreadable blocks too."""
        return recording_bad_blocks(self.bad_blocks)

    @property
    def bad_block_warnings(self) -> tuple[str, ...]:
        """What cannot be read, see `raster.bad_blocks.bad_block_warnings`."""
        return bad_block_warnings(self.bad_blocks)

    def finished(self, result: Result, *hints: str) -> Result:
        """Return a result with all of its warnings: its own, the unreadable blocks, then hints of the job."""
        known: Any = result
        found: Result = replace(known, warnings=(*known.warnings, *self.bad_block_warnings, *hints))
        return found


SERIAL = Work()
"""One tile after the other, in this thread."""
