"""Files of a raster: those that GDAL reads for it, such as the sources of a VRT and files of overviews."""

import os
from pathlib import Path

from uavseg.errors import UavsegError
from uavseg.raster.access.open_checked import open_checked
from uavseg.raster.access.opening import GDAL_ERRORS, is_remote


def raster_files(path: str | os.PathLike[str]) -> list[str]:
    """Return local files that are read for a raster, itself first; itself alone if it cannot be opened.

    A VRT of VRTs has the files of all of them.
    """
    found: dict[str, None] = {}
    waiting = [os.fspath(path)]
    while waiting:
        name = waiting.pop()
        if name in found or is_remote(name):
            continue
        found[name] = None
        if name == os.fspath(path) or Path(name).suffix.lower() == ".vrt":
            waiting += reversed(_listed(name))
    return list(found)


def _listed(path: str) -> list[str]:
    try:
        with open_checked(path) as file:
            return list(file.files)
    except (*GDAL_ERRORS, UavsegError):
        return []  # the error is reported when the raster is opened for its pixels
