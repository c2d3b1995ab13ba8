"""The spread agrees with scipy's propagation and chessboard distance."""

import numpy as np
from hypothesis import given, strategies as st
from scipy import ndimage

from uavseg.raster.collar.flood import UNREACHED, distances, flood

EIGHT = np.ones((3, 3))
SEEDS = st.integers(0, 10_000)


@given(SEEDS, st.sampled_from([0.3, 0.5, 0.8]))
def test_a_flood_is_a_propagation(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, 40, 2))
    passable, sources = rng.random(shape) < share, rng.random(shape) < 0.02
    expected = ndimage.binary_propagation(sources, EIGHT, mask=passable | sources)
    assert np.array_equal(flood(sources, passable), expected)


@given(SEEDS, st.integers(1, 20))
def test_steps_without_obstacles_are_the_chessboard_distance(seed: int, reach: int) -> None:
    rng = np.random.default_rng(seed)
    sources = rng.random((30, 40)) < 0.01
    sources[3, 4] = True
    expected = ndimage.distance_transform_cdt(~sources, "chessboard")
    expected = np.where(expected > reach, UNREACHED, expected)
    assert np.array_equal(distances(sources, np.ones((30, 40), bool), reach), expected)


def test_an_obstacle_is_walked_around() -> None:
    passable = np.ones((5, 5), bool)
    passable[:4, 2] = False
    sources = np.zeros((5, 5), bool)
    sources[0, 0] = True
    steps = distances(sources, passable, 50)
    assert steps[0, 3] == 8 and steps[0, 2] == UNREACHED
