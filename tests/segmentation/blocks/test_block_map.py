"""Leaves cover every cell, larger ones with larger thresholds; required ratios are enough for a range."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.segmentation.blocks.block_map import BlockMap, cell_sums, find_leaves, required_ratios
from uavseg.segmentation.blocks.division import RATIOS, block_ratios
from uavseg.segmentation.blocks.lbp import contrast_bin_edges, contrast_histogram
from uavseg.segmentation.blocks.leaves import cell_classes, cell_intervals, cells_in_range
from uavseg.segmentation.params.segment import (
    DivisionParams,
    IntensityRange,
    Levels,
    StateLimits,
    partition_of_levels,
)

INF = np.inf
seeds = st.integers(0, 10_000)
thresholds = st.sampled_from([0.0, 1.0, 1.1, 1.2, 2.0, INF])
steps = st.sampled_from([0.0, 0.01, 0.05, 0.3, 1.0, INF])


def random_map(seed: int, shape: tuple[int, int] = (150, 190)) -> BlockMap:
    """Random sums, counts and ratios: plains, steps, noise and empty cells."""
    rng = np.random.default_rng(seed)
    blocks = BlockMap.empty(shape)
    rows, cols = blocks.counts.shape
    blocks.counts[:] = rng.choice([0, 1, 31, 64, 64, 64, 64, 64], (rows, cols))
    side = int(rng.choice([1, 2, 4, 8, 16]))
    greys = rng.choice([0, 13107, 26214, 30000, 65535], int(rng.choice([2, 5])))
    levels = rng.choice(greys, (rows // side + 1, cols // side + 1))
    noise = rng.integers(0, 1 + int(rng.choice([0, 3000])), (rows, cols))
    mean = levels.repeat(side, 0).repeat(side, 1)[:rows, :cols] + noise
    blocks.sums[:] = (
        np.clip(mean + (rng.random((rows, cols)) < rng.choice([0, 0.1])) * 9000, 0, 65535) * blocks.counts
    )
    blocks.ratios[:] = rng.choice([0.0, 1.0, 1.15, 1.2, 1.21, 3.0, INF], blocks.ratios.shape)
    return blocks


def mean_of(blocks: BlockMap, row: int, col: int, size: int) -> float:
    part = np.s_[row : row + size, col : col + size]
    count = int(blocks.counts[part].sum())
    return int(blocks.sums[part].sum()) / (65535 * count) if count else -1.0


def plain_leaves(blocks: BlockMap, X: float, tau: float) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """The division by recursion, from a block of 64 down to cells."""
    side = np.zeros(blocks.counts.shape, np.uint8)
    mean = np.zeros(blocks.counts.shape)

    def divide(block: NDArray[np.float64], top: int, left: int, down: int, right: int, size: int) -> None:
        half, row, col = size // 2, top + down, left + right
        if size > 1:
            first = {8: 0, 4: 1, 2: 5}[size]
            ratio = block[first + down // size * (8 // size) + right // size]
            means = [mean_of(blocks, row + r, col + c, half) for r in (0, half) for c in (0, half)]
            means = [m for m in means if m >= 0]
            if ratio > X or (means and max(means) - min(means) > tau):
                for r in (0, half):
                    for c in (0, half):
                        divide(block, top, left, down + r, right + c, half)
                return
        side[row : row + size, col : col + size] = 8 * size
        mean[row : row + size, col : col + size] = mean_of(blocks, row, col, size)

    for b, c in np.ndindex(blocks.blocks):
        divide(blocks.ratios[b, c], 8 * b, 8 * c, 0, 0, 8)
    return side, mean


def number_of_leaves(side: NDArray[np.uint8]) -> float:
    return float(((8.0 / side) ** 2).sum())


@pytest.mark.slow
@settings(max_examples=40)
@given(seeds, thresholds, steps)
def test_leaves_are_those_of_a_plain_recursion(seed: int, X: float, tau: float) -> None:
    blocks = random_map(seed, (130, 70))
    side, mean = find_leaves(blocks, DivisionParams(X, tau))
    plain_side, plain_mean = plain_leaves(blocks, X, tau)
    assert np.array_equal(side, plain_side)
    assert np.array_equal(mean, plain_mean)


@pytest.mark.slow
@settings(max_examples=40)
@given(seeds, thresholds, steps)
def test_leaves_cover_every_cell_once_with_the_mean_of_their_pixels(seed: int, X: float, tau: float) -> None:
    blocks = random_map(seed)
    side, mean = find_leaves(blocks, DivisionParams(X, tau))
    assert set(np.unique(side)) <= {8, 16, 32, 64}
    for size in (1, 2, 4, 8):
        rows, cols = np.nonzero(side == 8 * size)
        for row, col in {(r // size * size, c // size * size) for r, c in zip(rows, cols, strict=True)}:
            part = np.s_[row : row + size, col : col + size]
            assert (side[part] == 8 * size).all()
            assert (mean[part] == mean_of(blocks, row, col, size)).all()


@given(seeds)
@settings(max_examples=10)
def test_a_division_without_tests_keeps_whole_blocks(seed: int) -> None:
    side, _ = find_leaves(random_map(seed), DivisionParams(INF, INF))
    assert (side == 64).all()


def test_a_threshold_below_every_ratio_divides_to_cells() -> None:
    blocks = random_map(1)
    blocks.ratios[:] = 1.0
    assert (find_leaves(blocks, DivisionParams(0.0, INF))[0] == 8).all()
    assert (find_leaves(blocks, DivisionParams(1.0, INF))[0] == 64).all()  # R > X divides, R = X does not


def test_means_that_differ_by_exactly_the_step_do_not_divide() -> None:
    blocks = BlockMap.empty((64, 64))
    blocks.counts[:] = 64
    blocks.sums[:, 4:] = 64 * 65535 // 5  # 0.2 against 0
    assert (find_leaves(blocks, DivisionParams(INF, 0.2))[0] == 64).all()
    assert (find_leaves(blocks, DivisionParams(INF, 0.2 - 1e-12))[0] == 32).all()


@settings(max_examples=40)
@given(seeds, thresholds, thresholds, steps, steps)
def test_more_allowed_never_makes_more_leaves(
    seed: int, X1: float, X2: float, tau1: float, tau2: float
) -> None:
    blocks = random_map(seed)
    finer, _ = find_leaves(blocks, DivisionParams(min(X1, X2), min(tau1, tau2)))
    coarser, _ = find_leaves(blocks, DivisionParams(max(X1, X2), max(tau1, tau2)))
    assert (coarser >= finer).all()
    assert number_of_leaves(coarser) <= number_of_leaves(finer)


@pytest.mark.parametrize("rows", [slice(0, 1), slice(1, 3), slice(2, 99), slice(1, None), slice(3, 3)])
def test_a_strip_of_leaves_is_that_part_of_all(rows: slice) -> None:
    blocks = random_map(7, (250, 100))
    for part, whole in zip(
        find_leaves(blocks, DivisionParams(1.2, 0.05), rows),
        find_leaves(blocks, DivisionParams(1.2, 0.05)),
        strict=True,
    ):
        first, last, _ = rows.indices(4)
        assert np.array_equal(part, whole[8 * first : 8 * last])


@pytest.mark.parametrize("margin", [0, 1, 64])
def test_cells_add_up_their_own_pixels(margin: int) -> None:
    rng = np.random.default_rng(margin)
    valid = (rng.random((64 + 2 * margin, 128 + 2 * margin)) > 0.2).astype(np.uint8)
    grey = rng.integers(0, 65536, valid.shape).astype(np.uint16) * valid
    sums, counts = cell_sums(grey, valid, margin)
    inner = np.s_[margin : 64 + margin, margin : 128 + margin]
    assert np.array_equal(counts, valid[inner].reshape(8, 8, 16, 8).sum(axis=(1, 3)))
    assert np.array_equal(sums, grey[inner].astype(np.int64).reshape(8, 8, 16, 8).sum(axis=(1, 3)))


def test_a_white_cell_of_64_pixels_does_not_overflow() -> None:
    sums, counts = cell_sums(np.full((8, 8), 65535, np.uint16), np.ones((8, 8), np.uint8))
    assert (sums.item(), counts.item()) == (64 * 65535, 64)


def known_only_where(blocks: BlockMap, required: NDArray[np.uint32], otherwise: float) -> BlockMap:
    bits = required[..., None] >> np.arange(RATIOS, dtype=np.uint32) & 1
    ratios = np.where(bits, blocks.ratios, otherwise)
    return BlockMap(blocks.shape, blocks.sums, blocks.counts, ratios)


def assert_other_ratios_have_no_influence(
    blocks: BlockMap, interval: IntensityRange, X: float, tau: float
) -> None:
    required = required_ratios(blocks.sums, blocks.counts, interval.edges, tau)
    full = valid_cells_in_range(blocks, interval, X, tau)
    for otherwise in (0.0, INF):
        some = known_only_where(blocks, required, otherwise)
        assert np.array_equal(valid_cells_in_range(some, interval, X, tau), full)


def valid_cells_in_range(
    blocks: BlockMap, interval: IntensityRange, X: float, tau: float
) -> NDArray[np.uint8]:
    """Cells in range that have a pixel."""
    return cells_in_range(blocks, interval, DivisionParams(X, tau)) & (blocks.counts > 0)


ends = st.tuples(
    st.sampled_from([0.0, 0.1, 0.2, 0.4, 0.45777065, 0.6]), st.sampled_from([0.2, 0.3, 0.4, 0.5, 0.99, 1.0])
).filter(lambda pair: pair[0] < pair[1])


@pytest.mark.slow
@settings(max_examples=200)
@given(seeds, ends, thresholds, steps)
def test_required_ratios_are_enough_for_a_range(
    seed: int, pair: tuple[float, float], X: float, tau: float
) -> None:
    assert_other_ratios_have_no_influence(random_map(seed), IntensityRange(*pair), X, tau)


def cells_of_limits(blocks: BlockMap, limits: StateLimits, division: DivisionParams) -> np.ndarray:
    return cell_intervals(blocks, limits.edges, division)


@settings(max_examples=60)
@given(seeds, st.sampled_from([0.1, 0.3, 0.001, 1.0]), thresholds, steps)
def test_required_ratios_are_enough_for_levels_and_states(
    seed: int, width: float, X: float, tau: float
) -> None:
    blocks, levels, limits = random_map(seed), Levels(width), StateLimits()
    there = blocks.counts > 0
    for intervals, answer in ((partition_of_levels(levels), cell_classes), (limits, cells_of_limits)):
        required = required_ratios(blocks.sums, blocks.counts, intervals.edges, tau)
        full = answer(blocks, intervals, DivisionParams(X, tau))[there]
        for otherwise in (0.0, INF):
            some = known_only_where(blocks, required, otherwise)
            assert np.array_equal(answer(some, intervals, DivisionParams(X, tau))[there], full)


def block_map_of(grey: NDArray[np.uint16], valid: NDArray[np.uint8]) -> BlockMap:
    """Sums, counts and R of an image whose sides are multiples of 64."""
    blocks = BlockMap.empty(grey.shape)
    blocks.sums[:], blocks.counts[:] = cell_sums(grey, valid)
    around, known = np.pad(grey, 1), np.pad(valid, 1)
    corners = np.ascontiguousarray(np.argwhere(np.ones(blocks.blocks))) * 64
    found = block_ratios(around, known, contrast_bin_edges(contrast_histogram(around, known)), corners)
    blocks.ratios[:] = found.reshape(blocks.ratios.shape)
    return blocks


@pytest.mark.parametrize("seed", range(20))
def test_required_ratios_are_enough_for_images(seed: int) -> None:
    rng = np.random.default_rng(seed)
    coarse = rng.random((192 // 24, 256 // 32)).repeat(24, 0).repeat(32, 1)
    image = coarse * rng.choice([0.2, 1]) + rng.normal(0, rng.choice([0.001, 0.05]), coarse.shape)
    valid = (rng.random(coarse.shape) > rng.choice([0, 0.5])).astype(np.uint8)
    grey = (np.clip(image, 0, 1) * 65535).astype(np.uint16) * valid
    blocks = block_map_of(grey, valid)
    for low, high in ((0.0, 0.3), (0.4, 0.6), (0.25, 1.0)):
        for X in (1.05, 1.2, 2.0):
            for tau in (0.05, 0.2, INF):
                assert_other_ratios_have_no_influence(blocks, IntensityRange(low, high), X, tau)


def test_a_plain_block_requires_no_ratio_and_a_mixed_one_does() -> None:
    blocks = BlockMap.empty((64, 3 * 64))
    blocks.counts[:] = 64
    blocks.sums[:] = 64 * 65535 // 2
    blocks.sums[0, 8] = 0  # one cell of the second block
    blocks.counts[:, 16:] = 0
    blocks.sums[:, 16:] = 0
    # the block itself, its first quarter, and the first quarter of that
    assert required_ratios(blocks.sums, blocks.counts, IntensityRange(0.4, 0.6).edges, INF).tolist() == [
        [0, 0b100011, 0]
    ]
    assert required_ratios(blocks.sums, blocks.counts, IntensityRange(0.6, 0.9).edges, INF).tolist() == [
        [0, 0, 0]
    ]


def test_a_block_that_intensity_divides_to_cells_requires_no_ratio() -> None:
    blocks = BlockMap.empty((64, 64))
    blocks.counts[:] = 64
    blocks.sums[0, 0] = 64 * 65535
    assert required_ratios(blocks.sums, blocks.counts, IntensityRange(0.5, 1.0).edges, 0.06).item() == 0
    # the means of its quarters are 1/16, 0, 0 and 0
    assert required_ratios(blocks.sums, blocks.counts, IntensityRange(0.5, 1.0).edges, 0.07).item() == 1
