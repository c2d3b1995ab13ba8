"""Mixtures of Gaussians: what they are of is found again, and a sample says which components are its kind."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.segmentation.sample.mixture import Mixture, SampleVote, _estimate, fit_mixtures, sample_votes


def clouds(seed: int, centres: list[list[float]], each: int = 400) -> NDArray[np.float64]:
    """Points around centres, 0.3 wide, one group after the other."""
    rng = np.random.default_rng(seed)
    return np.concatenate([rng.normal(centre, 0.3, (each, len(centre))) for centre in centres])


@pytest.mark.parametrize("seed", range(3))
def test_groups_that_lie_apart_are_the_components(seed: int) -> None:
    centres = [[-2.0, 0.0], [2.0, 0.0], [0.0, 2.5]]
    found = fit_mixtures(clouds(seed, centres), (3,))[0]
    nearest = np.sort([np.abs(found.means - centre).max(1).min() for centre in centres])
    assert (nearest < 0.1).all()
    np.testing.assert_allclose(found.shares, 1 / 3, atol=0.02)
    np.testing.assert_allclose(found.covariances, np.broadcast_to(0.1 * np.eye(2), (3, 2, 2)), atol=0.04)


@given(st.integers(0, 2**32 - 1), st.integers(1, 3))
@settings(max_examples=20)
def test_memberships_are_those_of_bayes_rule(seed: int, dims: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(50, dims))
    for mixture in fit_mixtures(points, (2, 3)):
        densities = [plain_density(mixture, k, points) for k in range(len(mixture))]
        np.testing.assert_allclose(mixture.memberships(points), densities / np.sum(densities, 0), atol=1e-9)
        assert mixture.shares.sum() == pytest.approx(1)


def plain_density(mixture: Mixture, k: int, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share times the density of a Gaussian, by its formula."""
    covariance, away = mixture.covariances[k], points - mixture.means[k]
    squares = np.einsum("ni,ij,nj->n", away, np.linalg.inv(covariance), away)
    dims = points.shape[1]
    scale = np.sqrt((2 * np.pi) ** dims * np.linalg.det(covariance))
    found: NDArray[np.float64] = mixture.shares[k] * np.exp(-0.5 * squares) / scale
    return found


@given(st.integers(0, 2**32 - 1), st.integers(1, 4), st.integers(1, 5))
@settings(max_examples=30)
def test_a_step_of_maximisation_has_the_weighted_moments(seed: int, dims: int, size: int) -> None:
    rng = np.random.default_rng(seed)
    points, members = rng.normal(size=(40, dims)), rng.dirichlet(np.ones(size), 40).T
    found = _estimate(points, members)
    np.testing.assert_allclose(found.shares, members.mean(1), atol=1e-9)
    for k in range(size):
        np.testing.assert_allclose(found.means[k], np.average(points, 0, members[k]), atol=1e-6)
        spread = np.cov(points.T, aweights=members[k], ddof=0).reshape(dims, dims)
        np.testing.assert_allclose(found.covariances[k], spread + 0.01 * np.eye(dims), atol=1e-6)


def test_the_order_of_points_changes_nothing_but_rounding() -> None:
    points = clouds(0, [[-1.0], [1.0]])
    turned = fit_mixtures(points[::-1], (2,))[0]
    np.testing.assert_allclose(turned.means, fit_mixtures(points, (2,))[0].means, atol=1e-6)


def test_one_kind_of_three_is_likely_where_its_group_lies() -> None:
    points = clouds(1, [[-2.0, 0.0], [2.0, 0.0], [0.0, 2.5]])
    vote = SampleVote.of(fit_mixtures(points), points[400:440])
    similarity = vote.similarity(points)
    assert similarity[400:800].mean() > 0.8
    assert np.delete(similarity, np.s_[400:800]).mean() < 0.1
    assert sum(vote.weights) == pytest.approx(1)


def test_a_sample_of_everything_finds_everything() -> None:
    points = clouds(2, [[-2.0], [2.0]])
    assert SampleVote.of(fit_mixtures(points), points[::7]).similarity(points).min() > 0.5


def test_a_sample_of_which_a_tenth_is_wrong_still_finds_its_kind() -> None:
    points = clouds(3, [[-2.0, 0.0], [2.0, 0.0], [0.0, 2.5]])
    sample = np.concatenate([points[400:490], points[:10]])
    similarity = SampleVote.of(fit_mixtures(points), sample).similarity(points)
    assert similarity[400:800].mean() > 0.8
    assert np.delete(similarity, np.s_[400:800]).mean() < 0.2


@pytest.mark.parametrize("seed", range(3))
def test_a_sample_of_a_rare_kind_that_is_not_wanted_finds_no_more_of_the_rest(seed: int) -> None:
    """A sixth of the sample is of the most frequent kind, which no sample shows otherwise."""
    frequent = clouds(seed, [[2.0, 0.0], [2.0, 0.0], [0.0, 2.5]])
    wanted, rare = (np.random.default_rng(seed).normal(at, 0.2, (n, 2)) for at, n in ((-2, 200), (4, 20)))
    points = np.concatenate([frequent, wanted, rare])
    sample = np.concatenate([wanted[:100], frequent[:20]])
    for unlike in (None, rare):
        similarity = SampleVote.of(fit_mixtures(points), sample, unlike).similarity(points)
        assert similarity[1200:1400].mean() > 0.8 > 0.2 > np.delete(similarity, np.s_[1200:1400]).mean()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_rare_kind_has_a_component_that_begins_at_its_sample(seed: int) -> None:
    """One point in 200, beside a kind that none of the mixtures parts from it."""
    rng = np.random.default_rng(seed)
    frequent = clouds(seed, [[-2.0, 0.0], [2.0, 0.0], [0.0, 2.5]], 4000)
    rare = rng.normal((0.9, 0.9), 0.1, (60, 2))
    points = np.concatenate([frequent, rare])
    usual, begun = (vote.similarity(points) for vote in sample_votes(points, rare[:30])[0])
    assert begun[-60:].mean() > 0.8
    assert begun[:-60].sum() < 20 < usual[:-60].sum()


def test_a_kind_that_is_no_cloud_of_its_own_is_not_narrowed_to_its_sample() -> None:
    """Evenly spread points, of which the sample shows a part."""
    points = np.concatenate([np.linspace(-1, 2, 3000), np.linspace(-2, -1.5, 500)])[:, None]
    assert len(sample_votes(points, points[2000:2100])[0]) == 1


def test_what_is_found_for_certain_leaves_nothing_undecided() -> None:
    points = clouds(4, [[-3.0], [3.0]])
    vote = SampleVote.of(fit_mixtures(points, (2,)), points[:40])
    assert vote.undecided(points) < 0.01
    assert vote.undecided(np.zeros((1, 1))) > vote.undecided(points)
