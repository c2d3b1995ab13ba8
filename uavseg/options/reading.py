"""Options that say how a raster or a map is read, and what the contents of files may name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from uavseg.options import texts
from uavseg.options.option import Options, argument, option

if TYPE_CHECKING:
    from collections.abc import Sequence
    from os import PathLike

    from uavseg.raster.grid.geobox import Length
    from uavseg.raster.intensity.stretch import Stretch, StretchSpec
    from uavseg.raster.read.dataset import Dataset
    from uavseg.raster.spectral.formula import BandWords

MAP_STRETCH: dict[str, Any] = {  # what differs where a map of probabilities is read
    "stretch": {
        "default": None,
        "basic": False,
        "help": "For a map that holds no probabilities: auto, dtype, minmax, percentile:P,Q, none or "
        "LOW,HIGH.  [default: dtype for integers, none for floats]",
    },
    "free_is_white": {"python": True},
}
RASTER_STRETCH: dict[str, Any] = {"stretch": {"default": "auto"}}
ONLY_RASTERS = ("rgb", "collar", "skip_bad_tiles", "flatten", "bounds", "aoi", "warp")
ONLY_MAPS = ("free_is_white",)


class RasterArguments(Options):
    """Rasters."""

    rasters: tuple[str, ...] = argument(
        "RASTER...", multiple=True, required=True, parse=texts.names_from_standard_input
    )


class ReadOptions(Options):
    """Reading."""

    band: int | str | None = option(
        "Use this band, counted from 1, or by its name (B8, nir, red); --bidx as in rio.",
        *("-b", "--band", "--bidx"),
        metavar="N|NAME",
        parse=texts.band,
        basic=True,
    )
    rgb: tuple[int | str, int | str, int | str] | None = option(
        "Use the luminance of these bands.",
        metavar="R,G,B",
        parse=texts.three_bands,
        label="Bands of red, green and blue",
    )
    index: str | None = option(
        "Use a spectral index: ndvi, ndwi, ndbi, exg, vari, ...",
        metavar="NAME",
        basic=True,
        label="Spectral index",
    )
    expr: str | None = option(
        "Use band arithmetic, such as '(nir - red) / (nir + red)'.", metavar="TEXT", label="Band arithmetic"
    )
    band_names: str | None = option(
        "Names for the bands: one for each (red,green,blue,nir) or some (nir=4).",
        metavar="NAMES",
        label="Names of the bands",
    )
    nodata: float | str | None = option(
        "This value (nan too) is nodata, beside the file's own; only:V: it alone; none: no value is.",
        metavar="V|only:V|none",
        parse=texts.nodata,
        label="Nodata value",
    )
    stretch: Stretch | StretchSpec | str | None = option(
        "How intensity becomes v: auto, dtype, minmax, percentile:P,Q, none or LOW,HIGH.",
        metavar="STRETCH",
        basic=True,
        label="Stretch",
    )
    collar: str = option(
        "Count an untagged black or white collar as nodata, or keep it.",
        default="auto",
        choices=("auto", "keep"),
        label="Collar",
    )
    skip_bad_tiles: bool = option(
        "Count blocks of a file that cannot be read as nodata, and list them at the end.", default=False
    )
    flatten: Length | float | str | None = option(
        "Take away light that changes slowly over this width, several times that of what is sought; --range "
        "is then of v without it.",
        metavar="M|Npx",
        label="Take slow light away over (m, or pixels as 200px)",
    )
    bounds: tuple[float, float, float, float] | None = option(
        "Read only the pixels whose centres lie between these coordinates of the raster.",
        metavar="W,S,E,N",
        parse=texts.numbers("--bounds is W,S,E,N, such as 512340,5478340,512500,5478620", 4),
    )
    aoi: str | PathLike[str] | None = option(
        "Read only what lies in the polygons of this file; the rest counts as nodata.", metavar="FILE"
    )
    warp: bool = option(
        "Read files of another grid or CRS on the grid of the first, by nearest pixel.", default=False
    )
    free_is_white: bool | None = option(
        "Of a picture without its YAML file: whether white or black is free; with white, 205 is unknown.",
        "--free-is-white/--free-is-black",
    )

    def __post_init__(self) -> None:
        from uavseg.raster.collar.find import check_collar
        from uavseg.raster.grid.geobox import as_bounds, as_length
        from uavseg.raster.intensity.stretch import parse_stretch
        from uavseg.raster.spectral.bands import as_nodata

        check_collar(self.collar)
        object.__setattr__(self, "nodata", as_nodata(self.nodata))
        object.__setattr__(self, "flatten", as_length(self.flatten))
        object.__setattr__(self, "bounds", as_bounds(self.bounds))
        if isinstance(self.stretch, str):
            object.__setattr__(self, "stretch", parse_stretch(self.stretch))

    @property
    def formula(self) -> BandWords:
        """An index or an expression in place of a band, and names for the bands."""
        from uavseg.raster.spectral.formula import BandWords

        return BandWords(self.index, self.expr, self.band_names)

    @property
    def chooses_pixels(self) -> bool:
        """Whether a band, a formula or a nodata value is chosen."""
        chosen = (self.band, self.rgb, self.index, self.expr, self.band_names, self.nodata)
        return any(one is not None for one in chosen)

    def open(self, sources: Any) -> Dataset:
        """Open rasters with these options; see `Dataset.open`."""
        from uavseg.raster.read.dataset import Dataset

        how = self.skip_bad_tiles, self.formula, self.warp
        return Dataset.open(sources, self.band, self.rgb, self.nodata, *how)

    @property
    def flat_field(self) -> Length | None:
        """The width of the flat field, parsed."""
        from uavseg.raster.grid.geobox import Length

        assert self.flatten is None or isinstance(self.flatten, Length), "parsed when the options are made"
        return self.flatten

    @property
    def spec(self) -> Stretch | StretchSpec | None:
        """The stretch, parsed."""
        assert not isinstance(self.stretch, str), "a text is parsed when the options are made"
        return self.stretch

    def stretches(self, *harmless: str) -> bool:
        """Return whether a stretch is chosen, other than these forms."""
        from uavseg.raster.intensity.stretch import StretchSpec

        if self.spec is None:
            return False
        return not (isinstance(self.spec, StretchSpec) and self.spec.form in harmless)


class AccessOptions(Options):
    """Access."""

    allow_path: str | PathLike[str] | Sequence[str | PathLike[str]] = option(
        "The contents of files may name files in this folder, beside their own; may be repeated.",
        default=(),
        metavar="DIR",
        multiple=True,
    )
    allow_network: bool = option("The contents of files may name addresses to read from.", default=False)
