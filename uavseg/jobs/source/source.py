"""Sources of jobs as values: a raster, a block map or a map of probabilities, and how they are read."""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from uavseg.errors import ParameterError
from uavseg.execution.phases import decided, phase
from uavseg.jobs.source.detail import Length, as_length
from uavseg.jobs.source.flatten import flatten_width, flattened
from uavseg.raster.collar.find import check_collar, without_collar
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import TilePass
from uavseg.raster.intensity.stretch import Stretch, StretchSpec, fit_stretch, parse_stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.spectral.bands import as_nodata
from uavseg.raster.spectral.formula import BandWords
from uavseg.segmentation.blocks.saved_blocks import Origin, SavedBlocks
from uavseg.segmentation.source import GreySource

AUTO = StretchSpec("auto")


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """How a source is read.

    Parameters
    ----------
    band : int or str, optional
        The band to use, counted from 1 or by its name.
    rgb : three ints or texts, optional
        The bands of red, green and blue, to use their luminance.
    nodata : float or str, optional
        A value that counts for nothing beside the nodata value of the files, NaN too; "only:V" takes its
        place, "none" leaves it out.
    stretch : Stretch, StretchSpec or str, optional
        How intensity becomes v: "auto", "dtype", "minmax", "percentile:P,Q", "none" or "LOW,HIGH". By default
        "auto" for rasters, and for maps of probabilities what follows from their type.
    skip_bad_tiles : bool
        Whether blocks of a file that cannot be read count as nodata.
    free_is_white : bool, optional
        Of a picture that is a map of probabilities without the YAML file of a ROS map: whether free is white
        or black.
    words : BandWords
        An index or an expression in place of a band, and names for the bands.
    collar : {"auto", "keep"}
        Whether an untagged black or white collar of a raster counts as nodata.
    flatten : Length, float or str, optional
        Light that changes slowly over this width is taken away from v: metres, or pixels as "200px".

    Raises
    ------
    ParameterError
        If a text is not a stretch, or a word is not known.
    """

    band: int | str | None = None
    rgb: tuple[int | str, int | str, int | str] | None = None
    nodata: float | str | None = None
    stretch: Stretch | StretchSpec | str | None = None
    skip_bad_tiles: bool = False
    free_is_white: bool | None = None
    words: BandWords = BandWords()
    collar: str = "auto"
    flatten: Length | float | str | None = None

    def __post_init__(self) -> None:
        check_collar(self.collar)
        object.__setattr__(self, "nodata", as_nodata(self.nodata))
        if not isinstance(self.flatten, Length):
            object.__setattr__(self, "flatten", as_length(self.flatten))
        if isinstance(self.stretch, str):
            object.__setattr__(self, "stretch", parse_stretch(self.stretch))

    @property
    def chooses_pixels(self) -> bool:
        """Whether a band, a formula or a nodata value is chosen."""
        return (self.band, self.rgb, self.nodata, self.words) != (None, None, None, BandWords())

    def open(self, sources: Any) -> Dataset:
        """Open rasters with these options; see `Dataset.open`."""
        return Dataset.open(sources, self.band, self.rgb, self.nodata, self.skip_bad_tiles, self.words)

    @property
    def flat_field(self) -> Length | None:
        """The width of the flat field, parsed."""
        assert self.flatten is None or isinstance(self.flatten, Length), "parsed when the options are made"
        return self.flatten

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

    @property
    def in_metres(self) -> bool:
        """Whether lengths on it are metres rather than units of the map."""
        return self.dataset.in_metres

    def check_resumable(self) -> None:
        """Whether its tiles may be kept in a checkpoint: those of files may."""

    def cleaned(self, tile_pass: TilePass) -> Dataset:
        """The pixels without the collar of a raster, which is searched for by the executor of a pass."""
        return self.dataset

    def grey(self, tile_pass: TilePass) -> GreySource:
        """The pixels through their stretch, which is fitted in a pass where it follows from them."""
        dataset = self.cleaned(tile_pass)
        with phase("stretch"):
            fitted = fit_stretch(dataset, self.stretch, tile_pass)
        decided("%s, stretch %s", dataset.band_names, fitted.name)
        return GreySource(dataset, fitted)


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
            self.given or self.dataset.paths,
            str(Path.cwd()),
            None if options.band is None else bands[0],
            None if options.rgb is None else colors,
            options.nodata,
            options.words,
            "auto" if found else "keep",
            None if options.flat_field is None else options.flat_field.word,
        )


@dataclass(frozen=True)
class ProbabilityMap(Pixels):
    """A map of the probability that a cell is occupied.

    Parameters
    ----------
    ros_map : str
        The YAML file of a ROS map, which is in metres and held in memory; empty for other maps.
    """

    ros_map: str = ""

    @property
    def origin(self) -> Origin:
        """What a block map of this map says it was made from."""
        return Origin((self.ros_map or self.name,), str(Path.cwd()))

    def check_resumable(self) -> None:
        """Whether its tiles may be kept in a checkpoint.

        Raises
        ------
        ParameterError
            If it is a ROS map.
        """
        if self.ros_map:
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

    def grey(self, raster: Pixels, tile_pass: TilePass) -> GreySource:
        """The pixels of its raster, as it was made from them."""
        assert isinstance(raster.stretch, Stretch), "that of the block map, or of a map of probabilities"
        return GreySource(
            raster.cleaned(tile_pass.silent), raster.stretch, illumination=self.saved.illumination
        )

    @cached_property
    def raster(self) -> Raster | ProbabilityMap | None:
        """The raster that it was made from, with the same stretch; None if a file is not where it was."""
        from uavseg.occupancy.probability_map import open_map
        from uavseg.occupancy.ros.ros_map import is_ros_map

        origin = self.saved.origin
        paths = origin.allowed_rasters(self.path)
        if paths is None:
            return None
        if is_ros_map(paths[0]):
            return ProbabilityMap(*open_map(paths[0]), ros_map=paths[0])
        stretch = self.saved.stretch
        options = ReadOptions(
            origin.band,
            origin.rgb,
            origin.nodata,
            stretch,
            self.skip_bad_tiles,
            words=origin.words,
            collar=origin.collar,
        )
        return Raster(options.open(paths), stretch, options, tuple(paths))


Source = Raster | Blocks | ProbabilityMap
