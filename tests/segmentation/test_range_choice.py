"""Ranges are chosen by what lies at their borders: small things are found, noise is not, either way round."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy import ndimage

from uavseg.segmentation.blocks.cell_pairs import count_cell_pairs
from uavseg.segmentation.blocks.leaves import histogram_of_means
from uavseg.segmentation.in_memory import block_map_of_array
from uavseg.segmentation.params.segment import SegmentParams
from uavseg.segmentation.range_choice import (
    MIN_CONTRAST,
    RangeChoice,
    choose_ranges,
    edge_near,
    explained_variance,
)

SIDE = 384


def chosen(v: np.ndarray, n_classes: int | None = None) -> RangeChoice:
    blocks = block_map_of_array(np.round(np.clip(v, 0, 1) * 65535).astype(np.uint16))
    return choose_ranges(
        histogram_of_means(blocks, SegmentParams().division), count_cell_pairs(blocks), n_classes
    )


def noise(seed: int, scale: float, sigma: float) -> np.ndarray:
    """Noise, blurred by `scale` pixels, with this standard deviation."""
    field = np.random.default_rng(seed).normal(size=(SIDE, SIDE))
    field = ndimage.gaussian_filter(field, scale, mode="wrap") if scale else field
    return np.asarray(sigma * field / field.std())


def squares(seed: int, step: float) -> np.ndarray:
    """Small squares on a slope."""
    rng = np.random.default_rng(seed)
    v = 0.45 + np.linspace(-0.05, 0.05, SIDE)[:, None] + noise(seed, 0, 0.03)
    for row, col in rng.integers(0, SIDE - 16, (12, 2)):
        v[row : row + 16, col : col + 16] += step
    return np.asarray(v)


def check_order(found: RangeChoice) -> None:
    """A part comes after the class that it stands out from, and after a class and its complement."""
    ranked = [found.ranges[k] for k in found.ranked]
    classes = [one for one in found.ranges if not one.is_part]
    assert not any(one.is_part for one in ranked[:2])
    for place, part in enumerate(ranked):
        if part.is_part:
            [whole] = [one for one in classes if one.low <= part.low and part.high <= one.high]
            assert whole in ranked[:place]
            assert part.border is not None and whole.border is not None
            assert part.border.contrast >= min(4, max(MIN_CONTRAST, whole.border.contrast))
            assert part.border.share < whole.border.share


def skewed(seed: int, scale: float = 20) -> np.ndarray:
    """Texture whose bright tail no valley separates, as of light on water or leaves."""
    return np.asarray(0.1 * np.exp(0.7 * noise(seed, scale, 1)) + noise(seed + 9, 0, 0.03))


def overlapping(seed: int, level: float = 0.1) -> np.ndarray:
    """Two grounds a standard deviation apart, in texture of their own size."""
    field = noise(seed, 16, 1)
    return np.asarray(0.5 + 0.1 * field + 0.1 * (field > 0.3) + noise(seed + 7, 0, level))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_a_class_then_its_complement_then_its_parts(seed: int) -> None:
    for v in (skewed(seed), skewed(seed, 8), squares(seed, 0.12), squares(seed, -0.08), overlapping(seed)):
        found = chosen(v)
        check_order(found)
        classes = [one for one in found.ranges if not one.is_part]
        if len(classes) == 2:
            assert [found.ranges[k] for k in found.ranked[:2]] == sorted(classes, key=lambda one: -one.score)
    assert any(one.is_part for one in chosen(skewed(0)).ranges)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_the_list_of_a_negative_is_the_list_mirrored(seed: int) -> None:
    for v in (skewed(seed), squares(seed, 0.25), squares(seed, -0.25), overlapping(seed)):
        here, negative = chosen(v), chosen(1 - v)
        ends = [
            [(one.low, one.high) for one in map(found.ranges.__getitem__, found.ranked)]
            for found in (here, negative)
        ]
        assert [(1 - high, 1 - low) for low, high in ends[1]] == [
            pytest.approx(one, abs=0.012) for one in ends[0]
        ]
        assert negative.separated == here.separated
        assert negative.contrast == pytest.approx(here.contrast, rel=0.1)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("step", [0.25, -0.25])
def test_small_things_that_stand_out_far_are_a_class(seed: int, step: float) -> None:
    found = chosen(squares(seed, step))
    classes = [one for one in found.ranges if not one.is_part]
    outermost = classes[-1 if step > 0 else 0]
    assert outermost is found.ranges[found.ranked[0]]
    assert outermost.border is not None and outermost.border.contrast >= 3 * MIN_CONTRAST
    others = [one.score for one in classes if one is not outermost]
    assert outermost.score > 2 * max(others)


@pytest.mark.parametrize("seed", range(3))
def test_few_cells_of_a_texture_are_no_class(seed: int) -> None:
    """The brightest cells of a tail stand out from its classes, but less than three times as far as these."""
    v = 0.15 * np.exp(0.4 * noise(seed, 8, 1)) + noise(seed + 9, 0, 0.018)
    for found in (chosen(v), chosen(1 - v)):
        classes = [one for one in found.ranges if not one.is_part]
        assert len(classes) == 2 and not found.separated
        assert all(one.border is not None and one.border.share > 0.1 for one in classes)
        assert [found.ranges[k].is_part for k in found.ranked] == [False, False, True]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("step", [0.25, -0.25])
def test_small_things_come_first(seed: int, step: float) -> None:
    found = chosen(squares(seed, step))
    first = found.ranges[found.ranked[0]]
    edge = first.low if step > 0 else first.high
    assert edge == pytest.approx(0.45 + step / 2, abs=0.08)
    assert first.border is not None and first.border.share < 0.05 and first.border.contrast > 8


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("scale", "sigma"), [(0, 0.1), (0, 0.02), (3, 0.1), (10, 0.1), (30, 0.1)])
def test_noise_and_slow_light_do_not_stand_out(seed: int, scale: float, sigma: float) -> None:
    found = chosen(0.5 + noise(seed, scale, sigma))
    assert found.contrast is not None and found.contrast < MIN_CONTRAST
    assert not any(one.is_part for one in found.ranges)


@pytest.mark.parametrize("seed", range(3))
def test_a_slope_does_not_stand_out(seed: int) -> None:
    found = chosen(np.linspace(0.2, 0.8, SIDE)[:, None] + noise(seed, 0, 0.03))
    assert found.contrast is not None and found.contrast < MIN_CONTRAST


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("level", [0.05, 0.1])
def test_two_grounds_stand_out(seed: int, level: float) -> None:
    found = chosen(0.4 + 0.25 * (noise(seed, 16, 1) > 0.3) + noise(seed + 50, 0, level))
    assert found.contrast is not None and found.contrast > MIN_CONTRAST
    assert any(abs(edge - 0.525) < 0.05 for edge in found.edges)


@pytest.mark.parametrize("seed", range(3))
def test_a_negative_and_a_turned_picture_have_the_same_ranges(seed: int) -> None:
    v = squares(seed, 0.25)
    here = chosen(v)
    for turned in (v.T, v[::-1], v[:, ::-1]):
        assert chosen(np.ascontiguousarray(turned)).edges == pytest.approx(here.edges, abs=0.012)
    negative = chosen(1 - v)
    assert negative.edges == pytest.approx([1 - edge for edge in here.edges[::-1]], abs=0.012)
    assert len(negative.ranges) == len(here.ranges)
    first, other = (one.ranges[one.ranked[0]] for one in (here, negative))
    assert (1 - other.high, 1 - other.low) == pytest.approx((first.low, first.high), abs=0.012)


@pytest.mark.slow
@settings(max_examples=25)
@given(st.integers(0, 2**31), st.sampled_from([None, 2, 3, 6]), st.sampled_from([0, 2, 9]), st.booleans())
def test_what_a_choice_is(seed: int, n_classes: int | None, scale: float, refined: bool) -> None:
    rng = np.random.default_rng(seed)
    v = rng.choice([0.2, 0.5, 0.6, 0.9]) + noise(seed, scale, rng.choice([0.001, 0.05, 0.2]))
    v = v[: rng.integers(1, SIDE), : rng.integers(1, SIDE)]
    blocks = block_map_of_array(np.round(np.clip(v, 0, 1) * 65535).astype(np.uint16))
    histogram = histogram_of_means(blocks, SegmentParams().division)
    found = choose_ranges(histogram, count_cell_pairs(blocks), n_classes, refined)
    classes = [one for one in found.ranges if not one.is_part]
    parts = [one for one in found.ranges if one.is_part]
    assert found.ranges == (*classes, *parts) and sorted(found.ranked) == list(range(len(found.ranges)))
    assert [one.low for one in classes] == [0, *found.edges] and [one.high for one in classes] == [
        *found.edges,
        1,
    ]
    assert list(found.edges) == sorted(set(found.edges))
    assert len(classes) <= (n_classes or 6) and (n_classes is None or not parts)
    for part in parts:
        assert (part.low == 0 and part.high < found.edges[0]) or (
            part.high == 1 and part.low > found.edges[-1]
        )
    ranked = [found.ranges[k] for k in found.ranked]
    scores = [one.score for one in ranked if not one.is_part]
    assert scores == sorted(scores, reverse=True)
    check_order(found)
    assert 0 <= found.explained <= 1 + 1e-12


@given(st.integers(0, 2**31), st.floats(-0.5, 65535.5))
def test_an_edge_near_a_grey_parts_what_the_grey_parts(seed: int, grey: float) -> None:
    rng = np.random.default_rng(seed)
    histogram = np.zeros(65536, np.int64)
    greys = rng.integers(0, 65536, rng.integers(1, 30))
    histogram[greys] = 1
    edge = edge_near(histogram, grey)
    if (greys < grey).all() or (greys >= grey).all():
        assert edge is None
        return
    assert edge is not None and 0 < edge < 1 and round(edge, 6) == edge
    reach = 4 * -(-(greys.max() - greys.min() + 1) // 256)
    assert abs(edge * 65535 - grey) <= reach + 2 or ((greys < grey) == (greys < edge * 65535)).all()
    assert (greys <= edge * 65535).any() and (greys > edge * 65535).any()


def test_a_number_of_few_digits_is_the_edge() -> None:
    histogram = np.zeros(65536, np.int64)
    histogram[[6000, 60000]] = 5
    assert edge_near(histogram, 32800) == 0.5
    assert edge_near(histogram, 32800, 0.0, 0.6) is None


@given(st.lists(st.floats(0.001, 0.999), min_size=1, max_size=4, unique=True), st.integers(0, 2**31))
def test_the_explained_variance_is_that_of_a_plain_sum(edges: list[float], seed: int) -> None:
    greys = np.random.default_rng(seed).integers(0, 65536, 50)
    classes = np.searchsorted(sorted(edges), greys / 65535)
    between = sum(
        (classes == k).sum() * (greys[classes == k].mean() - greys.mean()) ** 2 for k in np.unique(classes)
    )
    wanted = between / ((greys - greys.mean()) ** 2).sum()
    found = explained_variance(np.bincount(greys, minlength=65536), sorted(edges))
    assert found == pytest.approx(wanted, abs=1e-9)
