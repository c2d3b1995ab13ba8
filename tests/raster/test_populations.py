"""Populations of pixels: two materials are parted whatever their shares, and one material never is."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy import ndimage

from uavseg.raster.intensity.thresholds import population_edges, rarest_population

SHAPE = (256, 256)


def greys_of(v: np.ndarray) -> np.ndarray:
    grey = np.floor(np.clip(v, 0, 1) * 65535 + 0.5).astype(np.int64)
    return np.bincount(grey.reshape(-1), minlength=65536)


@pytest.mark.parametrize("is_8_bit", [False, True])
@pytest.mark.parametrize("noise", [0.004, 0.025])
@pytest.mark.parametrize(
    ("shares", "apart"),
    [
        *(([share], apart) for share in (0.01, 0.03, 0.1, 0.3, 0.5, 0.9, 0.99) for apart in (6, 12)),
        *((shares, 6.5) for shares in ([0.3, 0.4], [0.01, 0.03], [0.01, 0.5], [0.5, 0.49], [0.1, 0.01])),
    ],
)
def test_materials_six_deviations_apart_are_parted(
    shares: list[float], apart: float, noise: float, is_8_bit: bool
) -> None:
    """Each pixel lies on the side of its own material, but for a tenth of the rarer of two at most."""
    rng = np.random.default_rng(3)
    classes = np.searchsorted(np.cumsum(shares), rng.random(SHAPE))
    v = 0.15 + noise * apart * classes + rng.normal(0, noise, SHAPE)
    if is_8_bit:
        v = np.rint(v * 255) / 255
    edges = population_edges(greys_of(v))
    assert len(edges) == len(shares)
    for kind, edge in enumerate(edges, 1):
        true, above = classes >= kind, v > edge
        one, other = (true, above) if true.mean() <= 0.5 else (~true, ~above)
        assert (one & other).sum() >= 0.9 * (one | other).sum()


@pytest.mark.parametrize("seed", range(3))
def test_one_material_is_one_population(seed: int) -> None:
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=SHAPE)
    walk = np.cumsum(np.cumsum(noise, axis=0), axis=1)
    slope = np.linspace(0, 1, SHAPE[1]) + 0.02 * noise
    for v in (
        noise,
        np.exp(noise),
        rng.exponential(size=SHAPE),
        ndimage.gaussian_filter(noise, 9),
        walk,
        slope,
    ):
        assert population_edges(greys_of((v - v.min()) / np.ptp(v))) == ()
    assert population_edges(np.zeros(65536, np.int64)) == () == population_edges(greys_of(np.full(9, 0.4)))


def test_a_saturated_tail_is_no_population_and_a_material_at_the_end_is_one() -> None:
    rng = np.random.default_rng(1)
    tail = 0.2 * rng.exponential(size=SHAPE)
    assert (tail >= 1).mean() > 0.005
    assert population_edges(greys_of(tail)) == () == population_edges(greys_of(1 - tail))
    roofs = np.where(rng.random(SHAPE) < 0.02, 1, rng.normal(0.3, 0.03, SHAPE))
    for v in (roofs, 1 - roofs):
        [edge] = population_edges(greys_of(v))
        assert min((v < edge).mean(), (v > edge).mean()) == pytest.approx(0.02, abs=0.003)


@given(st.lists(st.sampled_from(range(256)), min_size=2, max_size=5, unique=True))
def test_no_pixel_lies_on_an_edge(values: list[int]) -> None:
    """Otherwise it would belong to the ranges on both of its sides."""
    greys = np.zeros(65536, np.int64)
    greys[np.array(values) * 257] = 100
    edges = population_edges(greys)
    bounds, v = (0.0, *edges, 1.0), np.array(values) / 255
    assert all(((v >= low) & (v <= high)).any() for low, high in pairwise(bounds))
    assert not {round(edge * 65535) / 65535 for edge in edges} & set(edges)


def test_the_rarest_is_the_one_with_the_fewest_pixels_and_of_equal_ones_the_brightest() -> None:
    greys = np.zeros(65536, np.int64)
    greys[[10_000, 30_000, 60_000]] = 50, 20, 50
    assert rarest_population(greys, (0.3, 0.7)) == (0.3, 0.7)
    assert rarest_population(greys, (0.3,)) == (0.0, 0.3)
    greys[30_000] = 0
    assert rarest_population(greys, (0.3,)) == (0.3, 1.0)
