"""The wanted scale of a job: a length in metres or pixels, as discs of pixels of a raster."""

from dataclasses import dataclass

from uavseg.errors import ParameterError
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import ground_resolution
from uavseg.segmentation.refine.detail import MAX_DETAIL, Detail


@dataclass(frozen=True, slots=True)
class Length:
    """A length in metres, or in pixels.

    Raises
    ------
    ParameterError
        If it is not finite and above 0.

    Examples
    --------
    >>> parse_length("8px")
    Length(value=8.0, in_pixels=True)
    """

    value: float
    in_pixels: bool = False

    def __post_init__(self) -> None:
        if not 0 < self.value < float("inf"):
            raise ParameterError(f"a detail or a width is a finite length above 0, not {self.value:g}")

    def __str__(self) -> str:
        return f"{self.value:.12g} {'pixels' if self.in_pixels else 'm'}"

    @property
    def word(self) -> str:
        """As options of the command line take it."""
        return f"{self.value!r}".removesuffix(".0") + ("px" if self.in_pixels else "")


def parse_length(text: str) -> Length:
    """Parse a length: metres, or pixels with the suffix px.

    Raises
    ------
    ParameterError
        If the text is not a finite number above 0, with or without px.
    """
    number = text.strip().lower()
    in_pixels = number.endswith("px")
    try:
        value = float(number.removesuffix("px"))
    except ValueError as error:
        raise ParameterError(
            f"a detail or a width is metres such as 2.5, or pixels such as 8px, not {text!r}"
        ) from error
    return Length(value, in_pixels)


def as_length(given: float | str | None) -> Length | None:
    """Metres, or a length as text such as "8px"; None is no length.

    Raises
    ------
    ParameterError
        If it is not a finite number above 0, with or without px.
    """
    if given is None:
        return None
    return parse_length(given) if isinstance(given, str) else Length(float(given))


def detail_of(length: Length | None, geobox: GeoBox, refine: str, cover: bool = False) -> Detail | None:
    """A length in whole pixels along columns and rows, at the centre of a raster.

    Parameters
    ----------
    length : Length, optional
    geobox : GeoBox
    refine : str
        The refinement; with "none" regions end at cells, and no detail applies.
    cover : bool
        See `Detail`.

    Returns
    -------
    Detail or None
        None without a length.

    Raises
    ------
    ParameterError
        If regions are not refined to the pixel, if metres are given and there is no CRS, or if the length is
        less than two pixels, so that it would change nothing, or more than 128.
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
    """Refuse what is decided to the pixel where a block map is all there is.

    Raises
    ------
    ParameterError
        If there is a detail, or every pixel is to be taken by its own value.
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
    """The nearest whole numbers of rows and columns, at least 1.

    Raises
    ------
    ParameterError
        If metres are given and there is no CRS.
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
