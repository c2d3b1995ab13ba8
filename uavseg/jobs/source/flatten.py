"""Flat-field correction as a word of jobs: a width in metres or pixels, and where it does not apply."""

from dataclasses import replace

from uavseg.errors import ParameterError
from uavseg.execution.phases import decided, phase
from uavseg.jobs.source.detail import in_pixels
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.length import Length
from uavseg.raster.grid.tiling import TilePass
from uavseg.segmentation.source import GreySource
from uavseg.units import GREY_MAX

MIN_WIDTH, MAX_WIDTH = 32, 32768  # pixels


def flatten_width(length: Length, geobox: GeoBox) -> tuple[int, int]:
    """The width of a flat field in whole rows and columns of pixels, at the centre of a raster.

    Raises
    ------
    ParameterError
        If metres are given and there is no CRS, or the width is less than 32 pixels or more than 32768.
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
    """Grey without its slow light, which is measured in one pass.

    Raises
    ------
    ParameterError
        As of `flatten_width`.
    """
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
