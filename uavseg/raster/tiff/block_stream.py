"""The compressed bytes of one block of a TIFF, and which blocks were checked already."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rasterio.io import DatasetReader


@dataclass(frozen=True, slots=True)
class BlockStream:
    """Where the stream of a block lies.

    Parameters
    ----------
    path : str
    offset, size : int
        In bytes.
    """

    path: str
    offset: int
    size: int

    @classmethod
    def of(cls, path: str, source: DatasetReader, band: int, place: tuple[int, int]) -> "BlockStream | None":
        """That of the block in a row and a column of blocks; None if it is not stored."""
        offset = source.get_tag_item(f"BLOCK_OFFSET_{place[1]}_{place[0]}", "TIFF", bidx=band)
        return None if offset is None else cls(path, int(offset), source.block_size(band, *place))

    def read(self, start: int = 0, most: int | None = None) -> bytes:
        """Its bytes from `start` on, which counts from the end if it is below 0; `most` of them at most."""
        start = start if start >= 0 else max(self.size + start, 0)
        left = self.size - start
        with Path(self.path).open("rb") as file:
            file.seek(self.offset + start)
            return file.read(left if most is None else min(left, most))


def checked_blocks(path: str, shape: tuple[int, int, int]) -> NDArray[np.bool_]:
    """Which blocks of a file are known to be right, by plane, row and column; shared by all threads."""
    about = Path(path).stat()
    return _checked(path, about.st_size, about.st_mtime_ns, shape)


@lru_cache(maxsize=64)
def _checked(path: str, size: int, mtime_ns: int, shape: tuple[int, int, int]) -> NDArray[np.bool_]:
    return np.zeros(shape, bool)
