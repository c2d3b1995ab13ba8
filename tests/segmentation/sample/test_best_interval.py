"""The best interval is the best of all, and says how well it fits."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from uavseg.jobs.match.ranges_of_sample import best_interval, linear_weights


def slow(values: np.ndarray, similarity: np.ndarray, own: np.ndarray, low: float, high: float) -> float:
    """Agreement of an interval, as it is defined."""
    inside = (values >= low) & (values < high)
    found = similarity[inside].sum() / (similarity.sum() + (1 - similarity[inside]).sum())
    return float(found * min(((own >= low) & (own < high)).mean() / 0.9, 1))


def scene(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    values = np.concatenate([rng.normal(m, 1, rng.integers(40, 400)) for m in rng.uniform(-9, 9, 4)])
    middle = values[rng.integers(len(values))]
    similarity = np.clip(np.exp(-((values - middle) ** 2)) + rng.normal(0, 0.05, len(values)), 0, 1)
    return values, similarity, rng.normal(middle, 0.5, 50)


@pytest.mark.slow
@given(st.integers(0, 10_000))
def test_no_other_interval_agrees_better(seed: int) -> None:
    values, similarity, own = scene(seed)
    found = best_interval(values, similarity, own)
    assert found is not None and (math.isfinite(found.low) or math.isfinite(found.high))
    assert found.agreement == pytest.approx(slow(values, similarity, own, found.low, found.high), abs=1e-9)
    inside = (values >= found.low) & (values < found.high)
    assert found.share == pytest.approx(inside.mean())
    rng = np.random.default_rng(seed)
    low, high = np.quantile(np.concatenate([values, own]), (0.001, 0.999))
    edges = np.linspace(low, high, 257)[1:-1]
    for _ in range(50):
        one, other = sorted(rng.choice(edges, 2))
        assert (
            slow(values, similarity, own, one, other) <= found.agreement + 0.01 + 1e-9
        )  # open ends cost 0.005


@given(st.integers(0, 10_000), st.floats(0.1, 50), st.floats(-100, 100))
def test_the_unit_of_values_changes_nothing(seed: int, scale: float, offset: float) -> None:
    values, similarity, own = scene(seed)
    one = best_interval(values, similarity, own)
    other = best_interval(values * scale + offset, similarity, own * scale + offset)
    assert one is not None and other is not None
    assert other.agreement == pytest.approx(one.agreement, abs=0.01)
    assert math.isinf(other.low) == math.isinf(one.low) and math.isinf(other.high) == math.isinf(one.high)


def test_ends_are_open_where_nothing_of_another_kind_lies_beyond() -> None:
    values = np.concatenate([np.full(50, 1.0), np.full(50, 2.0), np.full(50, 3.0)])
    similarity = np.repeat([0.0, 0.0, 1.0], 50)
    found = best_interval(values, similarity, np.full(9, 3.0))
    assert found is not None and 2 < found.low <= 3 and found.high == math.inf
    assert found.agreement == 1 and found.share == pytest.approx(1 / 3)
    middle = best_interval(values, np.repeat([0.0, 1.0, 0.0], 50), np.full(9, 2.0))
    assert middle is not None and 1 < middle.low <= 2 < middle.high <= 3


def test_an_interval_without_the_sample_is_not_chosen() -> None:
    values = np.concatenate([np.linspace(0, 1, 500), np.linspace(5, 6, 100)])
    similarity = np.repeat([0.6, 1.0], [500, 100])
    found = best_interval(values, similarity, np.linspace(0, 1, 40))
    assert found is not None and found.low < 0.1


def test_values_that_are_not_finite_count_for_nothing() -> None:
    values, similarity, own = scene(3)
    more = np.concatenate([values, [np.nan, np.inf, -np.inf]])
    found = best_interval(more, np.concatenate([similarity, [1, 1, 1]]), np.append(own, np.nan))
    assert found == best_interval(values, similarity, own)


@pytest.mark.parametrize("values", [np.zeros(9), np.full(9, np.nan), np.empty(0)])
def test_one_value_is_no_choice(values: np.ndarray) -> None:
    assert best_interval(values, np.full(len(values), 0.5), np.zeros(4)) is None


@given(st.integers(0, 10_000), st.integers(2, 5))
def test_weights_are_those_of_the_linear_discriminant(seed: int, bands: int) -> None:
    """Of two certain classes, as solving for the scatter within gives them."""
    rng = np.random.default_rng(seed)
    mix = rng.normal(size=(bands, bands))
    classes = rng.integers(0, 2, 600)
    colors = (rng.normal(size=(600, bands)) + 3 * classes[:, None] * rng.normal(size=bands)) @ mix
    weights = linear_weights(colors, classes.astype(float), digits=9)
    scale = colors.std(0)
    within = sum(np.cov((colors / scale)[classes == k].T, bias=True) for k in (0, 1))
    away = (colors[classes == 1].mean(0) - colors[classes == 0].mean(0)) / scale
    expected = np.linalg.solve(within + 0.01 * np.eye(bands), away) / scale
    assert np.allclose(weights, expected / abs(expected).sum(), atol=1e-6)
