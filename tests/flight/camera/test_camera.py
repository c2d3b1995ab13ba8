"""Cameras: laws of the pinhole model, footprints against projected corners, and what is refused."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from uavseg.errors import ParameterError
from uavseg.flight.camera.camera import Camera, Overlap

PHANTOM = Camera("DJI Phantom 4 Pro", (13.2, 8.8), (5472, 3648), 8.8, 2.0)
heights = st.floats(1, 500)
pitches = st.floats(-90, -60)


def project(camera: Camera, height_m: float, pitch_deg: float, col: float, row: float) -> tuple[float, float]:
    """Where the ray through a pixel meets the ground, with rotation matrices: the slow plain version."""
    pixel = camera.sensor_mm[0] / camera.image_px[0]
    right = (col - camera.image_px[0] / 2) * pixel
    up = (camera.image_px[1] / 2 - row) * camera.sensor_mm[1] / camera.image_px[1]
    pitch = math.radians(pitch_deg)
    forward = np.array([0, math.cos(pitch), math.sin(pitch)])
    upward = np.array([0, -math.sin(pitch), math.cos(pitch)])
    ray = camera.focal_mm * forward + right * np.array([1, 0, 0]) + up * upward
    scale = height_m / -ray[2]
    return float(ray[0] * scale), float(ray[1] * scale)


@given(heights, pitches)
def test_corners_are_where_rays_through_the_corner_pixels_meet_the_ground(
    height: float, pitch: float
) -> None:
    corners = PHANTOM.footprint_corners_m(height, pitch)
    pixels = [(0, 3648), (5472, 3648), (5472, 0), (0, 0)]
    rays = [project(PHANTOM, height, pitch, *pixel) for pixel in pixels]
    assert np.allclose(corners, rays, rtol=1e-9, atol=1e-9)


@given(heights, pitches)
def test_the_height_of_a_ground_sampling_distance_gives_it_back(height: float, pitch: float) -> None:
    gsd = PHANTOM.gsd_m(height, pitch)
    assert PHANTOM.height_m(gsd, pitch) == pytest.approx(height)
    assert PHANTOM.gsd_m(2 * height, pitch) == pytest.approx(2 * gsd)


@given(heights)
def test_straight_down_a_footprint_has_as_many_samples_as_the_image_has_pixels(height: float) -> None:
    across, along = PHANTOM.footprint_m(height)
    gsd = PHANTOM.gsd_m(height)
    assert across / gsd == pytest.approx(5472) and along / gsd == pytest.approx(3648, rel=1e-3)


def test_the_maker_s_numbers() -> None:
    """GSD = H / 36.5 cm/pixel with H in metres, in the maker's sheet of the Phantom 4 Pro and RTK."""
    assert 100 * PHANTOM.gsd_m(36.5) == pytest.approx(1.0, abs=0.01)


def test_a_width_that_is_sure_is_that_of_the_near_edge() -> None:
    corners = PHANTOM.footprint_corners_m(60, -70)
    across, along = PHANTOM.footprint_m(60, -70)
    assert across == corners[1, 0] - corners[0, 0] < corners[2, 0] - corners[3, 0]
    assert along == pytest.approx(corners[2, 1] - corners[0, 1])


@given(st.floats(0, 95), st.floats(0, 95))
def test_neighbouring_footprints_share_the_overlap(front: float, side: float) -> None:
    across, along = PHANTOM.footprint_m(60)
    line, photo = Overlap(front, side).spacing_m((across, along))
    assert (across - line) / across == pytest.approx(side / 100, abs=1e-12)
    assert (along - photo) / along == pytest.approx(front / 100, abs=1e-12)


def test_speed_is_limited_by_the_interval_and_by_motion_blur() -> None:
    assert PHANTOM.max_speed_m_s(60, 20, 1 / 8000, 1) == 10  # 20 m in 2 s
    slow = PHANTOM.max_speed_m_s(60, 20, 1 / 100, 1)
    assert slow == pytest.approx(PHANTOM.gsd_m(60) * 100)
    assert PHANTOM.max_speed_m_s(60, math.inf, 1 / 100, 1) == slow


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (((0, 8.8), (5472, 3648), 8.8), "above 0"),
        (((13.2, 8.8), (5472, 3648), math.nan), "above 0"),
        (((8.8, 13.2), (5472, 3648), 8.8), "not square"),
    ],
)
def test_a_camera_that_cannot_be_is_refused(values: tuple[object, ...], words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        Camera("odd", *values)  # type: ignore[arg-type]


@pytest.mark.parametrize("pitch", [-91, -20, 0, 45, math.nan])
def test_a_pitch_towards_the_horizon_is_refused(pitch: float) -> None:
    with pytest.raises(ParameterError, match="gimbal pitch"):
        PHANTOM.footprint_corners_m(60, pitch)


def test_a_wide_lens_that_sees_the_horizon_is_refused() -> None:
    wide = Camera("wide", (13.2, 8.8), (5472, 3648), 3.0)
    with pytest.raises(ParameterError, match="sees the horizon"):
        wide.footprint_corners_m(60, -31)


@pytest.mark.parametrize("overlap", [(100, 50), (-1, 50), (50, math.nan)])
def test_an_overlap_of_all_or_less_than_nothing_is_refused(overlap: tuple[float, float]) -> None:
    with pytest.raises(ParameterError, match="per cent"):
        Overlap(*overlap)
