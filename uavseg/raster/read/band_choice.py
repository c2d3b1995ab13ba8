"""The bands that become intensity, from what the user says: numbers, names, an index or an expression."""

from collections.abc import Sequence

from uavseg.errors import MosaicError, ParameterError, UnchosenBandsError
from uavseg.raster.read.array_source import ArraySource
from uavseg.raster.read.raster_file import RasterFile
from uavseg.raster.spectral.band_names import check_same_names, find_band, listed
from uavseg.raster.spectral.bands import BandChoice, BandLayout, choose_bands
from uavseg.raster.spectral.formula import BandWords, bind_formula

MOST_UNCHOSEN = 4  # bands beside alpha; of more, the user has to choose


def choose(
    layout: BandLayout,
    band: int | str | None,
    rgb: Sequence[int | str] | None,
    words: BandWords,
    palette: bool = False,
) -> BandChoice:
    """Choose bands, see `choose_bands`; each may be named.

    Raises
    ------
    ParameterError, RasterError
        As of `choose_bands` and `bind_formula`.
    BandError
        If a name is that of no band, or of several.
    UnchosenBandsError
        If nothing is chosen of more than four bands that are not alpha.
    """
    if words.is_formula and (band is not None or rgb is not None):
        raise ParameterError("give --band, --rgb, --index or --expr: one of them")
    if band is None and rgb is None and not words.is_formula:
        _check_few(layout)
    number = find_band(layout, band) if isinstance(band, str) else band
    colors = None if rgb is None else [find_band(layout, n) if isinstance(n, str) else n for n in rgb]
    return choose_bands(layout, number, colors, palette, bind_formula(words, layout))


def _check_few(layout: BandLayout) -> None:
    count = sum(role != "alpha" for role in layout.roles)
    if count > MOST_UNCHOSEN:
        raise UnchosenBandsError(
            f"the raster has {count} bands; choose with --band, --rgb, --index or --expr; the bands are "
            f"{listed(layout)}"
        )


def check_reflectance(files: Sequence[RasterFile | ArraySource], choice: BandChoice) -> None:
    """Check that a formula for reflectance is not given integers without a scale.

    Raises
    ------
    ParameterError
        If it is.
    """
    formula = choice.formula
    if formula is None or not formula.of_reflectance or choice.dtype.kind not in "iu":
        return
    for band in choice.bands:
        scale = files[0].scale_of(band, choice.bits)
        if (scale.scale, scale.offset) == (1.0, 0.0):
            raise ParameterError(
                f"{formula.title} holds for reflectance from 0 to 1, and band {band} is {choice.dtype} "
                "without a scale; give the scale to the file (gdal_edit.py -scale), or divide in --expr"
            )


def check_names_agree(files: Sequence[RasterFile | ArraySource], bands: Sequence[int]) -> None:
    """Check that the bands which are used have the same names in all files that name them.

    Raises
    ------
    MosaicError
        If one has others.
    """
    first = files[0]
    for file in files[1:]:
        difference = check_same_names(first.layout, file.layout, bands)
        if difference:
            raise MosaicError(
                f"{file.path} has another name of bands ({difference}) than {first.path}; the rasters of a "
                "mosaic must agree"
            )
