"""Straight borders are explained by a few lines, round and wandering ones are not."""

import numpy as np
import pytest

from tests.raster.collar.draw_collar import ragged, turned
from uavseg.raster.collar.evidence import outline_points, straight_share
from uavseg.raster.grid.tiling import PixelMask


def share(picture: np.ndarray) -> float:
    return straight_share(outline_points(PixelMask.of(~picture), picture.shape), 2, min(picture.shape) / 8)


@pytest.mark.parametrize("degrees", [0, 3, 17, 45, 88])
def test_a_turned_rectangle_has_a_straight_border(degrees: float) -> None:
    assert share(turned((500, 600), degrees, 0.35)) > 0.97


def test_a_ragged_border_is_not_straight() -> None:
    assert share(ragged((500, 600))) < 0.6


def test_a_disc_has_no_straight_border() -> None:
    rows, cols = np.mgrid[:800, :800]
    assert share(np.hypot(rows - 400, cols - 400) < 350) < 0.75


def test_points_are_the_border_pixels_inside() -> None:
    picture = np.zeros((100, 150), bool)
    picture[20:80, 30:120] = True
    points = outline_points(PixelMask.of(~picture), picture.shape)
    rows, cols = points.astype(int).T
    expected = {(19, c) for c in range(30, 120)} | {(80, c) for c in range(30, 120)}
    expected |= {(r, 29) for r in range(20, 80)} | {(r, 120) for r in range(20, 80)}
    assert set(zip(rows.tolist(), cols.tolist(), strict=True)) == expected
