"""Files that are damaged in places: which of their blocks cannot be read, and the pixels of all others.

What can or cannot be decoded is a block of the file. So a window that fails is read again block by block, and
what comes out depends on the file alone, not on how windows are cut.
"""

from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import RasterReadError
from uavseg.execution.executors import Item, Map, Progress, Result
from uavseg.raster.bands import BandChoice
from uavseg.raster.opening import OpenFiles, gdal_read_errors
from uavseg.raster.raster_file import RasterFile
from uavseg.raster.tiling import Window

Values = NDArray[Any]
Valid = NDArray[np.bool_]
Indices = NDArray[np.int64]
Slices = tuple[slice, slice]


@dataclass(frozen=True, slots=True, order=True)
class BadBlock:
    """A block of a file that cannot be read: where it begins, and how large it is, in pixels of the file."""

    path: str
    row: int
    col: int
    rows: int
    cols: int

    def __str__(self) -> str:
        return (
            f"{self.path} cannot be read in rows {self.row} to {self.row + self.rows}, columns {self.col} to "
            f"{self.col + self.cols}: its pixels there count as nodata"
        )


MissingPart = tuple[BadBlock, Slices]
"""A block that cannot be read, and where it lies in the array that is read."""

_listener: ContextVar[set[BadBlock] | None] = ContextVar("listener", default=None)


def record_bad_block(block: BadBlock) -> None:
    """Tell whoever listens around this call that pixels are missing for this block."""
    found = _listener.get()
    if found is not None:
        found.add(block)


@contextmanager
def recording_bad_blocks(found: set[BadBlock]) -> Iterator[None]:
    """Collect the bad blocks that are come across here, in this thread."""
    token = _listener.set(found)
    try:
        yield
    finally:
        _listener.reset(token)


def with_bad_blocks(map: Map, found: set[BadBlock]) -> Map:
    """A map that also collects the bad blocks which its function comes across.

    They travel with each result, so it does not matter in which thread or process they were come across, or
    on which day, see `resuming`.

    Parameters
    ----------
    map : Map
        Who runs the work.
    found : set of BadBlock
        Grows as results come in.
    """

    def run(
        function: Callable[[Item], Result], items: Sequence[Item], progress: Progress | None = None
    ) -> Generator[Result, None, None]:
        with closing(map(_Listening(function), items, progress)) as results:
            for result, blocks in results:
                found.update(blocks)
                yield result

    return run


@dataclass(frozen=True)
class _Listening:
    """A function that gives the bad blocks which it came across beside its result."""

    function: Callable[[Any], Any]

    def __call__(self, item: Any) -> tuple[Any, tuple[BadBlock, ...]]:
        found: set[BadBlock] = set()
        with recording_bad_blocks(found):
            result = self.function(item)
        return result, tuple(sorted(found))


def read_naming_bad_block(
    file: RasterFile, handles: OpenFiles, choice: BandChoice, window: Window, shape: tuple[int, int]
) -> tuple[Values, Valid | None]:
    """`RasterFile.read`; where it fails, the error names the first block that cannot be read.

    Raises
    ------
    RasterReadError
    """
    try:
        return file.read(handles, choice, window, shape)
    except RasterReadError:
        for block in file.blocks_in(window):
            file.read(handles, choice, block)
        raise


def read_skipping_bad_blocks(
    file: RasterFile, handles: OpenFiles, choice: BandChoice, window: Window, shape: tuple[int, int]
) -> tuple[Values, Valid | None, list[MissingPart]]:
    """`RasterFile.read`, with the pixels of blocks that cannot be read invalid.

    Returns
    -------
    values, valid
        As of `RasterFile.read`.
    bad : list of (BadBlock, (slice, slice))
        The blocks that cannot be read, in raster order, and where they lie in the arrays.
    """
    try:
        if shape != (window.rows, window.cols) or file.fails_by_block:
            return *file.read(handles, choice, window, shape), []
        return *_read_whole_blocks(file, handles, choice, window), []
    except RasterReadError:
        return _read_block_by_block(file, handles, choice, window, shape)


def _read_whole_blocks(
    file: RasterFile, handles: OpenFiles, choice: BandChoice, window: Window
) -> tuple[Values, Valid | None]:
    """A window, if all of each block that it touches can be read."""
    tall, wide = file.block
    row, col = window.row // tall * tall, window.col // wide * wide
    rows = -(-(window.row + window.rows) // tall) * tall - row
    cols = -(-(window.col + window.cols) // wide) * wide - col
    values, valid = file.read(handles, choice, Window(row, col, rows, cols).clipped(file.shape))
    own = Window(window.row - row, window.col - col, window.rows, window.cols).slices
    return values[:, *own], None if valid is None else valid[own]


def _read_block_by_block(
    file: RasterFile, handles: OpenFiles, choice: BandChoice, window: Window, shape: tuple[int, int]
) -> tuple[Values, Valid, list[MissingPart]]:
    rows, cols = _nearest(window.row, window.rows, shape[0]), _nearest(window.col, window.cols, shape[1])
    with gdal_read_errors(file.path, window):
        handles.open(file.path, file.located)  # a file that is gone is no bad block
    values = np.zeros((choice.planes, *shape), choice.dtype)
    valid = np.zeros(shape, bool)
    bad = []
    for block in file.blocks_in(window):
        here = _within(rows, block.row, block.rows), _within(cols, block.col, block.cols)
        if here[0].start == here[0].stop or here[1].start == here[1].stop:
            continue
        try:
            pixels, known = file.read(handles, choice, block)
        except RasterReadError:
            bad.append((BadBlock(file.path, block.row, block.col, block.rows, block.cols), here))
            continue
        wanted = np.ix_(rows[here[0]] - block.row, cols[here[1]] - block.col)
        values[:, here[0], here[1]] = pixels[:, wanted[0], wanted[1]]
        valid[here] = True if known is None else known[wanted]
    return values, valid, bad


def _nearest(start: int, length: int, wanted: int) -> Indices:
    """The nearest of `wanted` evenly spaced rows or columns; each of them where as many are wanted."""
    return start + ((np.arange(wanted) + 0.5) * (length / wanted)).astype(np.int64)


def _within(indices: Indices, start: int, length: int) -> slice:
    first, end = np.searchsorted(indices, [start, start + length]).tolist()
    return slice(first, end)
