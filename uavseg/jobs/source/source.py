"""Sources of jobs as values: a raster, a block map or a map of probabilities; lengths; a check for change."""

from dataclasses import field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, RasterError
from uavseg.execution.executors import decided, phase
from uavseg.options.reading import ReadOptions
from uavseg.raster.collar.find import without_collar
from uavseg.raster.grid.geobox import GeoBox, Length
from uavseg.raster.grid.ground import ground_resolution
from uavseg.raster.grid.tiling import TilePass, Window, window_cells
from uavseg.raster.intensity.stretch import Stretch, StretchSpec, fit_stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.segmentation.blocks.block_file import Origin, SavedBlocks
from uavseg.segmentation.blocks.block_map import BlockMap, cell_sums
from uavseg.segmentation.refine.detail import MAX_DETAIL, Detail
from uavseg.segmentation.source import GreySource, measure_illumination
from uavseg.units import BLOCK, GREY_MAX

SAMPLED = 64  # blocks of 64 x 64 pixels that are read
_MOVED_PIXELS = 0.1  # what writing and reading a georeference may change, and more
_AGAIN = "make the block map again with uavseg divide, or give --refine none"


def detail_of(length: Length | None, geobox: GeoBox, refine: str, cover: bool = False) -> Detail | None:
    """Return a length in whole pixels along columns and rows, at the centre of a raster; None without one.

    With the refinement "none" regions end at cells, and no detail applies. For `cover` see `Detail`. A
    ParameterError says that regions are not refined to the pixel, that metres are given and there is no CRS,
    or that the length is more than 128 pixels, or less than two, so that it would change nothing.
    """
    if length is None:
        return None
    if refine == "none":
        raise ParameterError(
            "a detail is decided to the pixel, and these regions end at block edges; leave --detail out, "
            "or refine to the pixel"
        )
    rows, cols = in_pixels(length, geobox)
    if max(rows, cols) < 2:
        raise ParameterError(
            f"a detail of {length} is less than two pixels of the raster, so it would change nothing; "
            "give a larger one"
        )
    if max(rows, cols) > MAX_DETAIL:
        raise ParameterError(
            f"a detail of {length} is {max(rows, cols):,} pixels of the raster, and at most {MAX_DETAIL} are "
            "possible; give a smaller one, or a coarser raster"
        )
    return Detail(rows, cols, cover)


def refuse_at_cells(length: Length | None, refine: str) -> None:
    """Refuse a detail, or a refinement by the values of pixels, where there is a block map alone."""
    if refine == "pixels":
        raise ParameterError(
            "--refine pixels takes every pixel by its own value, and the raster of this block map is not "
            "where it was; put it there, or leave --refine out"
        )
    if length is not None:
        raise ParameterError(
            "a detail is decided to the pixel, and regions from this block map end at block edges; leave "
            "--detail out, or give the raster"
        )


def in_pixels(length: Length, geobox: GeoBox) -> tuple[int, int]:
    """Return the nearest whole rows and columns, at least 1; ParameterError for metres without a CRS."""
    if length.in_pixels:
        along_row = along_col = 1.0
    elif geobox.crs is None:
        raise ParameterError(
            "the raster has no CRS, so there are no metres; give the length in pixels, "
            f"such as {length.value:g}px"
        )
    else:
        along_row, along_col = ground_resolution(geobox)
    pixels = length.value / along_col, length.value / along_row
    rows, cols = (max(int(min(count, 1e9) + 0.5), 1) for count in pixels)
    return rows, cols


MIN_WIDTH, MAX_WIDTH = 32, 32768  # pixels


def flatten_width(length: Length, geobox: GeoBox) -> tuple[int, int]:
    """Return the width of a flat field in whole rows and columns of pixels, at the centre of a raster.

    A ParameterError says that metres are given and there is no CRS, or that the width is less than 32 pixels
    or more than 32768.
    """
    rows, cols = in_pixels(length, geobox)
    if min(rows, cols) < MIN_WIDTH:
        raise ParameterError(
            f"a flat field of {length} is {min(rows, cols)} pixels of the raster, and at least {MIN_WIDTH} "
            "are needed, several times the width of what is sought; give a larger one"
        )
    if max(rows, cols) > MAX_WIDTH:
        raise ParameterError(
            f"a flat field of {length} is {max(rows, cols):,} pixels of it, and at most {MAX_WIDTH:,} "
            "are possible; give a smaller one, or leave --flatten out"
        )
    return rows, cols


def flattened(grey: GreySource, length: Length, tile_pass: TilePass) -> GreySource:
    """Return grey without its slow light, which is measured in one pass; see `flatten_width` for errors."""
    width = flatten_width(length, grey.dataset.geobox)
    with phase("flat field"):
        found = measure_illumination(grey, width, tile_pass)
    decided(
        "light of %d x %d squares of %d pixels, v %.4f to %.4f, becomes %.4f",
        *found.nodes.shape,
        found.step,
        *(value / GREY_MAX for value in (int(found.nodes.min()), int(found.nodes.max()), found.target)),
    )
    return replace(grey, illumination=found)


AUTO = StretchSpec("auto")


@dataclass(frozen=True)
class Pixels:
    """A raster or map of probabilities, whose pixels are read; its `stretch` is fitted, or to be fitted."""

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

    @property
    def in_metres(self) -> bool:
        """Whether lengths on it are metres rather than units of the map."""
        return self.dataset.in_metres

    def check_resumable(self) -> None:
        """Refuse a checkpoint where tiles come from no file."""

    def cleaned(self, tile_pass: TilePass) -> Dataset:
        """The pixels without the collar of a raster, which is searched for by the executor of a pass."""
        return self.dataset

    def grey(self, tile_pass: TilePass) -> GreySource:
        """Return the pixels through their stretch, which is fitted in a pass where it follows from them."""
        dataset = self.cleaned(tile_pass)
        with phase("stretch"):
            fitted = fit_stretch(dataset, self.stretch, tile_pass)
        decided("%s, stretch %s", dataset.band_names, fitted.name)
        return GreySource(dataset, fitted)


@dataclass(frozen=True)
class Raster(Pixels):
    """A raster or a mosaic: how it was opened, and its files as they were named."""

    options: ReadOptions = ReadOptions()
    given: tuple[str, ...] = ()
    all_bands: bool = False  # it has more than four, and none was chosen as the intensity
    _cleaned: list[Dataset] = field(default_factory=list, repr=False, compare=False)

    def cleaned(self, tile_pass: TilePass) -> Dataset:
        """As of `Pixels`; the search is done once."""
        if self.options.collar == "keep":
            return self.dataset
        if not self._cleaned:
            with phase("collar"):
                self._cleaned.append(without_collar(self.dataset, tile_pass))
        return self._cleaned[0]

    def grey(self, tile_pass: TilePass) -> GreySource:
        """As of `Pixels`; without slow light where that was chosen."""
        length = self.options.flat_field
        if length is None:
            return super().grey(tile_pass)
        flatten_width(length, self.geobox)  # refused before any work
        stretching, measuring = tile_pass.stages(2)
        return flattened(super().grey(stretching), length, measuring)

    @property
    def origin(self) -> Origin:
        """What a block map of this raster says it was made from."""
        found = any(dataset.collar is not None for dataset in self._cleaned)
        options, bands = self.options, self.dataset.bands
        colors = (bands[0], bands[1], bands[2]) if len(bands) == 3 else None
        return Origin(
            rasters=self.given or self.dataset.paths,
            folder=str(Path.cwd()),
            band=None if options.band is None else bands[0],
            rgb=None if options.rgb is None else colors,
            nodata=options.nodata,
            words=options.formula,
            collar="auto" if found else "keep",
            flatten=None if options.flat_field is None else options.flat_field.word,
            bounds=options.bounds,
            aoi=None if options.aoi is None else str(options.aoi),
            warp=options.warp,
        )


@dataclass(frozen=True)
class ProbabilityMap(Pixels):
    """A map of the probability that a cell is occupied.

    `ros_map` is the YAML file of a ROS map, which is in metres and held in memory; empty for other maps.
    """

    ros_map: str = ""

    @property
    def origin(self) -> Origin:
        """What a block map of this map says it was made from."""
        return Origin((self.ros_map or self.name,), str(Path.cwd()))

    def check_resumable(self) -> None:
        """Refuse a checkpoint for a ROS map with ParameterError."""
        if self.ros_map:
            raise ParameterError("a ROS map is read whole, so there is nothing to resume; leave resume out")


@dataclass(frozen=True)
class Blocks:
    """A block map from a file; `skip_bad_tiles` is how its raster is read."""

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

    def grey(self, raster: Pixels, tile_pass: TilePass) -> GreySource:
        """Return the pixels of its raster, as it was made from them."""
        assert isinstance(raster.stretch, Stretch), "that of the block map, or of a map of probabilities"
        cleaned = raster.cleaned(tile_pass.silent)
        return GreySource(cleaned, raster.stretch, illumination=self.saved.illumination)

    @cached_property
    def raster(self) -> Raster | ProbabilityMap | None:
        """The raster that it was made from, with the same stretch; None if a file is not where it was."""
        from uavseg.occupancy.map_file import open_map
        from uavseg.occupancy.ros.ros_map import is_ros_map

        origin = self.saved.origin
        paths = origin.allowed_rasters(self.path)
        if paths is None:
            return None
        if is_ros_map(paths[0]):
            return ProbabilityMap(*open_map(paths[0]), ros_map=paths[0])
        stretch, words = self.saved.stretch, origin.words
        names = ("band", "rgb", "nodata", "collar", "bounds", "warp")
        chosen: dict[str, Any] = {name: getattr(origin, name) for name in names}
        if origin.aoi is not None:
            *paths, chosen["aoi"] = paths
        chosen |= {"index": words.index, "expr": words.expr, "band_names": words.names}
        options = ReadOptions(**chosen, stretch=stretch, skip_bad_tiles=self.skip_bad_tiles)
        return Raster(open_dataset(paths, options), stretch, options, tuple(paths))


Source = Raster | Blocks | ProbabilityMap


def open_dataset(source: Any, options: ReadOptions) -> Dataset:
    """Open rasters with options, or take a dataset, and cut out the part of it that these say."""
    if isinstance(source, Dataset):
        dataset = replace(source, skip_bad_tiles=source.skip_bad_tiles or options.skip_bad_tiles)
    else:
        dataset = options.open(source)
    if options.bounds is None and options.aoi is None:
        return dataset
    from uavseg.jobs.source.clip import clipped

    return clipped(dataset, options)


def check_unchanged(grey: GreySource, source: Blocks) -> None:
    """Check size, place and a sample of the pixels of a raster, in its stretch, against its block map.

    The block map itself is what pixels are compared with: the sums and counts of the cells of up to 64
    blocks, which are spread over the raster and the same each time. Tiles with cells in range are compared as
    a whole when they are refined. So nothing else has to be stored, copies of both files pass, and block maps
    of earlier versions are checked too. A ParameterError says that the raster has another size, a RasterError
    that it lies elsewhere, or that a block of the sample has other pixels.
    """
    name, blocks = grey.dataset.source, source.saved.blocks
    if grey.shape != source.geobox.shape:
        raise ParameterError(f"{name} has not the size of the raster that the block map was made from")
    if not _is_same_place(grey.dataset.geobox, source.geobox):
        raise RasterError(f"{name} does not lie where it lay when its block map was made; {_AGAIN}")
    if not all(_is_same(grey, blocks, window) for window in sampled_blocks(blocks.shape, SAMPLED)):
        raise RasterError(f"{name} is not as it was when its block map was made; {_AGAIN}")


def sampled_blocks(shape: tuple[int, int], count: int) -> list[Window]:
    """Return windows of up to `count` blocks of a raster, in reading order; the same for the same shape."""
    rows, cols = (-(-length // BLOCK) for length in shape)
    chosen = np.random.default_rng(0).choice(rows * cols, min(count, rows * cols), replace=False)
    found = zip(*np.divmod(np.sort(chosen), cols), strict=True)
    return [Window(int(row) * BLOCK, int(col) * BLOCK, BLOCK, BLOCK).clipped(shape) for row, col in found]


def _is_same(grey: GreySource, blocks: BlockMap, window: Window) -> bool:
    tile = grey.read(window, 0)
    sums, counts = cell_sums(tile.grey, tile.valid)
    here = window_cells(window)
    return np.array_equal(sums, blocks.sums[here]) and np.array_equal(counts, blocks.counts[here])


def _is_same_place(one: GeoBox, other: GeoBox) -> bool:
    """Return whether the corners of two grids are at the same places, and on the ground too."""
    (x, y), (x2, y2) = one.corners, other.corners
    t = one.transform
    side = min(float(np.hypot(t.a, t.d)), float(np.hypot(t.b, t.e)))
    if not _are_near(np.hypot(x - x2, y - y2), side) or (one.crs is None) != (other.crs is None):
        return False
    if one.crs is None or other.crs is None or one.crs == other.crs:
        return True
    try:
        (lon, lat), (lon2, lat2) = one.lonlat_from_xy(x, y), other.lonlat_from_xy(x2, y2)
    except RasterError:  # one is without longitude and latitude: the texts are all there is to compare
        return False
    length = np.hypot(lon[0] - lon[-1], lat[0] - lat[-1]) / np.hypot(*one.shape)  # of a pixel, in degrees
    return _are_near(np.hypot(lon - lon2, lat - lat2), float(length))


def _are_near(distances: NDArray[np.float64], side: float) -> bool:
    return bool((distances <= _MOVED_PIXELS * side).all())
