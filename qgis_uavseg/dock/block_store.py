"""Where block maps of the dock lie: beside the raster, or in a cache where its folder cannot be written."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from qgis.core import QgsApplication

SUFFIX = ".uavseg-blocks.tif"
KEPT = 20
"""Block maps in the cache; the ones that were used longest ago are removed."""


def block_file(raster: Path, choice: str = "") -> Path:
    """The file of a raster's block map.

    Parameters
    ----------
    raster : path
    choice : str
        What is read of it, see `Intensity.key`; empty for what the program takes by itself.
    """
    name = raster.stem + (f".{choice}" if choice else "") + SUFFIX
    beside = raster.with_name(name)
    if beside.is_file() or os.access(raster.parent, os.W_OK):
        return beside
    key = hashlib.sha256(os.fsencode(raster.absolute())).hexdigest()[:16]
    return cache_folder() / f"{key}.{name}"


def cache_folder() -> Path:
    """The folder of block maps whose rasters lie in folders that cannot be written."""
    return Path(QgsApplication.qgisSettingsDirPath()) / "uavseg" / "blocks"


def is_fresh(blocks: Path, raster: Path) -> bool:
    """Whether a block map is there, and its raster was neither written nor replaced since.

    A copy may keep the time of its original, so the time at which its name or properties changed counts, too.
    """
    if not blocks.is_file():
        return False
    state = raster.stat()
    return blocks.stat().st_mtime_ns >= max(state.st_mtime_ns, state.st_ctime_ns)


def make_room(folder: Path) -> None:
    """Make the cache, and remove the oldest files of it beyond `KEPT`."""
    folder.mkdir(parents=True, exist_ok=True)
    files = sorted(folder.glob(f"*{SUFFIX}"), key=lambda path: path.stat().st_mtime_ns, reverse=True)
    most = KEPT - 1
    for path in files[most:]:
        path.unlink(missing_ok=True)
