"""Joint histograms of neighbouring cells: against plain loops, and what follows from them."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.blocks.cell_pairs import BINS, CellPairs, cells_with_mean_in_range, count_cell_pairs
from uavseg.segmentation.params.segment import IntensityRange


def block_map(means: np.ndarray, counts: np.ndarray) -> BlockMap:
    """Cells with these mean greys and numbers of valid pixels."""
    rows, cols = (8 * -(-length // 8) for length in means.shape)
    blocks = BlockMap.empty((8 * rows, 8 * cols))
    blocks.counts[: means.shape[0], : means.shape[1]] = counts
    blocks.sums[: means.shape[0], : means.shape[1]] = means * counts
    return blocks


@st.composite
def maps(draw: st.DrawFn) -> BlockMap:
    """A few cells of few greys, some with too few valid pixels."""
    shape = draw(st.integers(1, 12)), draw(st.integers(1, 12))
    rng = np.random.default_rng(draw(st.integers(0, 2**31)))
    first, reach = draw(st.sampled_from([(0, 3), (40_000, 600), (0, 65535), (65000, 535)]))
    means = first + rng.integers(0, reach + 1, shape)
    return block_map(means, rng.choice([0, 31, 32, 64], shape, p=[0.1, 0.1, 0.2, 0.6]))


def plain(blocks: BlockMap, pairs: CellPairs) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The same joint histograms, cell by cell."""
    bins = {}
    for place, count in np.ndenumerate(blocks.counts):
        if count >= 32:
            bins[place] = (int(blocks.sums[place]) // int(count) - pairs.first) // pairs.width
    cells, frame = np.zeros(BINS, int), np.zeros(BINS, int)
    near, far = np.zeros((BINS, BINS), int), np.zeros((BINS, BINS), int)
    for (row, col), own in bins.items():
        cells[own] += 1
        beside = [(row + 1, col), (row - 1, col), (row, col + 1), (row, col - 1)]
        frame[own] += any(place not in bins for place in beside)
        for table, step in ((near, 1), (far, 2)):
            for place in ((row + step, col), (row, col + step)):
                if place in bins:
                    table[min(own, bins[place]), max(own, bins[place])] += 1
    return cells, frame, near, far


@settings(max_examples=60)
@given(maps())
def test_they_are_those_of_a_plain_loop(blocks: BlockMap) -> None:
    pairs = count_cell_pairs(blocks)
    if not (blocks.counts >= 32).any():
        assert pairs is None
        return
    assert pairs is not None
    for found, wanted in zip(
        (pairs.cells, pairs.frame, pairs.near, pairs.far), plain(blocks, pairs), strict=True
    ):
        assert np.array_equal(found, wanted)
    assert pairs.cells[0] > 0 and pairs.histogram().sum() == pairs.cells.sum()


@pytest.mark.slow
@settings(max_examples=40)
@given(maps())
def test_contrasts_are_those_of_the_definition(blocks: BlockMap) -> None:
    pairs = count_cell_pairs(blocks)
    if pairs is None:
        return
    darker, brighter = np.nonzero(pairs.far)
    number = pairs.far[darker, brighter]
    contrasts, parted = pairs.contrasts()
    for bound in range(BINS + 1):
        across = (darker < bound) & (brighter >= bound)
        assert parted[bound] == number[across].sum()
        detected = np.minimum(bound - 0.5 - darker, brighter - bound + 0.5)[across] * number[across]
        wanted = pairs.width * detected.sum() / max(parted[bound], 1)
        assert contrasts[bound] == pytest.approx(wanted, rel=1e-12)


def test_a_dark_square_on_bright_ground() -> None:
    means = np.full((16, 16), 40_000)
    means[4:8, 6:10] = 10_000
    pairs = count_cell_pairs(block_map(means, np.full(means.shape, 64)))
    assert pairs is not None
    square, ground = pairs.border(0, 1), pairs.border(1, BINS)
    assert (square.share, square.frame) == (16 / 256, 0) and (ground.share, ground.frame) == (240 / 256, 1)
    assert square.compactness == 24 / (24 + 16)  # pairs within, and those along the border
    assert square.contrast == ground.contrast > 100  # nothing differs on either side
    assert square.score > ground.score == 0
    contrasts, parted = pairs.contrasts()
    last = np.flatnonzero(pairs.cells)[-1]
    assert (parted[1 : last + 1] == 32).all() and not parted[last + 1 :].any()
    assert contrasts.argmax() == pytest.approx(BINS / 2, abs=12)
    with pytest.raises(ValueError, match="no cell"):
        pairs.border(3, 40)


@pytest.mark.parametrize("v", [0.0, 0.2, 0.5, 0.999, 1.0])
def test_bounds_are_found_again(v: float) -> None:
    means = np.linspace(5000, 60_000, 64).astype(int).reshape(8, 8)
    pairs = count_cell_pairs(block_map(means, np.full(means.shape, 64)))
    assert pairs is not None
    bound = pairs.bin_of(v)
    if 0 < bound < BINS:
        assert pairs.grey_of(bound) == pytest.approx(65535 * v, abs=pairs.width / 2)
        assert pairs.bin_of(pairs.grey_of(bound) / 65535) == bound


@settings(max_examples=30)
@given(maps(), st.lists(st.floats(0, 1), min_size=2, max_size=2, unique=True))
def test_cells_of_their_own_mean(blocks: BlockMap, ends: list[float]) -> None:
    interval = IntensityRange(*sorted(ends))
    inside = cells_with_mean_in_range(blocks, interval)
    for place, count in np.ndenumerate(blocks.counts):
        wanted = count > 0 and interval.low <= blocks.sums[place] / (65535.0 * int(count)) <= interval.high
        assert inside[place] == wanted
