"""Incremental segmentation: after any changes it equals the whole map segmented from scratch."""

import math
from collections.abc import Callable
from itertools import pairwise
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from tests.occupancy.random_scans import random_scan
from uavseg.errors import ParameterError, SceneError
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.live import LiveSegmentation
from uavseg.occupancy.mapping.scan import Pose, Scan
from uavseg.occupancy.simulation.simulate import RangeFinder, Scene
from uavseg.raster.grid.geobox import local_geobox
from uavseg.raster.grid.tiling import Window
from uavseg.raster.intensity.grey import to_grey
from uavseg.segmentation.blocks.block_map import BlockMap, cell_sums, required_ratios
from uavseg.segmentation.blocks.division import block_ratios, selected_ratios
from uavseg.segmentation.blocks.lbp import contrast_bin_edges, contrast_histogram
from uavseg.segmentation.blocks.leaves import cell_classes, cell_intervals, cells_in_range
from uavseg.segmentation.params.segment import (
    IntensityRange,
    Intervals,
    Levels,
    SegmentParams,
    StateLimits,
    partition_of_levels,
)

PAPER = SegmentParams(method="paper")
PARTITIONS: list[Intervals] = [
    StateLimits(),
    IntensityRange(0.0, 0.45),
    IntensityRange(0.3, 0.7),
    Levels(0.1),
]
Grey = NDArray[np.uint16]


def framed(grid: OccupancyGrid) -> tuple[Grey, NDArray[np.uint8]]:
    """Grey and validity up to whole blocks, with a border of one pixel."""
    grey = to_grey(grid.probabilities[np.newaxis], 0.0, 1.0)
    beyond = [(1, -length % 64 + 1) for length in grey.shape]
    return np.pad(grey, beyond), np.pad(np.ones(grey.shape, np.uint8), beyond)


def from_scratch(live: LiveSegmentation, grid: OccupancyGrid, every: bool) -> BlockMap:
    """The block map of the whole map, with the current bin edges."""
    grey, valid = framed(grid)
    sums, counts = cell_sums(grey, valid, 1)
    blocks = BlockMap(grid.geobox.shape, sums, counts, BlockMap.empty(grid.geobox.shape).ratios)
    rows, cols = np.indices(blocks.blocks).reshape(2, -1)
    corners = np.stack([rows, cols], 1) * 64
    if every:
        ratios = block_ratios(grey, valid, live.bin_edges, corners)
    else:
        wanted = required_ratios(sums, counts, live.partition.edges, live.params.division.step)[rows, cols]
        ratios = selected_ratios(grey, valid, live.bin_edges, corners, wanted, live.params.threshold)
    blocks.ratios[rows, cols] = ratios
    return blocks


def intervals_of(blocks: BlockMap, partition: Intervals, params: SegmentParams) -> NDArray[np.uint8]:
    if isinstance(partition, StateLimits):
        return cell_intervals(blocks, partition.edges, params.division)
    if isinstance(partition, Levels):
        return cell_classes(blocks, partition_of_levels(partition), params.division).astype(np.uint8)
    assert isinstance(partition, IntensityRange)
    return cells_in_range(blocks, partition, params.division)


def assert_as_from_scratch(live: LiveSegmentation, grid: OccupancyGrid) -> None:
    lazy, full = from_scratch(live, grid, every=False), from_scratch(live, grid, every=True)
    shown = live.intervals if not isinstance(live.partition, IntensityRange) else live.inside
    for blocks in (lazy, full):
        expected = intervals_of(blocks, live.partition, live.params)
        assert (shown == np.where(blocks.counts > 0, expected, 0)).all()
    assert np.array_equal(live._blocks.ratios, lazy.ratios)
    found = live.block_map()
    assert found.shape == full.shape and (found.counts == full.counts).all()
    assert (found.sums == full.sums).all() and np.array_equal(found.ratios, full.ratios)


def blocks_that_see(before: Grey, after: Grey) -> NDArray[np.bool_]:
    """Blocks with a changed pixel in them or one pixel beyond their edge."""
    changed = before != after
    rows, cols = (length // 64 for length in before.shape)
    found = np.zeros((rows, cols), bool)
    for row in range(rows):
        for col in range(cols):
            found[row, col] = changed[64 * row : 64 * row + 66, 64 * col : 64 * col + 66].any()
    return found


steps = st.lists(
    st.sampled_from(["scan", "scan", "scan", "merge", "again", "away", "reset", "refit"]),
    min_size=1,
    max_size=7,
)


@pytest.mark.slow
@settings(max_examples=80)
@given(
    st.integers(0, 2**32),
    st.integers(1, 200),
    st.integers(1, 200),
    st.sampled_from(PARTITIONS),
    st.sampled_from([PAPER, SegmentParams(), SegmentParams(method="paper", threshold=2.0)]),
    st.booleans(),
    steps,
)
def test_after_any_updates_it_is_the_whole_map_segmented_from_scratch(
    seed: int,
    rows: int,
    cols: int,
    partition: Intervals,
    params: SegmentParams,
    known: bool,
    sequence: list[str],
) -> None:
    rng = np.random.default_rng(seed)
    grid = OccupancyGrid.empty((rows, cols), 0.5)
    if known:
        patches = rng.random((rows // 9 + 1, cols // 9 + 1)).repeat(9, 0).repeat(9, 1)[:rows, :cols]
        grid = OccupancyGrid.from_probabilities(patches, grid.geobox)
    live = grid.segment(partition, params)
    assert_as_from_scratch(live, grid)
    scan = random_scan(rng, (rows, cols), 0.5)
    waiting = False
    for step in sequence:
        bin_edges = live.bin_edges.copy()
        before, _ = framed(grid)
        if step in ("scan", "merge"):
            scan = random_scan(rng, (rows, cols), 0.5)
        if step == "away":
            away = Pose(-50.0, -50.0, heading_rad=math.radians(225.0))
            scan = Scan(away, np.zeros(3), np.full(3, math.inf), 30.0, 0.1)
        if step == "merge":
            grid.merge(scan)
        elif step in ("reset", "refit"):
            getattr(grid, step)()
        else:
            update = grid.update(scan)
            seen = blocks_that_see(before, framed(grid)[0])
            assert (update.blocks >= seen).all() and (waiting or (update.blocks == seen).all())
            assert (
                waiting or step != "away" or (update.window == Window(0, 0, 0, 0) and not update.blocks.any())
            )
        if step == "refit":
            assert (live.bin_edges == contrast_bin_edges(contrast_histogram(*framed(grid)))).all()
        else:
            assert (live.bin_edges == bin_edges).all()
        waiting = step == "merge"  # for the next step, or the end
        if not waiting:
            assert_as_from_scratch(live, grid)
    assert_as_from_scratch(live, grid)


@pytest.fixture
def drive() -> tuple[OccupancyGrid, list[Scan]]:
    """A map of a room of 15 x 12 m, and eight scans taken in it."""
    walls = [
        [(1, 1), (14, 1), (14, 1.3), (1, 1.3)],
        [(1, 10), (14, 10), (14, 11), (1, 11)],
        [(5, 4), (7, 4), (6, 6)],
    ]
    scene = Scene(walls, [(10.0, 6.0, 0.8)])
    sensor = RangeFinder(0.03, 4.0, 360.0, 1.0)
    rng = np.random.default_rng(8)
    poses = [Pose(3.0 + 0.9 * k, 7.5 - 0.1 * k, heading_rad=math.radians(11.0 * k)) for k in range(8)]
    return OccupancyGrid.empty((240, 300), 0.05), [sensor.scan(scene, pose, rng) for pose in poses]


def test_only_what_a_scan_changes_is_divided_again(
    drive: tuple[OccupancyGrid, list[Scan]], monkeypatch: pytest.MonkeyPatch
) -> None:
    from uavseg.occupancy.mapping import live as module

    requested: list[NDArray[np.int64]] = []
    measuring = module.selected_ratios

    def spy(
        grey: Grey, valid: object, bin_edges: object, corners: NDArray[np.int64], *rest: object
    ) -> object:
        requested.append(corners // 64)
        return measuring(grey, valid, bin_edges, corners, *rest)  # type: ignore[arg-type]

    grid, scans = drive
    grid.update(scans[0])
    monkeypatch.setattr(module, "selected_ratios", spy)
    for scan in scans[1:]:
        requested.clear()
        before, _ = framed(grid)
        update = grid.update(scan)
        seen = blocks_that_see(before, framed(grid)[0])
        assert (update.blocks == seen).all() and not seen.all()
        places = np.concatenate([np.zeros((0, 2), np.int64), *requested])
        assert seen[tuple(places.T)].all() and len(np.unique(places, axis=0)) == len(places)
    requested.clear()
    for _ in range(20):  # until nothing changes any more
        update = grid.update(Scan(Pose(7.0, 8.0), np.zeros(1), np.array([math.inf]), 2.0, 0.03))
    assert not update.blocks.any() and update.window.cols > 0


def test_states_are_those_of_the_reference(
    drive: tuple[OccupancyGrid, list[Scan]], reference: ModuleType
) -> None:
    grid, scans = drive
    for k, scan in enumerate(scans[:4]):
        grid.update(scan)
        if k % 2 == 0:
            continue
        grid.refit()
        grey = to_grey(grid.probabilities[np.newaxis], 0.0, 1.0)
        leaves = reference.divide(grey, np.ones(grey.shape, bool))
        states = reference.classify_cells(leaves, grey.shape, lambda op: int(StateLimits().of(op)))
        states[-(-grey.shape[0] // 8) :] = states[:, -(-grey.shape[1] // 8) :] = 0
        assert (grid.segmentation.intervals == states).all()
        assert {1, 2, 3} <= set(np.unique(states).tolist())


def test_several_segmentations_of_one_map_follow_it(drive: tuple[OccupancyGrid, list[Scan]]) -> None:
    grid, scans = drive
    several = [grid.segment(partition, PAPER) for partition in PARTITIONS]
    for first, second in pairwise(scans[:5]):
        grid.merge(first)
        assert_as_from_scratch(several[0], grid)
        grid.update(second)
        for live in several:
            assert_as_from_scratch(live, grid)


def test_agreeing_pixels_lie_in_the_interval_as_their_leaves_do(
    drive: tuple[OccupancyGrid, list[Scan]],
) -> None:
    grid, scans = drive
    for scan in scans:
        grid.update(scan)
    own = StateLimits().table[to_grey(grid.probabilities[np.newaxis], 0.0, 1.0)]
    leaves = grid.segmentation.intervals.repeat(8, 0).repeat(8, 1)[:240, :300]
    for state in (1, 2, 3):
        found = grid.segmentation.agreeing(state)
        assert (found == ((leaves == state) & (own == state))).all() and found.any()
    assert ((leaves == 1) & (own == 3)).any()  # walls that a path must not cross


def test_bin_edges_stay_until_they_are_refitted(drive: tuple[OccupancyGrid, list[Scan]]) -> None:
    grid = OccupancyGrid.from_probabilities(
        np.random.default_rng(0).random((100, 90)), local_geobox((100, 90), 0.1, (0, 0))
    )
    bin_edges = grid.segmentation.bin_edges.copy()
    assert bin_edges[1:].all()
    grid.reset()
    assert (grid.segmentation.bin_edges == bin_edges).all()
    grid.refit()
    assert not grid.segmentation.bin_edges.any()


def test_results_are_read_only_views_or_copies(drive: tuple[OccupancyGrid, list[Scan]]) -> None:
    grid, scans = drive
    shown = grid.segmentation.intervals
    with pytest.raises(ValueError, match="read-only"):
        shown[0, 0] = 1
    assert (shown == 2)[:30, :37].all()
    grid.update(scans[0])
    assert (shown == 1).any()  # later updates show in it
    blocks = grid.segmentation.block_map()
    blocks.sums[:] = 0
    assert grid.segmentation.block_map().sums.any()


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda grid: grid.segment(Levels(0.001)), "at most 255 intervals, not 1000; give a larger width"),
        (lambda grid: grid.segmentation.agreeing(4), "intervals are 1 to 3 here, not 4"),
        (lambda grid: grid.segmentation.agreeing(0), "intervals are 1 to 3 here, not 0"),
        (lambda grid: grid.segmentation.inside, "only a range has an inside"),
    ],
)
def test_invalid_queries_are_refused(wrong: Callable[[OccupancyGrid], object], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        wrong(OccupancyGrid.empty((10, 10), 0.1))


def test_an_invalid_scan_changes_nothing() -> None:
    grid = OccupancyGrid.empty((70, 70), 0.1)
    with pytest.raises(SceneError, match="one range for each angle"):
        grid.update(Scan(Pose(1, 1), np.zeros(3), np.ones(4), 5.0, 0.1))
    with pytest.raises(SceneError, match="finite x, y and heading"):
        grid.update(Scan(Pose(math.nan, 1), np.zeros(3), np.ones(3), 5.0, 0.1))
    with pytest.raises(SceneError, match=r"a pose lies within 1e\+09 m of the origin, not at -1e\+100"):
        grid.update(Scan(Pose(1, -1e100), np.zeros(3), np.ones(3), 5.0, 0.1))
    assert (grid.probabilities == 0.5).all()


def test_a_sensor_outside_the_map_updates_the_cells_that_its_beams_reach() -> None:
    grid = OccupancyGrid.empty((70, 130), 0.1)
    update = grid.update(Scan(Pose(-3.0, 3.55), np.zeros(1), np.array([math.inf]), 5.0, 0.1))
    assert update.window == Window(34, 0, 1, 20)
    assert update.blocks.tolist() == [[True, False, False], [False, False, False]]
