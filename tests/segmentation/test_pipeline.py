"""Tiles and workers change no result, and blocks that a range does not require are not read."""

from collections import Counter
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from tests.segmentation.in_memory_dataset import InMemory, field_of, source_of
from uavseg.execution.executors import Map, serial, split_progress, threads
from uavseg.raster.grid.tiling import TilePass, Window, cells_around, tiles
from uavseg.segmentation.blocks.block_map import required_ratios
from uavseg.segmentation.blocks.leaves import cells_in_range
from uavseg.segmentation.params.segment import IntensityRange, SegmentParams
from uavseg.segmentation.pipeline import (
    cells_to_refine,
    measure_block_map,
    measure_block_map_for,
    measure_cells,
    refine_tile,
)
from uavseg.segmentation.refine.range_scans import REFINE_HALO, refine_by_local_mean, refine_by_scans

INTERVAL = IntensityRange(0.4, 0.7)


shapes = st.tuples(st.integers(1, 200), st.integers(1, 200))


# Block maps


def assert_same_map(first: Any, second: Any) -> None:
    assert first.shape == second.shape
    assert np.array_equal(first.sums, second.sums)
    assert np.array_equal(first.counts, second.counts)
    assert np.array_equal(first.ratios, second.ratios)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("run", [serial, threads(2)])
def test_the_block_map_does_not_depend_on_tiles_or_workers(seed: int, run: Map) -> None:
    source = source_of(field_of(seed, (201, 230)))
    whole = measure_block_map(source, TilePass([Window(0, 0, 201, 230)]))
    for side in (64, 128, (64, 256), (192, 64)):
        assert_same_map(measure_block_map(source, TilePass(tiles(source.shape, side), run)), whole)


def test_the_order_of_tiles_changes_nothing() -> None:
    source = source_of(field_of(1, (201, 230)))
    windows = tiles(source.shape, 64)
    assert_same_map(
        measure_block_map(source, TilePass(windows[::-1])), measure_block_map(source, TilePass(windows))
    )


def test_bin_edges_of_contrast_are_those_of_all_tiles_together() -> None:
    source = source_of(field_of(0, (150, 150)))
    whole = measure_cells(source, TilePass([Window(0, 0, 150, 150)]))
    assert np.array_equal(measure_cells(source, TilePass(tiles(source.shape, 64))).bin_edges, whole.bin_edges)
    assert len(set(whole.bin_edges.tolist())) > 3


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(
    "params", [SegmentParams(), SegmentParams("paper"), SegmentParams("adaptive", 1.05, 0.3)]
)
def test_a_block_map_made_for_a_range_answers_it_as_the_whole_one(seed: int, params: SegmentParams) -> None:
    source = source_of(field_of(seed, (201, 170)))
    windows = tiles(source.shape, 128)
    answers = [
        cells_in_range(blocks, INTERVAL, params.division) & (blocks.counts > 0)
        for blocks in (
            measure_block_map(source, TilePass(windows)),
            measure_block_map_for(source, INTERVAL, params, TilePass(windows)),
            measure_block_map_for(source, INTERVAL, params, TilePass(tiles(source.shape, 64), threads(2))),
        )
    ]
    assert np.array_equal(answers[0], answers[1])
    assert np.array_equal(answers[0], answers[2])


def test_texture_is_read_only_where_cells_do_not_decide() -> None:
    dataset = field_of(3, (256, 256))
    dataset.valid[:] = True
    dataset.values[:] = 128
    dataset.values[70:100, 70:100] = np.random.default_rng(0).integers(200, 256, (30, 30))
    source = source_of(dataset)
    windows = tiles(source.shape, 64)
    blocks = measure_block_map_for(source, INTERVAL, SegmentParams("paper"), TilePass(windows))
    required = required_ratios(blocks.sums, blocks.counts, INTERVAL.edges, np.inf) > 0
    assert 0 < required.sum() < 16
    assert len(dataset.reads) == 16  # mixed blocks are cached in the first pass
    assert not blocks.ratios[~required].any()


def test_an_empty_tile_is_not_read() -> None:
    dataset = field_of(4, (128, 128))
    dataset.valid[:] = False
    dataset.valid[100:, 100:] = True
    blocks = measure_block_map(source_of(dataset), TilePass(tiles((128, 128), 64)))
    assert all(window.row > 0 and window.col > 0 for window in dataset.reads)
    assert blocks.counts.sum() == 28 * 28


def test_a_raster_without_valid_pixels_has_an_empty_block_map() -> None:
    dataset = field_of(4, (70, 90))
    dataset.valid[:] = False
    blocks = measure_block_map(source_of(dataset), TilePass(tiles((70, 90), 64)))
    assert not blocks.counts.any() and not blocks.sums.any() and not blocks.ratios.any()


# Refined tiles


@pytest.mark.parametrize("how", ["none", "scan", "smooth", "tv"])
@pytest.mark.parametrize("seed", range(4))
def test_tiles_are_refined_as_the_whole_would_be(how: Any, seed: int) -> None:
    dataset = field_of(seed, (300, 270))
    source = source_of(dataset)
    inside = cells_to_refine(
        measure_block_map(source, TilePass(tiles(source.shape, 64))), INTERVAL, SegmentParams(refine=how)
    )
    expected = refined_whole(dataset, inside, how)
    for side in (64, 128, 192):
        found = np.zeros(source.shape, np.uint8)
        for window in tiles(source.shape, side):
            answer = refine_tile(source, cells_around(inside, window, REFINE_HALO), INTERVAL, how, window)
            if answer is not None:
                found[window.slices] = answer[0][REFINE_HALO:, REFINE_HALO:][: window.rows, : window.cols]
        assert np.array_equal(found, expected)


def refined_whole(dataset: InMemory, inside: NDArray[np.uint8], how: str) -> NDArray[np.uint8]:
    if how == "tv":
        source = source_of(dataset)
        window = Window(0, 0, *source.shape)
        answer = refine_tile(source, cells_around(inside, window, REFINE_HALO), INTERVAL, "tv", window)
        return (
            answer[0][REFINE_HALO:, REFINE_HALO:][: window.rows, : window.cols]
            if answer
            else dataset.valid * np.uint8(0)
        )
    rows, cols = dataset.valid.shape
    valid = dataset.valid.astype(np.uint8)
    grey = dataset.values * np.uint16(257) * valid
    pixels = np.kron(inside, np.ones((8, 8), np.uint8))[:rows, :cols] & valid
    v = grey / 65535
    if how == "scan":
        return refine_by_scans(
            pixels, valid, ((v >= INTERVAL.low) & (v <= INTERVAL.high)).astype(np.uint8) & valid
        )
    return (
        refine_by_local_mean(pixels, valid, grey, INTERVAL.low, INTERVAL.high) if how == "smooth" else pixels
    )


def test_a_tile_with_nothing_in_range_around_it_is_not_read() -> None:
    dataset = field_of(0, (200, 200))
    assert (
        refine_tile(source_of(dataset), np.zeros((24, 24), np.uint8), INTERVAL, "scan", Window(0, 0, 64, 64))
        is None
    )
    assert not dataset.reads


@settings(max_examples=30)
@given(shapes, st.sampled_from([64, 128]))
def test_cells_around_a_tile_are_those_of_the_map_with_nothing_beyond(
    shape: tuple[int, int], side: int
) -> None:
    cells = tuple(-(-length // 64) * 8 for length in shape)
    inside = np.random.default_rng(shape).integers(0, 2, cells).astype(np.uint8)
    padded = np.pad(inside, REFINE_HALO // 8)
    for window in tiles(shape, side):
        around = cells_around(inside, window, REFINE_HALO)
        row, col = window.row // 8, window.col // 8
        assert np.array_equal(around, padded[row : row + len(around), col : col + around.shape[1]])
        assert around.shape == tuple(-(-n // 64) * 8 + REFINE_HALO // 4 for n in (window.rows, window.cols))


# Progress


@given(st.lists(st.integers(1, 9), min_size=1, max_size=5))
def test_stages_together_go_from_nothing_to_all(totals: list[int]) -> None:
    reported: list[float] = []
    parts = split_progress(lambda done, total: reported.append(done / total), len(totals))
    for part, total in zip(parts, totals, strict=True):
        for done in range(1, total + 1):
            part(done, total)
    assert reported == sorted(reported)
    assert reported[0] > 0 and reported[-1] == 1
    assert max(Counter(reported).values()) == 1


def test_progress_of_a_block_map_runs_to_the_end() -> None:
    reported: list[tuple[int, int]] = []
    source = source_of(field_of(1, (200, 200)))
    measure_block_map(
        source, TilePass(tiles(source.shape, 64), progress=lambda done, total: reported.append((done, total)))
    )
    parts = [done / total for done, total in reported]
    assert parts == sorted(parts) and parts[-1] == 1
    assert len(reported) > 16
