"""Files that a job reads, so that no output replaces one of them."""

import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from uavseg.access import current_policy
from uavseg.arrays import Path_
from uavseg.errors import UavsegError
from uavseg.output.targets import check_not_inputs, existing_files
from uavseg.raster.access.open_checked import open_checked
from uavseg.raster.access.opening import GDAL_ERRORS, is_remote
from uavseg.raster.read.source_list import expand_sources, item_and_asset


def keep_inputs(outputs: Iterable[Path_ | None], inputs: Iterable[Any]) -> None:
    """Check that no output would replace a file that is read, before the work; refuse it with OutputError.

    Of sources as they were given, paths count, with the files that they name (the sources of a VRT, the image
    of a ROS map, the rasters of a block map).
    """
    named = [path for path in outputs if path is not None and path != "-"]
    if there := [path for path in named if existing_files(Path(os.path.realpath(path)))]:
        check_not_inputs(there, [name for given in _paths(inputs) for name in _files_read(given)])


def _paths(inputs: Iterable[Any]) -> Iterator[str]:
    for given in inputs:
        if isinstance(given, str | os.PathLike):
            yield from (item_and_asset(os.fspath(given)) or ())[:1]
            try:
                yield from expand_sources([given])
            except UavsegError:
                yield os.fspath(given)  # the error is reported when it is opened
        elif isinstance(given, list | tuple):
            yield from _paths(given)


def _files_read(path: str) -> list[str]:
    if Path(path).suffix.lower() in (".yaml", ".yml"):
        from uavseg.occupancy.ros.ros_map import read_ros_yaml

        with suppress(UavsegError):  # it is reported when the map is opened
            return [path, os.fspath(read_ros_yaml(path).image)]
    if not Path(path).is_file():
        return [path]
    files, tags = raster_files(path)
    return [*files, *_block_map_rasters(path, tags)]


def _block_map_rasters(path: str, tags: Mapping[str, str]) -> list[str]:
    from uavseg.segmentation.blocks.block_file import rasters_of

    result = []
    for raster in rasters_of(path, tags):
        try:
            current_policy().check_name(path, raster, Path())
        except UavsegError:
            result.append(raster)  # it is not opened, and so not replaced either
        else:
            result += raster_files(raster)[0]
    return result


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
