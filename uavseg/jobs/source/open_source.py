"""Opening of sources: rasters, mosaics, arrays, block maps, maps of probabilities; files that a job reads."""

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uavseg.access import current_policy
from uavseg.arrays import Path_
from uavseg.errors import MapError, ParameterError, RasterReadError, UavsegError
from uavseg.jobs.source.source import AUTO, Blocks, ProbabilityMap, Raster, Source
from uavseg.options.reading import ReadOptions
from uavseg.output.targets import check_not_inputs, existing_files
from uavseg.plain_text import shown
from uavseg.raster.access.open_checked import open_checked
from uavseg.raster.access.opening import GDAL_ERRORS, is_remote
from uavseg.raster.intensity.stretch import Stretch, StretchSpec
from uavseg.raster.read.dataset import Dataset, is_pixels
from uavseg.raster.read.inspect_file import inspect_unless
from uavseg.raster.read.raster_file import RasterFile
from uavseg.raster.read.source_list import expand_sources, is_list
from uavseg.segmentation.blocks.block_file import is_block_map, read_block_map

if TYPE_CHECKING:
    from uavseg.occupancy.mapping.grid import OccupancyGrid

_PICTURES = (".pgm", ".png", ".bmp", ".jpg", ".jpeg")  # formats of the pictures of ROS maps
_ROS = (".yaml", ".yml")


def open_source(source: Any, options: ReadOptions = ReadOptions()) -> Source:
    """Return a source, whatever it is given as; no pixel is read.

    It is a path, an array, a DataArray, an open raster of rasterio, a sequence of these, a Dataset or an
    OccupancyGrid. Many are one mosaic. A path may name a block map, the YAML file of a ROS map, or several
    rasters, see `expand_sources`. A RasterReadError says that a file cannot be opened, a RasterError,
    MosaicError or MapError that one is of a kind that cannot be answered correctly, or that files do not fit
    together, a ParameterError that an option does not apply to this kind of source.
    """
    if not _is_path(source):
        if isinstance(source, Dataset) or is_pixels(source):
            return _raster(source, options)
        if _is_grid(source):
            return _grid(source, options)
        source = _listed(source)
    source = _expanded(source)
    parts = [source] if _is_path(source) else source
    if any(_is_path(part) and _is_ros_map(part) for part in parts):
        return _ros_map(parts, options)
    if not (parts and _is_path(parts[0])):
        return _raster(source, options)
    first = inspect_unless(parts[0], is_block_map)
    return _blocks(parts, options) if first is None else _raster(source, options, first)


def open_raster(source: Any, options: ReadOptions = ReadOptions()) -> Raster:
    """Return a source that has to be a raster; the pixels of a block map's file are one too."""
    return _raster(_expanded(source), options)


def open_pixels(source: Any, options: ReadOptions = ReadOptions()) -> Raster | ProbabilityMap:
    """Return a raster, or the YAML file of a ROS map; the pixels of a block map's file are a raster too."""
    parts = [source] if _is_path(source) else source if isinstance(source, list | tuple) else []
    if any(_is_path(part) and _is_ros_map(part) for part in parts):
        return _ros_map(parts, options)
    return open_raster(source, options)


def open_probability_map(source: Any, options: ReadOptions = ReadOptions()) -> ProbabilityMap | Blocks:
    """Return a source that holds probabilities; a raster is taken for a map of them.

    Integers are divided by the largest of their type, floats are taken as they are, unless a stretch is
    chosen. A picture (PGM, PNG, ...) does not say whether free is white or black, so that has to be chosen:
    MapError is raised if it is given without its YAML file and this is not said.
    """
    picture = _is_path(source) and Path(source).suffix.lower() in _PICTURES
    if options.free_is_white is not None and not picture:
        raise ParameterError("--free-is-white and --free-is-black are for a picture without its YAML file")
    if picture and options.free_is_white:
        return _white_picture(source, options)
    opened = open_source(source, options)
    if not isinstance(opened, Raster):
        return opened
    if picture and options.free_is_white is None and opened.geobox.crs is None:
        raise MapError(_unknown_polarity(Path(source)))
    return ProbabilityMap(opened.dataset, _probability_stretch(opened.dataset, options))


def pixels_of(source: Source, refusal: str = "") -> Raster | ProbabilityMap:
    """Return the source, which has to have pixels; refuse a block map with ParameterError."""
    if isinstance(source, Blocks):
        raise ParameterError(refusal)
    return source


def raster_of(source: Source, refusal: str = "") -> Raster:
    """Return the source, which has to be a raster; a block map is refused as by `pixels_of`.

    RasterReadError is raised if it is a map of probabilities that is no raster.
    """
    pixels = pixels_of(source, refusal)
    if isinstance(pixels, Raster):
        return pixels
    raise RasterReadError(
        f"{pixels.name} cannot be opened as a raster: it is a map of probabilities, which levels, "
        "classify and path read"
    )


def _is_path(source: Any) -> bool:
    return isinstance(source, str | os.PathLike)


def _listed(source: Any) -> list[Any]:
    if isinstance(source, Iterable) and not isinstance(source, bytes | Mapping):
        parts = list(source)
        if all(_is_path(part) or is_pixels(part) for part in parts):
            return parts
    raise ParameterError(
        f"source is a path, a list of paths, an array, an open raster or a Dataset, not {shown(source)}"
    )


def _expanded(source: Any) -> Any:
    """Return a source in which each path names one file."""
    parts = [source] if _is_path(source) else source
    if not isinstance(parts, list | tuple) or not any(_is_path(part) and is_list(part) for part in parts):
        return source
    return [one for part in parts for one in (expand_sources([part]) if _is_path(part) else [part])]


def _is_grid(source: Any) -> bool:
    if isinstance(source, list | tuple):
        return False
    from uavseg.occupancy.mapping.grid import OccupancyGrid

    return isinstance(source, OccupancyGrid)


def _is_ros_map(path: str | os.PathLike[str]) -> bool:
    """Do as `ros_map.is_ros_map`, which is not loaded for rasters."""
    return Path(path).suffix.lower() in (".yaml", ".yml")


def _raster(source: Any, options: ReadOptions, first: RasterFile | None = None) -> Raster:
    """Open a raster, of which the first file may be inspected already."""
    given = [source] if _is_path(source) else source if isinstance(source, list | tuple) else []
    names = tuple(os.fspath(part) for part in given if _is_path(part))
    dataset = _dataset([first, *given[1:]] if first else source, options)
    return Raster(dataset, options.spec or AUTO, options, names)


def _dataset(source: Any, options: ReadOptions) -> Dataset:
    if isinstance(source, Dataset):
        return replace(source, skip_bad_tiles=source.skip_bad_tiles or options.skip_bad_tiles)
    return options.open(source)


def _refuse_flatten(options: ReadOptions, what: str) -> None:
    if options.flatten is not None:
        raise ParameterError(f"{what}; leave flatten out")


def _blocks(parts: Sequence[Any], options: ReadOptions) -> Blocks:
    if len(parts) > 1:
        raise ParameterError(f"{parts[0]} is a block map, which is no part of a mosaic; name it alone")
    if options.chooses_pixels or options.stretches("auto"):
        raise ParameterError("a block map has its bands, nodata and stretch already; leave these options out")
    _refuse_flatten(
        options, "the light of a block map was taken away when it was made (uavseg divide --flatten), or not"
    )
    return Blocks(read_block_map(parts[0]), os.fspath(parts[0]), options.skip_bad_tiles)


def _ros_map(parts: Sequence[Any], options: ReadOptions) -> ProbabilityMap:
    from uavseg.occupancy.map_file import open_map

    if len(parts) > 1:
        raise ParameterError("a ROS map is no part of a mosaic; name it alone")
    if options.chooses_pixels:
        raise ParameterError("a ROS map has neither bands nor nodata; leave band, rgb and nodata out")
    if options.stretches("auto", "none"):
        raise ParameterError("a ROS map holds probabilities, which are not stretched; leave stretch out")
    _refuse_flatten(options, "a ROS map holds probabilities, which have no light")
    return ProbabilityMap(*open_map(parts[0]), ros_map=os.fspath(parts[0]))


def _white_picture(source: Any, options: ReadOptions) -> ProbabilityMap:
    from uavseg.occupancy.map_file import open_white_picture

    if options.chooses_pixels or options.stretches("auto", "none"):
        raise ParameterError("a picture in which free is white has no bands, nodata or stretch to choose")
    return ProbabilityMap(*open_white_picture(source))


def _unknown_polarity(picture: Path) -> str:
    """Tell why a picture alone is refused, with its YAML file if there is one of the same name."""
    described = next(
        (path for ending in (".yaml", ".yml") if (path := picture.with_suffix(ending)).exists()), None
    )
    hint = "the YAML file of the map" if described is None else f"{described.name}, which is beside it"
    return (
        f"{picture.name} is a picture without its YAML file, which says whether free is white or black and "
        f"how large a cell is; give {hint}, or else --free-is-white or --free-is-black"
    )


def _grid(grid: "OccupancyGrid", options: ReadOptions) -> ProbabilityMap:
    if options.chooses_pixels:
        raise ParameterError("a map has one band and no nodata; leave band, rgb and nodata out")
    _refuse_flatten(options, "a map holds probabilities, which have no light")
    dataset = grid.dataset()
    chosen = options if options.stretches("auto") else ReadOptions()
    return ProbabilityMap(dataset, _probability_stretch(dataset, chosen))


def _probability_stretch(dataset: Dataset, options: ReadOptions) -> Stretch | StretchSpec:
    from uavseg.occupancy.map_file import stretch_of

    return options.spec or stretch_of(dataset)


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
            yield from _named(given)
        elif isinstance(given, list | tuple):
            yield from _paths(given)


def _named(path: Path_) -> list[str]:
    """Return the files that a path stands for."""
    try:
        return expand_sources([path])
    except UavsegError:
        return [os.fspath(path)]  # the error is reported when it is opened


def _files_read(path: str) -> list[str]:
    suffix = Path(path).suffix.lower()
    if suffix in _ROS:
        return [path, *_ros_image(path)]
    if not Path(path).is_file():
        return [path]
    files, tags = raster_files(path)
    return [*files, *_block_map_rasters(path, tags)]


def _ros_image(path: str) -> list[str]:
    from uavseg.occupancy.ros.ros_yaml import read_ros_yaml

    try:
        return [os.fspath(read_ros_yaml(path).image)]
    except UavsegError:
        return []  # the error is reported when the map is opened


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
