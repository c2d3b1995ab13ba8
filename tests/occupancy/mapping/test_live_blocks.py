"""Incremental division of some blocks gives what the division of all blocks gives."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.occupancy.mapping.live import _classify_leaves, _required_ratios_at
from uavseg.segmentation import in_memory
from uavseg.segmentation.blocks.block_map import BlockMap, required_ratios
from uavseg.segmentation.blocks.leaves import cell_intervals
from uavseg.segmentation.params.segment import DivisionParams
from uavseg.segmentation.pipeline import LeafQuery

EDGES = [(0.3, 0.6), (0.5,), (0.1, 0.2, 0.4, 0.9)]
DIVISIONS = [DivisionParams(1.2, 0.05), DivisionParams(1.0, np.inf), DivisionParams(3.0, 0.4)]


def blocks_of(seed: int) -> BlockMap:
    """The block map of 2 x 3 blocks, patches of two sizes and noise."""
    rng = np.random.default_rng(seed)
    patches = rng.integers(0, 60000, (5, 8)).repeat(27, 0).repeat(21, 1)[:128, :166]
    return in_memory.block_map_of_array((patches + rng.integers(0, 3000, patches.shape)).astype(np.uint16))


def indices(chosen: NDArray[np.bool_]) -> NDArray[np.int64]:
    return np.ascontiguousarray(np.argwhere(chosen))


@pytest.mark.parametrize("edges", EDGES)
@pytest.mark.parametrize("division", DIVISIONS)
@settings(max_examples=15)
@given(st.integers(0, 2**32), st.lists(st.booleans(), min_size=6, max_size=6))
def test_some_blocks_are_as_in_the_whole(
    edges: tuple[float, ...], division: DivisionParams, seed: int, choice: list[bool]
) -> None:
    blocks, query = blocks_of(seed), LeafQuery(edges, division)
    chosen = np.array(choice).reshape(2, 3)
    required = _required_ratios_at(blocks, query, indices(chosen))
    whole = required_ratios(blocks.sums, blocks.counts, edges, division.step)
    assert (required == whole[chosen]).all()
    scratch = np.zeros(blocks.counts.shape, np.uint8), np.zeros(blocks.counts.shape)
    found = np.full(blocks.counts.shape, 99, np.uint8)
    _classify_leaves(blocks, query, indices(chosen), required, scratch, found)
    inside = chosen.repeat(8, 0).repeat(8, 1)
    expected = np.where(blocks.counts > 0, cell_intervals(blocks, edges, division), 0)
    assert (found[inside] == expected[inside]).all()
    assert (found[~inside] == 99).all()  # no other block is written to
