"""One photograph: its rays are those of the rotations of gimbals, and places come back to their pixels."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tests.photographs.make import turns
from uavseg.flight.camera.camera import Camera
from uavseg.photographs.ground import Ground
from uavseg.photographs.read import Photograph

CAMERA = Camera("test", (13.2, 8.8), (5472, 3648), 8.8, 2)
PHOTO = Photograph(
    path="a.jpg",
    lon=8.0,
    lat=47.0,
    relative_m=60,
    yaw_deg=0,
    image_px=CAMERA.image_px,
    focal_px=CAMERA.focal_mm / CAMERA.sensor_mm[0] * CAMERA.image_px[0],
)


@st.composite
def photographs(draw: Any, level: bool = False) -> Photograph:
    """Photographs in any pose."""
    return replace(
        PHOTO,
        yaw_deg=draw(st.floats(-360, 360)),
        pitch_deg=draw(st.floats(-90, 30)),
        roll_deg=0.0 if level else draw(st.floats(-180, 180)),
    )


@given(photographs())
def test_axes_are_those_of_three_rotations(photograph: Photograph) -> None:
    north_east_down = turns(photograph).T
    expected = north_east_down[:, [1, 0, 2]] * [1, 1, -1]
    np.testing.assert_allclose(photograph.axes, expected, atol=1e-12)


@given(photographs(), st.floats(0, 5472), st.floats(0, 3648), st.floats(0.1, 1000))
def test_places_come_back_to_their_pixels(
    photograph: Photograph, col: float, row: float, length: float
) -> None:
    pixels = np.array([[col, row]])
    np.testing.assert_allclose(photograph.pixels((photograph.rays(pixels) * length).T).T, pixels, atol=1e-6)
    assert np.isnan(photograph.pixels(-photograph.rays(pixels).T)).all()


def corners_m(photograph: Photograph) -> Any:
    """Ground at the corners of the image: near left and right, far right and left; metres right, ahead."""
    cols, rows = photograph.image_px
    corners = np.array([[0, rows], [cols, rows], [cols, 0], [0, 0]], float)
    east, north, _ = Ground().seen(photograph, corners).T
    yaw = np.radians(photograph.yaw_deg)
    return np.column_stack(
        [east * np.cos(yaw) - north * np.sin(yaw), east * np.sin(yaw) + north * np.cos(yaw)]
    )


@pytest.mark.slow
@given(st.floats(-180, 180), st.floats(-90, -30), st.floats(5, 500))
def test_footprints_are_those_that_missions_are_planned_with(yaw: float, pitch: float, height: float) -> None:
    photograph = replace(PHOTO, yaw_deg=yaw, pitch_deg=pitch, relative_m=height)
    np.testing.assert_allclose(
        corners_m(photograph), CAMERA.footprint_corners_m(height, pitch), atol=1e-9 * height, rtol=1e-9
    )


@given(photographs(), st.floats(-180, 180))
def test_turning_the_camera_turns_the_rays(photograph: Photograph, turn: float) -> None:
    pixels = photograph.border()
    turned = replace(photograph, yaw_deg=photograph.yaw_deg + turn).rays(pixels)
    rays, angle = photograph.rays(pixels), np.radians(turn)
    east = rays[:, 0] * np.cos(angle) + rays[:, 1] * np.sin(angle)
    north = rays[:, 1] * np.cos(angle) - rays[:, 0] * np.sin(angle)
    np.testing.assert_allclose(turned, np.column_stack([east, north, rays[:, 2]]), atol=1e-12)


@pytest.mark.parametrize("steps", [1, 5])
def test_the_border_goes_around_the_image(steps: int) -> None:
    border = PHOTO.border(steps)
    cols, rows = PHOTO.image_px
    assert len(border) == 4 * steps
    assert border[::steps].tolist() == [[0, 0], [cols, 0], [cols, rows], [0, rows]]
    assert (np.isin(border[:, 0], [0, cols]) | np.isin(border[:, 1], [0, rows])).all()
