"""The phases in a row: tiles and workers change nothing, and what a range does not need is not read."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from affine import Affine
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from uavseg.errors import ParameterError
from uavseg.execution.executors import Map, serial, stages, threads
from uavseg.raster.geobox import GeoBox
from uavseg.raster.intensity.stretch import Stretch
from uavseg.raster.tile_pass import TilePass
from uavseg.raster.tiling import Window, cells_around, tiles
from uavseg.segmentation.blocks.block_map import required_ratios
from uavseg.segmentation.blocks.leaves import cells_in_range
from uavseg.segmentation.intervals import IntensityRange
from uavseg.segmentation.params import SegmentParams
from uavseg.segmentation.pipeline import (
    cells_to_refine,
    measure_block_map,
    measure_block_map_for,
    measure_cells,
    refine_tile,
)
from uavseg.segmentation.refine.range_scans import REFINE_HALO, refine_by_local_mean, refine_by_scans
from uavseg.segmentation.source import GreySource

INTERVAL = IntensityRange(0.4, 0.7)


@dataclass
class InMemory:
    """Stands in for a dataset: an 8-bit array, read by window; counts what is read."""

    values: NDArray[np.uint8]
    valid: NDArray[np.bool_]
    reads: list[Window] = field(default_factory=list)

    @property
    def geobox(self) -> GeoBox:
        return GeoBox(self.valid.shape, Affine.identity(), None)

    def is_empty(self, window: Window) -> bool:
        return not self.valid[window.slices].any()

    def read(self, window: Window) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
        assert window.clipped(self.valid.shape) == window
        self.reads.append(window)
        valid = self.valid[window.slices]
        return self.values[window.slices][None], None if valid.all() else valid


def field_of(seed: int, shape: tuple[int, int]) -> InMemory:
    """Plains and textures, with holes and an empty corner."""
    rng = np.random.default_rng(seed)

    def coarse(some: NDArray[Any]) -> NDArray[Any]:
        return some.repeat(40, 0).repeat(40, 1)[: shape[0], : shape[1]]

    many = (shape[0] // 40 + 1, shape[1] // 40 + 1)
    noise = rng.normal(0, 1, shape) * coarse(rng.choice([0, 2, 40], many))
    values = np.clip(coarse(rng.integers(0, 256, many)) + noise, 0, 255).astype(np.uint8)
    valid = rng.random(shape) > coarse(rng.choice([0, 0, 0.1], many))
    valid[: int(rng.choice([0, 70])), : int(rng.choice([1, 140]))] = False
    return InMemory(values, valid)


def source_of(dataset: Any) -> GreySource:
    return GreySource(dataset, Stretch(0.0, 255.0, "dtype"))


shapes = st.tuples(st.integers(1, 200), st.integers(1, 200))


# Reading


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 999), shapes, st.sampled_from([64, 128]), st.sampled_from([0, 1, REFINE_HALO]))
def test_a_tile_is_the_raster_with_nothing_around_it(
    seed: int, shape: tuple[int, int], side: int, margin: int
) -> None:
    dataset = field_of(seed, shape)
    beyond = [(margin, margin + side)] * 2
    grey = np.pad(np.where(dataset.valid, dataset.values * np.uint16(257), 0), beyond)
    valid = np.pad(dataset.valid, beyond)
    for window in tiles(shape, side):
        tile = source_of(dataset).read(window, margin)
        rows, cols = (-(-length // 64) * 64 + 2 * margin for length in (window.rows, window.cols))
        part = np.s_[window.row : window.row + rows, window.col : window.col + cols]
        inner = np.s_[: window.rows + 2 * margin, : window.cols + 2 * margin]
        assert tile.grey.shape == tile.valid.shape == (rows, cols)
        assert np.array_equal(tile.grey[inner], grey[part][inner])
        assert np.array_equal(tile.valid[inner], valid[part][inner])
        assert not tile.valid[grey_beyond(shape, window, margin, tile.valid.shape)].any()
        assert tile.all_valid == bool(tile.valid.all())
        assert tile.grey.flags.c_contiguous and tile.valid.flags.c_contiguous


def grey_beyond(
    shape: tuple[int, int], window: Window, margin: int, size: tuple[int, int]
) -> NDArray[np.bool_]:
    """Pixels of a tile that lie outside the raster."""
    row, col = np.indices(size)
    row, col = row + window.row - margin, col + window.col - margin
    return (row < 0) | (col < 0) | (row >= shape[0]) | (col >= shape[1])


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


def test_the_order_of_tiles_is_of_no_matter() -> None:
    source = source_of(field_of(1, (201, 230)))
    windows = tiles(source.shape, 64)
    assert_same_map(
        measure_block_map(source, TilePass(windows[::-1])), measure_block_map(source, TilePass(windows))
    )


def test_contrasts_are_cut_over_all_tiles_together() -> None:
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


def test_texture_is_looked_at_only_where_a_range_does_not_decide() -> None:
    dataset = field_of(3, (256, 256))
    dataset.valid[:] = True
    dataset.values[:] = 128
    dataset.values[70:100, 70:100] = np.random.default_rng(0).integers(200, 256, (30, 30))
    source = source_of(dataset)
    windows = tiles(source.shape, 64)
    blocks = measure_block_map_for(source, INTERVAL, SegmentParams("paper"), TilePass(windows))
    wanted = required_ratios(blocks.sums, blocks.counts, INTERVAL.edges, np.inf) > 0
    assert 0 < wanted.sum() < 16
    assert len(dataset.reads) == 16  # mixed blocks are kept from the first pass
    assert not blocks.ratios[~wanted].any()


def test_a_tile_that_is_known_to_be_empty_is_not_read() -> None:
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


@settings(deadline=None, max_examples=30)
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


# Parameters and progress


def test_the_method_of_the_paper_scans_and_ours_takes_noise_away() -> None:
    assert (SegmentParams().refine, SegmentParams("paper").refine) == ("tv", "scan")
    assert SegmentParams("paper", refine="tv").refine == "tv"


@pytest.mark.parametrize(
    "bad, told",
    [
        ({"method": "fast"}, "paper or adaptive, not 'fast'"),
        ({"refine": "yes"}, "none, scan, smooth or tv, not 'yes'"),
        ({"threshold": -0.1}, "at least 0, not -0.1"),
        ({"threshold": np.nan}, "at least 0, not nan"),
        ({"intensity_step": 1.5}, r"lies in 0\.\.1, not 1.5"),
        ({"intensity_step": -1e-9}, r"lies in 0\.\.1, not -1e-09"),
        ({"intensity_step": np.nan}, r"lies in 0\.\.1, not nan"),
    ],
)
def test_a_bad_parameter_is_refused_with_what_it_should_be(bad: dict[str, Any], told: str) -> None:
    with pytest.raises(ParameterError, match=told):
        SegmentParams(**bad)


def test_the_method_of_the_paper_has_no_intensity_test() -> None:
    assert SegmentParams("paper", intensity_step=0.1).division.step == np.inf
    assert SegmentParams("adaptive", intensity_step=0.1).division.step == 0.1


def test_parameters_at_their_ends_are_allowed() -> None:
    for threshold, step in ((0, 0), (np.inf, 1)):
        SegmentParams(threshold=threshold, intensity_step=step)


@given(st.lists(st.integers(1, 9), min_size=1, max_size=5))
def test_stages_together_go_from_nothing_to_all(totals: list[int]) -> None:
    told: list[float] = []
    parts = stages(lambda done, total: told.append(done / total), len(totals))
    for part, total in zip(parts, totals, strict=True):
        for done in range(1, total + 1):
            part(done, total)
    assert told == sorted(told)
    assert told[0] > 0 and told[-1] == 1
    assert max(Counter(told).values()) == 1


def test_progress_of_a_block_map_runs_to_the_end() -> None:
    told: list[tuple[int, int]] = []
    source = source_of(field_of(1, (200, 200)))
    measure_block_map(
        source, TilePass(tiles(source.shape, 64), progress=lambda done, total: told.append((done, total)))
    )
    parts = [done / total for done, total in told]
    assert parts == sorted(parts) and parts[-1] == 1
    assert len(told) > 16
