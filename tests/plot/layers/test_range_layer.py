"""Layer of ranges: colours, and cells upsampled to the extent of the raster."""

from dataclasses import replace

import numpy as np
import pytest
from affine import Affine

from tests.plot.halves import found_in, halves
from uavseg.plot.page.page import Frame
from uavseg.plot.suggestions import RANGE_COLORS, range_colors, upsample_cells
from uavseg.raster.grid.geobox import GeoBox


def test_every_range_has_a_colour_of_its_own() -> None:
    for count in range(1, len(RANGE_COLORS) + 1):
        assert len(set(range_colors(count))) == count


@pytest.mark.parametrize("max_side", [10, 100, 5000])
def test_cells_are_spread_over_exactly_the_raster(max_side: int) -> None:
    box = GeoBox((75, 133), Affine(2, 0, 100, 0, -2, 900), None)
    cells = np.arange(16 * 24, dtype=np.uint8).reshape(16, 24)
    picture, pixels = upsample_cells(cells, Frame(box), max_side)
    assert max(picture.shape) <= max(max_side, 133) and (max_side < 133 or picture.shape == box.shape)
    assert np.allclose(pixels * (picture.shape[1], picture.shape[0]), Frame(box).plot_from_pixel * (133, 75))
    if max_side > 133:
        assert np.array_equal(picture, cells.repeat(8, 0).repeat(8, 1)[:75, :133])


def test_ranges_of_a_large_raster_are_thinned() -> None:
    found, _ = found_in(halves())
    intervals, _ = upsample_cells(found.intervals, Frame(replace(found.source.geobox)), 60)
    assert intervals.shape == (40, 60)
    assert set(intervals[:, :30].ravel()) == {0, 1} and set(intervals[:, 30:].ravel()) == {2}
