"""Rasters that a caller opened with rasterio: a file that it names, or else read through their handle."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import rasterio
from rasterio.io import DatasetReader, MemoryFile
from rasterio.vrt import WarpedVRT

from uavseg.errors import ParameterError, RasterReadError
from uavseg.raster.access.opening import OpenFiles
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.inspect_file import inspect_file, inspect_open
from uavseg.raster.read.raster_file import RasterFile
from uavseg.raster.spectral.bands import BandChoice, Valid, Values


class Handle(OpenFiles):
    """An open raster in the place of a pool of open files; one thread at a time reads it."""

    def __init__(self, source: DatasetReader) -> None:
        super().__init__()
        self.source = source
        self.lock = threading.Lock()

    def open(self, path: str, _located: bool, _driver: str | None = None, _masks: str = "") -> DatasetReader:
        """The raster.

        Raises
        ------
        RasterReadError
            If it was closed.
        """
        if self.source.closed:
            raise RasterReadError(f"{path} was closed; keep it open, or give its path")
        return self.source

    def close(self, _path: str) -> None:
        """Nothing: it belongs to whoever opened it."""


@dataclass(frozen=True, slots=True)
class OpenRaster(RasterFile):
    """Metadata of an open raster, and its handle."""

    handle: Handle | None = None

    def __reduce__(self) -> tuple[Callable[..., RasterFile], tuple[Any, ...]]:
        raise ParameterError(f"{self.path} is an open raster, which no other process can read; give its path")

    @property
    def name(self) -> str:
        """The last part of the path."""
        return Path(self.path).name

    def fingerprint(self) -> Any:
        """Refused: what is open cannot be recognised in another run.

        Raises
        ------
        ParameterError
            Always.
        """
        raise ParameterError(
            f"{self.path} is open, and cannot be checked for changes; to resume, give its path"
        )

    def read(
        self, _handles: OpenFiles, choice: BandChoice, window: Window, shape: tuple[int, int] | None = None
    ) -> tuple[Values, Valid | None]:
        """As of `RasterFile`."""
        assert self.handle is not None, "given when it is made"
        with self.handle.lock:
            return RasterFile.read(self, self.handle, choice, window, shape)


def is_open_raster(source: object) -> bool:
    """Whether a source is a raster that is open in rasterio."""
    return isinstance(source, rasterio.DatasetReader | WarpedVRT | MemoryFile) or hasattr(
        source, "block_shapes"
    )


def from_open_raster(source: Any) -> RasterFile:
    """The file that an open raster names, where that is the same raster; else the raster itself.

    Raises
    ------
    ParameterError
        If it is closed, or open for writing.
    UavsegError
        As of `inspect_file`.
    """
    if isinstance(source, MemoryFile):
        raise ParameterError("a MemoryFile is no raster yet; open it, and give what its open() returns")
    if source.closed:
        raise ParameterError(f"{source.name} is closed; give its path, or a raster that is open")
    if source.mode != "r":
        raise ParameterError(f"{source.name} is open for writing; close it, and give its path")
    found = inspect_open(source)
    if not isinstance(source, WarpedVRT) and Path(source.name).is_file():
        named = inspect_file(source.name)
        same = ("shape", "transform", "crs", "layout", "nodatas", "masks", "palette", "scales")
        if all(getattr(named, one) == getattr(found, one) for one in same):
            return named
    values = {one.name: getattr(found, one.name) for one in fields(found)} | {"driver": "rasterio"}
    return OpenRaster(**values, handle=Handle(source))
