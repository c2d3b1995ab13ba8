"""The compressed bytes of one block of a TIFF, and which blocks were checked already."""

import re
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rasterio.io import DatasetReader

_PAGE = re.compile(r"GTIFF_DIR:(?:off:)?\d+:(.+)", re.IGNORECASE | re.DOTALL)


def file_of(name: str) -> Path | None:
    """The local file that holds a TIFF, or one of its images; None if it lies in an archive or is remote.

    Examples
    --------
    >>> file_of("GTIFF_DIR:2:pyproject.toml")
    PosixPath('pyproject.toml')
    """
    page = _PAGE.fullmatch(name)
    path = Path(page[1] if page else name)
    return path if path.is_file() else None


@dataclass(frozen=True, slots=True)
class BlockStream:
    """Where the stream of a block lies.

    Parameters
    ----------
    path : Path
        Of the file.
    offset, size : int
        In bytes.
    """

    path: Path
    offset: int
    size: int

    @classmethod
    def of(cls, path: Path, source: DatasetReader, band: int, place: tuple[int, int]) -> "BlockStream | None":
        """That of the block in a row and a column of blocks; None if it is not stored."""
        offset = source.get_tag_item(f"BLOCK_OFFSET_{place[1]}_{place[0]}", "TIFF", bidx=band)
        return None if offset is None else cls(path, int(offset), source.block_size(band, *place))

    def read(self, start: int = 0, most: int | None = None) -> bytes:
        """Its bytes from `start` on, which counts from the end if it is below 0; `most` of them at most."""
        start = start if start >= 0 else max(self.size + start, 0)
        left = self.size - start
        with self.path.open("rb") as file:
            file.seek(self.offset + start)
            return file.read(left if most is None else min(left, most))


def checked_blocks(name: str, path: Path, shape: tuple[int, int, int]) -> NDArray[np.bool_]:
    """Which blocks of an image in a file are known to be right, by plane, row and column; for all threads."""
    about = path.stat()
    return _checked(name, about.st_size, about.st_mtime_ns, shape)


@lru_cache(maxsize=64)
def _checked(name: str, size: int, mtime_ns: int, shape: tuple[int, int, int]) -> NDArray[np.bool_]:
    return np.zeros(shape, bool)
