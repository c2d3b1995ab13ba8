"""The wanted scale of a job: a length in metres or pixels, as discs of pixels of a raster."""

from uavseg.errors import ParameterError
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import ground_resolution
from uavseg.raster.grid.length import Length
from uavseg.segmentation.refine.detail import MAX_DETAIL, Detail


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
