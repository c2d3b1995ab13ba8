"""Classification of pixels does not depend on strips, tiles or threads."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tests.segmentation.in_memory_dataset import field_of, source_of
from uavseg.execution.executors import Map, serial, threads
from uavseg.raster.grid.tiling import TilePass
from uavseg.segmentation.params.segment import StateLimits
from uavseg.segmentation.states.classify_strips import classify_states, state_strips

SHAPE = (200, 150)
LIMITS = StateLimits(0.4, 0.6)


def tiles_of(side: int, run: Map = serial) -> TilePass:
    return TilePass([tile for strip in state_strips(SHAPE, SHAPE, side) for tile in strip], run)


@pytest.mark.parametrize("refine", ["scan", "none"])
@pytest.mark.parametrize("run, tile", [(serial, 64), (threads(2), 64), (threads(2), 128)])
@pytest.mark.parametrize("seed", range(3))
def test_strips_and_threads_change_nothing(seed: int, run: Map, tile: int, refine: str) -> None:
    source = source_of(field_of(seed, SHAPE))
    cells = np.random.default_rng(seed).integers(1, 4, (32, 24)).astype(np.uint8)
    whole = classify_states(source, cells, LIMITS, refine, tiles_of(256))  # type: ignore[arg-type]
    found = classify_states(source, cells, LIMITS, refine, tiles_of(tile, run))  # type: ignore[arg-type]
    assert np.array_equal(found.image.read(), whole.image.read())
    assert np.array_equal(found.codes, whole.codes)


def test_counts_are_those_of_the_image() -> None:
    dataset = field_of(1, SHAPE)
    cells = np.random.default_rng(1).integers(1, 4, (32, 24)).astype(np.uint8)
    found = classify_states(source_of(dataset), cells, LIMITS, "scan", tiles_of(64))
    states, by_value = found.image.read(), dataset.valid & (dataset.values / 255 > 0.6)
    assert found.pixels == {state: int((states == state).sum()) for state in range(4)}
    assert found.occupied_in_free == ((states == 1) & by_value).sum()
    assert found.occupied_by_value == by_value.sum()


@given(st.tuples(st.integers(1, 300), st.integers(1, 300)), st.sampled_from([64, 128, 192]))
def test_strips_cover_every_pixel_once(shape: tuple[int, int], tile: int) -> None:
    covered = np.zeros(shape, int)
    for strip in state_strips(shape, (64, 64), tile):
        assert len({(window.row, window.rows) for window in strip}) == 1
        for window in strip:
            covered[window.slices] += 1
    assert (covered == 1).all()
