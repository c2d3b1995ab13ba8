"""Sources of jobs as values: a raster, a block map or a map of probabilities; lengths on them."""

from dataclasses import field, replace
from functools import cached_property
from pathlib import Path

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.execution.executors import decided, phase
from uavseg.options.reading import ReadOptions
from uavseg.raster.collar.find import without_collar
from uavseg.raster.grid.geobox import GeoBox, Length
from uavseg.raster.grid.ground import ground_resolution
from uavseg.raster.grid.tiling import TilePass
from uavseg.raster.intensity.stretch import Stretch, StretchSpec, fit_stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.segmentation.blocks.block_file import Origin, SavedBlocks
from uavseg.segmentation.refine.detail import MAX_DETAIL, Detail
from uavseg.segmentation.source import GreySource
from uavseg.units import GREY_MAX


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


def refuse_without_pixels(length: Length | None, refine: str) -> None:
    """Refuse what needs pixels where a block map is all there is, with ParameterError.

    That is a detail, or a refinement that takes every pixel by its own value.
    """
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
    """Return the nearest whole numbers of rows and columns, at least 1.

    ParameterError is raised if metres are given and there is no CRS.
    """
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
    from uavseg.segmentation.source import measure_illumination

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
    """A source whose pixels are read: a raster or a map of probabilities.

    `stretch` is how values become v: fitted already, or to be fitted to the pixels.
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
        return GreySource(
            raster.cleaned(tile_pass.silent), raster.stretch, illumination=self.saved.illumination
        )

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
        stretch = self.saved.stretch
        options = ReadOptions(
            band=origin.band,
            rgb=origin.rgb,
            index=origin.words.index,
            expr=origin.words.expr,
            band_names=origin.words.names,
            nodata=origin.nodata,
            stretch=stretch,
            collar=origin.collar,
            skip_bad_tiles=self.skip_bad_tiles,
        )
        return Raster(options.open(paths), stretch, options, tuple(paths))


Source = Raster | Blocks | ProbabilityMap
