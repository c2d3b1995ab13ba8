"""Thin obstacles are those of a slow plain version, whatever the tiles, and laws of what is never lost."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from scipy import ndimage

from tests import plain_thin_obstacles as plain
from tests.segmentation.in_memory_dataset import InMemory, source_of
from tests.segmentation.states.whole_states import refine_states
from uavseg.execution.executors import Map, serial, threads
from uavseg.raster.grid.tiling import TilePass
from uavseg.segmentation.params.segment import StateLimits
from uavseg.segmentation.states import thin_structures
from uavseg.segmentation.states.classify_strips import (
    ClassifiedStates,
    classify_states,
    state_strips,
    states_by_value,
)
from uavseg.segmentation.states.state_scans import encode_states

LIMITS = StateLimits(0.45, 0.55)
SHAPE = (150, 200)
FREE, UNKNOWN, OCCUPIED = 1, 2, 3


def thin_map(seed: int, trinary: bool, shape: tuple[int, int] = SHAPE) -> InMemory:
    """Walls of one to three cells at any angle, poles and specks, with noise unless it is trinary."""
    rng = np.random.default_rng(seed)
    v = np.full(shape, 0.1)
    v[:, : shape[1] // 3] = 0.5
    row, col = np.indices(shape)
    for _ in range(6):
        angle, offset = rng.uniform(0, np.pi), rng.uniform(0, 150)
        across = np.abs(row * np.cos(angle) + col * np.sin(angle) - offset)
        along = np.abs(col * np.cos(angle) - row * np.sin(angle) - rng.uniform(-100, 150))
        v[(across < rng.choice([0.6, 1, 1.5])) & (along < rng.uniform(3, 80))] = rng.choice([0.7, 0.95, 1.0])
    v[rng.random(shape) < 0.003] = rng.choice([0.6, 0.9, 1.0])
    if trinary:
        v = np.select([v < 0.4, v > 0.6], [0.0, 1.0], 0.5)
    else:
        v += rng.normal(0, rng.choice([0, 0.02, 0.06]), shape)
    valid = rng.random(shape) > rng.choice([0, 0.02])
    return InMemory(np.clip(np.rint(255 * v), 0, 255).astype(np.uint8), valid)


def cells_of(seed: int, shape: tuple[int, int]) -> NDArray[np.uint8]:
    """States of leaves: free or unknown, some of them occupied."""
    rng = np.random.default_rng(seed)
    blocks = tuple(-(-side // 64) * 8 for side in shape)
    return rng.choice([FREE, UNKNOWN, OCCUPIED], blocks, p=[0.7, 0.25, 0.05]).astype(np.uint8)


def classified(
    dataset: InMemory, seed: int, restore: bool, tile: int = 256, run: Map = serial
) -> ClassifiedStates:
    shape = dataset.geobox.shape
    windows = [tile for strip in state_strips(shape, shape, tile) for tile in strip]
    source, tile_pass = source_of(dataset), TilePass(windows, run)
    own = states_by_value(source, LIMITS, tile_pass) if restore else None
    return own or classify_states(source, cells_of(seed, shape), LIMITS, "scan", tile_pass, restore)


def grey_of(dataset: InMemory) -> NDArray[np.uint16]:
    return np.where(dataset.valid, dataset.values.astype(np.uint16) * 257, 0).astype(np.uint16)


def scanned_states(dataset: InMemory, seed: int) -> NDArray[np.uint8]:
    """States after the scans, of whole arrays, with the free pixels of unknown leaves."""
    rows, cols = dataset.geobox.shape
    padding = (0, -rows % 64), (0, -cols % 64)
    valid = np.pad(dataset.valid, padding).astype(np.uint8)
    grey = np.pad(grey_of(dataset), padding)
    leaves = np.where(valid, cells_of(seed, (rows, cols)).repeat(8, axis=0).repeat(8, axis=1), 0)
    states = plain.with_free_of_mixed(leaves.astype(np.uint8), grey, LIMITS.edges)
    return refine_states(encode_states(states, LIMITS.table[grey]))[:rows, :cols]


@pytest.mark.slow
@settings(max_examples=30)
@given(st.integers(0, 10**6), st.booleans(), st.sampled_from([64, 128]))
def test_thin_obstacles_are_those_of_the_plain_version(seed: int, trinary: bool, tile: int) -> None:
    dataset = thin_map(seed, trinary)
    before = classified(dataset, seed, restore=False)
    found = classified(dataset, seed, restore=True, tile=tile)
    values = grey_of(dataset), dataset.valid, LIMITS.edges
    assert before.noise == pytest.approx(plain.noise(*values), rel=1e-12)
    assert before.trinary == plain.is_trinary(*values)
    assert before.thin.lost == plain.lost(before.image.read(), *values)
    if before.trinary:
        own = np.where(dataset.valid, LIMITS.of(dataset.values / 255), 0)
        assert np.array_equal(found.image.read(), own) and not any(found.thin.restored.values())
        return
    scanned = scanned_states(dataset, seed)
    assert np.array_equal(found.image.read(), plain.restored(scanned, *values))
    changed = {k: int(((scanned == k) & (found.image.read() == OCCUPIED)).sum()) for k in (1, 2)}
    assert found.thin.restored == changed and found.thin.lost == 0
    assert found.pixels == {state: int((found.image.read() == state).sum()) for state in range(4)}


@settings(max_examples=30)
@given(st.integers(0, 10**6), st.tuples(st.integers(1, 190), st.integers(1, 190)))
def test_every_cell_of_a_trinary_map_stays_what_it_is(seed: int, shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(seed)
    values = rng.choice([0, 127, 255], shape, p=rng.dirichlet([1, 1, 1])).astype(np.uint8)
    dataset = InMemory(values, rng.random(shape) > rng.choice([0, 0.1]))
    found = classified(dataset, seed, restore=True)
    assert np.array_equal(found.image.read(), np.where(dataset.valid, LIMITS.of(values / 255), 0))
    assert found.unknown_in_free == found.occupied_in_free == 0
    assert found.pixels == {state: int((found.image.read() == state).sum()) for state in range(4)}


@pytest.mark.slow
@settings(max_examples=40)
@given(st.integers(0, 10**6))
def test_no_obstacle_of_three_cells_above_the_noise_is_lost(seed: int) -> None:
    dataset = thin_map(seed, trinary=False)
    found = classified(dataset, seed, restore=True)
    v, occupied = dataset.values / 255, found.image.read() == OCCUPIED
    weakest = plain.weakest_of(grey_of(dataset), dataset.valid, LIMITS.edges)
    assert 0.55 <= weakest <= 0.65
    labels, count = ndimage.label(dataset.valid & (v > weakest), np.ones((3, 3)))
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    lost = [k for k in range(1, count + 1) if sizes[k] >= 3 and not occupied[labels == k].any()]
    # Only a weaker cell of the same obstacle may be the one that is occupied.
    beside = ndimage.binary_dilation(occupied & (v > 0.55) & (v <= weakest), np.ones((3, 3)))
    assert all(beside[labels == k].any() for k in lost)
    assert found.noise > 0 or not lost


@pytest.mark.parametrize("run, tile", [(serial, 64), (threads(2), 64), (threads(2), 128)])
@pytest.mark.parametrize("chunk", [1, 1 << 22])
@pytest.mark.parametrize("seed", range(3))
def test_tiles_threads_and_chunks_change_nothing(
    seed: int, run: Map, tile: int, chunk: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    dataset = thin_map(seed, trinary=False, shape=(300, 260))
    for restore in (False, True):
        whole = classified(dataset, seed, restore, tile=512)
        with monkeypatch.context() as patch:
            patch.setattr(thin_structures, "_CHUNK_PIXELS", chunk)
            found = classified(dataset, seed, restore, tile, run)
        assert np.array_equal(found.image.read(), whole.image.read())
        assert found.thin == whole.thin and np.array_equal(found.codes, whole.codes)
        assert found.noise == whole.noise
    assert whole.thin.restored[FREE] > 0


def test_a_wall_over_all_tiles_is_one_obstacle() -> None:
    values = np.zeros((320, 320), np.uint8)
    np.fill_diagonal(values, 255)
    values[:, 300] = 200
    dataset = InMemory(values, np.ones(values.shape, bool))
    windows = [tile for strip in state_strips(values.shape, values.shape, 64) for tile in strip]
    free = np.ones((40, 40), np.uint8)
    found = classify_states(source_of(dataset), free, LIMITS, "scan", TilePass(windows))
    assert found.thin.lost == 1 and not found.trinary
    kept = classify_states(source_of(dataset), free, LIMITS, "scan", TilePass(windows), True)
    assert kept.thin.restored == {FREE: 320 + 319, UNKNOWN: 0} and kept.thin.lost == 0


def test_noise_is_not_called_an_obstacle() -> None:
    """Cells around one half, half of them above the limit of occupied: nothing is restored, ten times."""
    for seed in range(10):
        rng = np.random.default_rng(seed)
        values: Any = np.clip(np.rint(127.5 + rng.normal(0, 12, (256, 256))), 0, 255).astype(np.uint8)
        dataset = InMemory(values, np.ones(values.shape, bool))
        unknown = np.full((32, 32), UNKNOWN, np.uint8)
        windows = [tile for strip in state_strips((256, 256), (256, 256)) for tile in strip]
        found = classify_states(
            source_of(dataset), unknown, StateLimits(0.498, 0.502), "scan", TilePass(windows), True
        )
        assert found.noise == pytest.approx(12 / 255, rel=0.05)
        assert (values > 128).mean() > 0.4 and sum(found.thin.restored.values()) <= 6
