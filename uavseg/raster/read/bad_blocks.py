"""Bad blocks: blocks of damaged files that cannot be read, and the pixels of all other blocks.

A file is decoded in blocks. A window that fails is read again block by block, so the result depends on the
file alone, not on the windows. Each failure costs an opening of the file, of up to 10 ms: one of many blocks
of which none can be read is left out as a whole, as soon as none of some all over it can.
"""

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from contextvars import ContextVar
from dataclasses import replace
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np

from uavseg.dataclass import dataclass
from uavseg.errors import RasterReadError
from uavseg.execution.executors import Item, Map, Progress, Result
from uavseg.raster.access.opening import GDAL_ERRORS, OpenFiles, gdal_env, gdal_read_errors, is_sequential
from uavseg.raster.grid.tiling import Window, indices_within, sample_positions
from uavseg.raster.read.raster_file import RasterFile
from uavseg.raster.spectral.bands import BandChoice, Valid, Values

Slices = tuple[slice, slice]
_MOST_NAMED = 20  # rectangles of bad blocks, one by one
_LOOKED_AT = 1 << 26  # pixels
_MANY = 256  # blocks
_TRIED = 64  # blocks


@dataclass(frozen=True, slots=True, order=True)
class BadBlock:
    """A block of a file that cannot be read: first row and column, and size, in pixels of the file."""

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


def bad_block_warnings(found: Iterable[BadBlock]) -> tuple[str, ...]:
    """Return a sentence for each rectangle of bad blocks; after 20 of them, how many more there are."""
    parts = sorted(_joined(_joined(found, ("row", "col")), ("col", "row")))
    more = len(parts) - _MOST_NAMED
    rest = (f"{more:,} more places cannot be read: their pixels count as nodata",) if more > 0 else ()
    return (*map(str, parts[:_MOST_NAMED]), *rest)


def _joined(blocks: Iterable[BadBlock], axes: tuple[str, str]) -> list[BadBlock]:
    """Join rectangles that agree along the first axis and follow one another along the second."""
    along, across = axes
    length, result = attrgetter(f"{across}s"), list[BadBlock]()
    place = attrgetter("path", along, f"{along}s", across)
    for block in sorted(blocks, key=place):
        *line, start = place(result[-1] if result else block)
        if result and place(block) == (*line, start + length(result[-1])):
            result[-1] = replace(result[-1], **{f"{across}s": length(result[-1]) + length(block)})
        else:
            result.append(block)
    return result


MissingPart = tuple[BadBlock, Any]
"""A block that cannot be read, and its index in the array that is read: slices, or of each pixel."""

_recorder: ContextVar[set[BadBlock] | None] = ContextVar("recorder", default=None)


def record_bad_block(block: BadBlock) -> None:
    """Report to the enclosing `recording_bad_blocks`, if any, that pixels of this block are missing."""
    found = _recorder.get()
    if found is not None:
        found.add(block)


@contextmanager
def recording_bad_blocks(found: set[BadBlock]) -> Iterator[None]:
    """Collect the bad blocks that are found in this context, in this thread."""
    token = _recorder.set(found)
    try:
        yield
    finally:
        _recorder.reset(token)


def with_bad_blocks(map: Map, found: set[BadBlock]) -> Map:
    """Return an executor that also collects the bad blocks which its function finds.

    They are returned with each result, so they are collected from any thread or process, and from results
    that an earlier run saved, see `execution.checkpoint`.

    `found` is updated as results arrive.
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
    """A function that returns its result with the bad blocks that it found."""

    function: Callable[[Any], Any]

    def __call__(self, item: Any) -> tuple[Any, tuple[BadBlock, ...]]:
        found: set[BadBlock] = set()
        with recording_bad_blocks(found), gdal_env():  # once for all that is read
            result = self.function(item)
        return result, tuple(sorted(found))


def read_naming_bad_block(
    file: RasterFile, handles: OpenFiles, choice: BandChoice, window: Window, shape: tuple[int, int]
) -> tuple[Values, Valid | None]:
    """Call `RasterFile.read`; where it fails, the error names the first block that cannot be read.

    That it is the first of the whole file, not of the window, makes the error the same for any tiles. Of a
    large file, only the blocks of the window are looked at.
    """
    try:
        return file.read(handles, choice, window, shape)
    except RasterReadError as error:
        whole = Window(0, 0, *file.shape)
        for block in file.blocks_in(whole if whole.rows * whole.cols <= _LOOKED_AT else window):
            file.read(handles, choice, block)
        if isinstance(error.__cause__, GDAL_ERRORS):  # of no block by itself
            with gdal_read_errors(file.path, whole, file.online):
                raise error.__cause__ from None
        raise


def read_skipping_bad_blocks(
    file: RasterFile, handles: OpenFiles, choice: BandChoice, window: Window, shape: tuple[int, int]
) -> tuple[Values, Valid | None, list[MissingPart]]:
    """Call `RasterFile.read`, with the pixels of bad blocks invalid.

    Besides, the blocks that cannot be read are returned, in raster order, with their index in the arrays.
    """
    bands = tuple(choice.bands)
    if handles.bad_as_a_whole(file.path, bands, partial(_is_bad_as_a_whole, file, handles, choice)):
        whole = BadBlock(file.path, 0, 0, *file.shape), (slice(shape[0]), slice(shape[1]))
        return np.zeros((choice.planes, *shape), choice.dtype), np.zeros(shape, bool), [whole]
    is_sampled = shape != (window.rows, window.cols)
    failed = handles.failed_blocks(file.path, bands)
    if failed:
        failed |= file.cut_off_blocks(handles, choice, window)
        may_fail = len(failed) >= _TRIED and not is_sampled  # a failure costs an opening
        if may_fail or any((block.row, block.col) in failed for block in file.blocks_in(window)):
            return _read_block_by_block(file, handles, choice, window, shape)
    try:
        if is_sampled or file.fails_by_block:
            return *file.read(handles, choice, window, shape), []
        return *_read_whole_blocks(file, handles, choice, window), []
    except RasterReadError:
        failed |= file.cut_off_blocks(handles, choice, window)
        return _read_block_by_block(file, handles, choice, window, shape)


def _is_bad_as_a_whole(file: RasterFile, handles: OpenFiles, choice: BandChoice) -> bool:
    """Return whether a file has many blocks, and none of those that lie evenly all over it can be read."""
    rows, cols = (-(-length // size) for length, size in zip(file.shape, file.block, strict=True))
    count = rows * cols
    if count <= _MANY:
        return False
    with gdal_read_errors(file.path, Window(0, 0, *file.shape), file.online):
        handles.open(file.path, file.located, file.driver)  # a missing file is an error, not a bad block
    for k in range(_TRIED):
        row, col = divmod(k * (count - 1) // (_TRIED - 1), cols)  # the first and the last, and between
        block = Window(row * file.block[0], col * file.block[1], *file.block).clipped(file.shape)
        try:
            file.read(handles, choice, block)
        except RasterReadError:
            continue
        return False
    return True


def _read_whole_blocks(
    file: RasterFile, handles: OpenFiles, choice: BandChoice, window: Window
) -> tuple[Values, Valid | None]:
    """Return a window, read together with the rest of all blocks that it intersects."""
    (rows, cols), (down, across) = file.block, window.blocks(*file.block)
    size = (down.stop - down.start) * rows, (across.stop - across.start) * cols
    whole = Window(down.start * rows, across.start * cols, *size).clipped(file.shape)
    values, valid = file.read(handles, choice, whole)
    own = window.relative_to(whole).slices
    return values[:, *own], None if valid is None else valid[own]


def _read_block_by_block(
    file: RasterFile, handles: OpenFiles, choice: BandChoice, window: Window, shape: tuple[int, int]
) -> tuple[Values, Valid, list[MissingPart]]:
    rows = sample_positions(window.row, window.rows, shape[0])
    cols = sample_positions(window.col, window.cols, shape[1])
    with gdal_read_errors(file.path, window, file.online):
        handles.open(file.path, file.located, file.driver)  # a missing file is an error, not a bad block
    values = np.zeros((choice.planes, *shape), choice.dtype)
    valid = np.zeros(shape, bool)
    bad, failed = [], handles.failed_blocks(file.path, tuple(choice.bands))
    for block in file.blocks_in(window):
        here = indices_within(rows, block.row, block.rows), indices_within(cols, block.col, block.cols)
        if here[0].start == here[0].stop or here[1].start == here[1].stop:
            continue
        part = block.common(window) if file.fails_by_block else block
        try:
            if (block.row, block.col) not in failed:
                pixels, known = file.read(handles, choice, part)
        except RasterReadError:
            failed.add((block.row, block.col))
            if is_sequential(file.driver):
                below = Window(block.row, 0, file.shape[0] - block.row, file.shape[1])
                failed.update((later.row, later.col) for later in file.blocks_in(below))
        if (block.row, block.col) in failed:
            bad.append((BadBlock(file.path, block.row, block.col, block.rows, block.cols), here))
            continue
        sampled = np.ix_(rows[here[0]] - part.row, cols[here[1]] - part.col)
        values[:, here[0], here[1]] = pixels[:, sampled[0], sampled[1]]
        valid[here] = True if known is None else known[sampled]
    return values, valid, bad
