"""Opening of sources: rasters, mosaics, arrays, block maps and maps of probabilities, all recognised here."""

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uavseg.errors import MapError, ParameterError, RasterReadError, UnchosenBandsError
from uavseg.jobs.source.source import AUTO, Blocks, ProbabilityMap, Raster, Source, open_dataset
from uavseg.options.reading import ReadOptions
from uavseg.plain_text import shown
from uavseg.raster.intensity.stretch import Stretch, StretchSpec
from uavseg.raster.read.dataset import Dataset, is_pixels
from uavseg.raster.read.inspect_file import inspect_unless
from uavseg.raster.read.raster_file import RasterFile
from uavseg.raster.read.source_list import expand_sources, is_list
from uavseg.segmentation.blocks.block_file import is_block_map, read_block_map

if TYPE_CHECKING:
    from uavseg.occupancy.mapping.grid import OccupancyGrid

_PICTURES = (".pgm", ".png", ".bmp", ".jpg", ".jpeg")  # formats of the pictures of ROS maps


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


def open_all_bands(source: Any, options: ReadOptions = ReadOptions()) -> Source:
    """Return a source as `open_source`; where no band has to be chosen, band 1 of many is the intensity."""
    try:
        return open_source(source, options)
    except UnchosenBandsError:
        raster = raster_of(open_source(source, replace(options, band=1)))
        return replace(raster, options=options, all_bands=True)


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
    source = _expanded(source)
    picture = _is_path(source) and Path(source).suffix.lower() in _PICTURES
    if options.free_is_white is not None and not picture:
        raise ParameterError("--free-is-white and --free-is-black are for a picture without its YAML file")
    if picture and options.free_is_white:
        from uavseg.occupancy.map_file import open_white_picture

        if options.chooses_pixels or options.stretches("auto", "none"):
            raise ParameterError("a picture in which free is white has no bands, nodata or stretch to choose")
        return ProbabilityMap(*open_white_picture(source))
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


def map_of(source: ProbabilityMap | Blocks, why: str) -> ProbabilityMap:
    """Return the map itself; refuse a block map with ParameterError."""
    if isinstance(source, Blocks):
        raise ParameterError(f"{source.path} is a block map; {why}")
    return source


def raster_of(source: Source, refusal: str = "") -> Raster:
    """Return the source, a raster; a block map is refused as by `pixels_of`, others by RasterReadError."""
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
    found = [one for part in parts for one in (expand_sources([part]) if _is_path(part) else [part])]
    return found[0] if len(found) == 1 else found


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
    dataset = open_dataset([first, *given[1:]] if first else source, options)
    return Raster(dataset, options.spec or AUTO, options, names)


def _refuse(options: ReadOptions, what: str, *names: str) -> None:
    given = [name for name in names if getattr(options, name) not in (None, False)]
    if given:
        raise ParameterError(f"{what}; leave {' and '.join(given)} out")


def _blocks(parts: Sequence[Any], options: ReadOptions) -> Blocks:
    if len(parts) > 1:
        raise ParameterError(f"{parts[0]} is a block map, which is no part of a mosaic; name it alone")
    if options.chooses_pixels or options.stretches("auto"):
        raise ParameterError("a block map has its bands, nodata and stretch already; leave these options out")
    why = "the light of a block map was taken away when it was made (uavseg divide --flatten), or not"
    _refuse(options, why, "flatten")
    _refuse(
        options, "a block map is answered as a whole (uavseg divide takes these)", "bounds", "aoi", "warp"
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
    _refuse(options, "a ROS map holds probabilities, which have no light", "flatten")
    _refuse(options, "a ROS map is read whole", "bounds", "aoi", "warp")
    return ProbabilityMap(*open_map(parts[0]), ros_map=os.fspath(parts[0]))


def _unknown_polarity(picture: Path) -> str:
    """Tell why a picture alone is refused, with its YAML file if there is one of the same name."""
    beside = [picture.with_suffix(ending) for ending in (".yaml", ".yml")]
    named = [f"{path.name}, which is beside it" for path in beside if path.exists()]
    hint = [*named, "the YAML file of the map"][0]
    return (
        f"{picture.name} is a picture without its YAML file, which says whether free is white or black and "
        f"how large a cell is; give {hint}, or else --free-is-white or --free-is-black"
    )


def _grid(grid: "OccupancyGrid", options: ReadOptions) -> ProbabilityMap:
    if options.chooses_pixels:
        raise ParameterError("a map has one band and no nodata; leave band, rgb and nodata out")
    _refuse(options, "a map holds probabilities, which have no light", "flatten")
    _refuse(options, "a map in memory is read whole", "bounds", "aoi", "warp")
    dataset = grid.dataset()
    chosen = options if options.stretches("auto") else ReadOptions()
    return ProbabilityMap(dataset, _probability_stretch(dataset, chosen))


def _probability_stretch(dataset: Dataset, options: ReadOptions) -> Stretch | StretchSpec:
    from uavseg.occupancy.map_file import stretch_of

    return options.spec or stretch_of(dataset)
