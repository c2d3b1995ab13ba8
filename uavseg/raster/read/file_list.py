"""Files of a raster: those that GDAL reads for it, such as the sources of a VRT and files of overviews."""

import os
from contextlib import suppress
from pathlib import Path

from uavseg.errors import UavsegError
from uavseg.raster.access.open_checked import open_checked
from uavseg.raster.access.opening import GDAL_ERRORS, is_remote


def raster_files(path: str | os.PathLike[str]) -> tuple[list[str], dict[str, str]]:
    """Return local files that are read for a raster, itself first, and its tags.

    A VRT of VRTs has the files of all of them. If it cannot be opened, it is alone, and has no tags.
    """
    found: dict[str, None] = {}
    tags: dict[str, str] = {}
    waiting = [os.fspath(path)]
    while waiting:
        name = waiting.pop()
        if name in found or is_remote(name):
            continue
        found[name] = None
        if name == os.fspath(path) or Path(name).suffix.lower() == ".vrt":
            # An error is reported when the raster is opened for its pixels.
            with suppress(*GDAL_ERRORS, UavsegError), open_checked(name) as file:
                waiting += reversed(file.files)
                tags = file.tags() if name == os.fspath(path) else tags
    return list(found), tags
