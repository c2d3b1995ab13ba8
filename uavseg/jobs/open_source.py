"""Opening of sources: rasters, mosaics, arrays, block maps and maps of probabilities, all recognised here."""

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from affine import Affine

from uavseg.errors import ParameterError, RasterReadError
from uavseg.plain_text import shown
from uavseg.raster.array_source import is_array
from uavseg.raster.dataset import Dataset
from uavseg.raster.geobox import GeoBox
from uavseg.raster.intensity.stretch import Stretch, StretchSpec, fit_stretch, parse_stretch
from uavseg.raster.tiling import TilePass
from uavseg.segmentation.blocks.block_file import Origin, SavedBlocks, is_block_map, read_block_map
from uavseg.segmentation.source import GreySource

if TYPE_CHECKING:
    from uavseg.occupancy.mapping.grid import OccupancyGrid

AUTO = StretchSpec("auto")


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """How a source is read.

    Parameters
    ----------
    band : int, optional
        The band to use, counted from 1.
    rgb : three ints, optional
        The bands of red, green and blue, to use their luminance.
    nodata : float, optional
        Takes the place of the nodata value in the files; NaN is allowed.
    stretch : Stretch, StretchSpec or str, optional
        How intensity becomes v: "auto", "dtype", "minmax", "percentile:P,Q", "none" or "LOW,HIGH". By default
        "auto" for rasters, and for maps of probabilities what follows from their type.
    skip_bad_tiles : bool
        Whether blocks of a file that cannot be read count as nodata.

    Raises
    ------
    ParameterError
        If a text is not a stretch.
    """

    band: int | None = None
    rgb: tuple[int, int, int] | None = None
    nodata: float | None = None
    stretch: Stretch | StretchSpec | str | None = None
    skip_bad_tiles: bool = False

    def __post_init__(self) -> None:
        if isinstance(self.stretch, str):
            object.__setattr__(self, "stretch", parse_stretch(self.stretch))

    @property
    def chooses_pixels(self) -> bool:
        """Whether a band or a nodata value is chosen."""
        return (self.band, self.rgb, self.nodata) != (None, None, None)

    @property
    def spec(self) -> Stretch | StretchSpec | None:
        """The stretch, parsed."""
        assert not isinstance(self.stretch, str), "a text is parsed when the options are made"
        return self.stretch

    def stretches(self, *harmless: str) -> bool:
        """Whether a stretch is chosen, other than these forms."""
        if self.spec is None:
            return False
        return not (isinstance(self.spec, StretchSpec) and self.spec.form in harmless)


@dataclass(frozen=True)
class Pixels:
    """A source whose pixels are read: a raster or a map of probabilities.

    Parameters
    ----------
    dataset : Dataset
    stretch : Stretch or StretchSpec
        How values become v: fitted already, or to be fitted to the pixels.
    """

    dataset: Dataset
    stretch: Stretch | StretchSpec = AUTO

    @property
    def geobox(self) -> GeoBox:
        """Where the pixels lie."""
        return self.dataset.geobox

    @property
    def name(self) -> str:
        """Name of the first file, without folder."""
        return self.dataset.source

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is known of the files that the user should know."""
        return self.dataset.warnings

    def check_resumable(self) -> None:
        """Whether its tiles may be kept in a checkpoint: those of files may."""

    def grey(self, tile_pass: TilePass) -> GreySource:
        """The pixels through their stretch, which is fitted in a pass where it follows from them."""
        return GreySource(self.dataset, fit_stretch(self.dataset, self.stretch, tile_pass))


@dataclass(frozen=True)
class Raster(Pixels):
    """A raster or a mosaic.

    Parameters
    ----------
    options : ReadOptions
        How it was opened.
    given : tuple of str
        Its files as they were named.
    """

    options: ReadOptions = ReadOptions()
    given: tuple[str, ...] = ()

    @property
    def origin(self) -> Origin:
        """What a block map of this raster says it was made from."""
        options = self.options
        return Origin(
            self.given or self.dataset.paths, str(Path.cwd()), options.band, options.rgb, options.nodata
        )


@dataclass(frozen=True)
class ProbabilityMap(Pixels):
    """A map of the probability that a cell is occupied.

    Parameters
    ----------
    is_ros : bool
        Whether it is a ROS map, which is in metres and held in memory.
    """

    is_ros: bool = False

    @property
    def in_metres(self) -> bool:
        """Whether lengths on it are metres rather than units of the map."""
        return self.is_ros or self.geobox.crs is not None

    def check_resumable(self) -> None:
        """Whether its tiles may be kept in a checkpoint.

        Raises
        ------
        ParameterError
            If it is a ROS map.
        """
        if self.is_ros:
            raise ParameterError("a ROS map is read whole, so there is nothing to resume; leave resume out")


@dataclass(frozen=True)
class Blocks:
    """A block map from a file.

    Parameters
    ----------
    saved : SavedBlocks
    path : str
        The file.
    skip_bad_tiles : bool
        How its raster is read.
    """

    saved: SavedBlocks
    path: str
    skip_bad_tiles: bool = False

    @property
    def geobox(self) -> GeoBox:
        """Where the pixels of the raster lie, from which it was made."""
        return self.saved.geobox

    @property
    def name(self) -> str:
        """Name of the first file of that raster, without folder."""
        return self.saved.origin.rasters[0].rsplit("/", 1)[-1]

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the user should know of it: the block map says nothing of its raster's files."""
        return ()

    @cached_property
    def raster(self) -> Raster | None:
        """The raster that it was made from, with the same stretch; None if a file is not where it was."""
        origin = self.saved.origin
        paths = origin.find_rasters(self.path)
        if paths is None:
            return None
        options = ReadOptions(origin.band, origin.rgb, origin.nodata, self.saved.stretch, self.skip_bad_tiles)
        return _raster(paths, options)


Source = Raster | Blocks | ProbabilityMap


def open_source(source: Any, options: ReadOptions = ReadOptions()) -> Source:
    """A source, whatever it is given as; no pixel is read.

    Parameters
    ----------
    source : path, sequence of paths, (rows, cols) array, DataArray, Dataset or OccupancyGrid
        Many paths are one mosaic. A path may name a block map, or the YAML file of a ROS map.
    options : ReadOptions

    Raises
    ------
    RasterReadError
        If a file cannot be opened.
    RasterError, MosaicError, MapError
        If a file is of a kind that cannot be answered correctly, or files do not fit together.
    ParameterError
        If an option does not apply to this kind of source.
    """
    if _is_value(source):
        return _raster(source, options)
    if not _is_path(source):
        if _is_grid(source):
            return _grid(source, options)
        source = _listed(source)
    parts = [source] if _is_path(source) else source
    if any(_is_path(part) and _is_ros_map(part) for part in parts):
        return _ros_map(parts, options)
    if parts and _is_path(parts[0]) and is_block_map(parts[0]):
        return _blocks(parts, options)
    return _raster(source, options)


def open_raster(source: Any, options: ReadOptions = ReadOptions()) -> Raster:
    """A source that has to be a raster; the pixels of a block map's file are one too.

    Raises
    ------
    UavsegError
        As of `open_source`.
    """
    return _raster(source, options)


def open_probability_map(source: Any, options: ReadOptions = ReadOptions()) -> ProbabilityMap | Blocks:
    """A source that holds probabilities; a raster is taken for a map of them.

    Integers are divided by the largest of their type, floats are taken as they are, unless a stretch is
    chosen.

    Raises
    ------
    UavsegError
        As of `open_source`.
    """
    opened = open_source(source, options)
    if not isinstance(opened, Raster):
        return opened
    return ProbabilityMap(opened.dataset, _probability_stretch(opened.dataset, options))


def raster_of(source: Source, refusal: str = "") -> Raster:
    """The source, which has to be a raster.

    Parameters
    ----------
    source : Source
    refusal : str
        The message where it is a block map.

    Raises
    ------
    ParameterError
        If it is a block map.
    RasterReadError
        If it is a map of probabilities that is no raster.
    """
    if isinstance(source, Raster):
        return source
    if isinstance(source, Blocks):
        raise ParameterError(refusal)
    raise RasterReadError(
        f"{source.name} cannot be opened as a raster: it is a map of probabilities, which levels, "
        "classify and path read"
    )


def _is_path(source: Any) -> bool:
    return isinstance(source, str | os.PathLike)


def _is_value(source: Any) -> bool:
    return isinstance(source, Dataset | np.ndarray) or is_array(source)


def _listed(source: Any) -> list[Any]:
    """The parts of a mosaic."""
    if isinstance(source, Iterable) and not isinstance(source, bytes | Mapping):
        parts = list(source)
        if all(_is_path(part) or is_array(part) for part in parts):
            return parts
    raise ParameterError(f"source is a path, a list of paths, an array or a Dataset, not {shown(source)}")


def _is_grid(source: Any) -> bool:
    if isinstance(source, list | tuple):
        return False
    from uavseg.occupancy.mapping.grid import OccupancyGrid

    return isinstance(source, OccupancyGrid)


def _is_ros_map(path: str | os.PathLike[str]) -> bool:
    """As `ros_map.is_ros_map`, which is not loaded for rasters."""
    return Path(path).suffix.lower() in (".yaml", ".yml")


def _raster(source: Any, options: ReadOptions) -> Raster:
    given = [source] if _is_path(source) else source if isinstance(source, list | tuple) else []
    names = tuple(os.fspath(part) for part in given if _is_path(part))
    return Raster(_dataset(source, options), options.spec or AUTO, options, names)


def _dataset(source: Any, options: ReadOptions) -> Dataset:
    if isinstance(source, Dataset):
        return replace(source, skip_bad_tiles=source.skip_bad_tiles or options.skip_bad_tiles)
    if not isinstance(source, np.ndarray):
        return Dataset.open(source, options.band, options.rgb, options.nodata, options.skip_bad_tiles)
    if source.ndim != 2 or source.dtype.kind not in "iuf" or source.size == 0:
        raise ParameterError(f"expected a 2-D array of numbers, got {source.dtype} of shape {source.shape}")
    _check_one_band(options)
    return Dataset.of_values(source, GeoBox(source.shape, Affine.identity(), None), "array")


def _check_one_band(options: ReadOptions) -> None:
    if options.chooses_pixels:
        raise ParameterError("an array has one band and no nodata; what is missing in it is NaN")


def _blocks(parts: Sequence[Any], options: ReadOptions) -> Blocks:
    if len(parts) > 1:
        raise ParameterError(f"{parts[0]} is a block map, which is no part of a mosaic; name it alone")
    if options.chooses_pixels or options.stretches("auto"):
        raise ParameterError("a block map has its bands, nodata and stretch already; leave these options out")
    return Blocks(read_block_map(parts[0]), os.fspath(parts[0]), options.skip_bad_tiles)


def _ros_map(parts: Sequence[Any], options: ReadOptions) -> ProbabilityMap:
    from uavseg.occupancy.probability_map import open_map

    if len(parts) > 1:
        raise ParameterError("a ROS map is no part of a mosaic; name it alone")
    if options.chooses_pixels:
        raise ParameterError("a ROS map has neither bands nor nodata; leave band, rgb and nodata out")
    if options.stretches("auto", "none"):
        raise ParameterError("a ROS map holds probabilities, which are not stretched; leave stretch out")
    return ProbabilityMap(*open_map(parts[0]), is_ros=True)


def _grid(grid: "OccupancyGrid", options: ReadOptions) -> ProbabilityMap:
    _check_one_band(options)
    dataset = grid.dataset()
    return ProbabilityMap(dataset, _probability_stretch(dataset, options))


def _probability_stretch(dataset: Dataset, options: ReadOptions) -> Stretch | StretchSpec:
    from uavseg.occupancy.probability_map import stretch_of

    return options.spec or stretch_of(dataset)
