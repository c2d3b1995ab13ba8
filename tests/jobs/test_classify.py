"""Maps classified: what holds of states and objects on simulated and on real maps."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from scipy import ndimage

from uavseg.errors import LostObstaclesError
from uavseg.execution.executors import serial, threads
from uavseg.jobs.maps.classify import Classification, ClassifyRequest, classify
from uavseg.jobs.source.open_source import open_probability_map
from uavseg.jobs.source.source import ProbabilityMap
from uavseg.jobs.source.work import Work
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.scan import Pose, Scan
from uavseg.occupancy.simulation.scenes import BUILT_IN_SCENES
from uavseg.raster.grid.geobox import GeoBox, local_geobox
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.dataset import Dataset
from uavseg.segmentation.params.segment import SegmentParams, StateLimits

SCAN, NONE = (
    ClassifyRequest(segment=SegmentParams("paper", refine=refine), allow_lost_obstacles=True)
    for refine in ("scan", "none")
)
DEFAULT = ClassifyRequest()
FREE, UNKNOWN, OCCUPIED = 1, 2, 3


def source_of(values: NDArray[np.floating], transform: Affine | None = None) -> ProbabilityMap:
    place = GeoBox(values.shape, transform or Affine.scale(0.1, -0.1), None)
    return opened(Dataset.of_values(values, place, "map"))


def opened(source: object) -> ProbabilityMap:
    found = open_probability_map(source)
    assert isinstance(found, ProbabilityMap)
    return found


def random_map(seed: int) -> NDArray[np.float32]:
    """Patches and specks, some of them NaN."""
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, 160, 2))
    grain = int(rng.choice([3, 8, 20]))
    coarse = rng.choice([0.05, 0.5, 0.5, 0.9], (shape[0] // grain + 1, shape[1] // grain + 1))
    values = coarse.repeat(grain, 0).repeat(grain, 1)[: shape[0], : shape[1]].astype(np.float32)
    specks = rng.random(shape) < 0.1
    values[specks] = rng.choice([0.1, 0.5, 0.95, np.nan], int(specks.sum()))
    values[0, 0] = 0.5
    return values


@pytest.mark.slow
@settings(max_examples=25)
@given(
    st.integers(0, 10**6),
    st.sampled_from([64, 128, 192, 4096]),
    st.booleans(),
    st.sampled_from([SCAN, NONE, DEFAULT]),
)
def test_tiles_and_threads_change_nothing(seed: int, tile: int, many: bool, request: ClassifyRequest) -> None:
    source = source_of(random_map(seed))
    one = classify(source, request)
    other = classify(source, request, Work(tile, threads(2) if many else serial))
    assert np.array_equal(one.states, other.states)
    assert (one.cells, one.occupied_in_free) == (other.cells, other.occupied_in_free)
    assert (one.restored, one.lost_obstacles) == (other.restored, other.lost_obstacles)
    assert one.warnings == other.warnings
    assert one.frame().to_wkb().equals(other.frame().to_wkb())


@pytest.mark.slow
@settings(max_examples=25)
@given(st.integers(0, 10**6))
def test_objects_are_the_occupied_cells(seed: int) -> None:
    values = random_map(seed)
    found = classify(source_of(values))
    states, objects = found.states, found.frame()
    assert np.array_equal(states == 0, np.isnan(values))
    assert objects["pixels"].sum() == (states == OCCUPIED).sum() == found.cells[OCCUPIED]
    assert objects.area.to_numpy() == pytest.approx(0.01 * objects["pixels"].to_numpy())
    bounds = objects.bounds.to_numpy().reshape(-1, 4)
    assert objects[["x_min", "y_min", "x_max", "y_max"]].to_numpy() == pytest.approx(bounds)
    if len(objects):
        weighed = (objects["mean"] * objects["pixels"]).sum() / objects["pixels"].sum()
        assert weighed == pytest.approx(values[states == OCCUPIED].mean(dtype=float), abs=1e-4)
    assert found.occupied_in_free == ((states == FREE) & (values > 0.502)).sum()
    assert found.occupied_by_value == (values > 0.502).sum()


def test_boxes_of_a_turned_map_hold_their_objects() -> None:
    turned = Affine.translation(5, 7) @ Affine.rotation(30) @ Affine.scale(0.1, -0.1)
    objects = classify(source_of(random_map(4), turned)).frame()
    assert len(objects) > 3
    boxes = objects[["x_min", "y_min", "x_max", "y_max"]].to_numpy()
    assert boxes == pytest.approx(objects.bounds.to_numpy())


@pytest.mark.slow
def test_a_turned_map_need_not_have_turned_states() -> None:
    """Rows are scanned before columns, so this is no law."""
    different = 0
    for seed in range(20):
        values = random_map(seed)
        one = classify(source_of(values), SCAN).states
        other = classify(source_of(values.T.copy()), SCAN).states.T
        different += not np.array_equal(one, other)
    assert different > 0


def test_progress_ends_at_the_end() -> None:
    told: list[tuple[int, int]] = []
    for request in (SCAN, DEFAULT, replace(DEFAULT, objects=False)):
        told.clear()
        classify(source_of(random_map(3)), request, Work(64, progress=lambda *a: told.append(a)))
        shares = [done / total for done, total in told]
        assert shares == sorted(shares) and shares[-1] == 1 and shares[0] < 0.2


def iou(found: Classification, truth: NDArray[np.uint8], state: int) -> float:
    one, other = found.states == state, truth == state
    return float((one & other).sum() / (one | other).sum())


@pytest.mark.parametrize("name", ["lens", "circles"])
def test_refinement_brings_free_and_unknown_closer_to_the_truth(name: str) -> None:
    simulation = BUILT_IN_SCENES[name]()
    truth = simulation.truth().states
    source = opened(simulation.run())
    blocks, refined = classify(source, NONE), classify(source, SCAN)
    for state in (FREE, UNKNOWN):
        assert iou(refined, truth, state) > iou(blocks, truth, state) + 0.02
        assert iou(refined, truth, state) > 0.9
    assert iou(refined, truth, OCCUPIED) > 0.2


@pytest.mark.parametrize("name", ["depot", "tb3_sandbox"])
def test_walls_that_the_paper_calls_free_are_counted(shared_data: Path, name: str) -> None:
    source = opened(shared_data / "maps" / f"{name}.yaml")
    found = classify(source, SCAN)
    values, _ = source.dataset.read(Window(0, 0, *source.geobox.shape))
    above = values[0] > StateLimits().occupied_above
    assert found.occupied_by_value == above.sum() > 500
    assert found.occupied_in_free == (above & (found.states == FREE)).sum() > 0.4 * above.sum()


# Thin obstacles


def obstacles(values: NDArray[np.floating]) -> tuple[NDArray[np.int32], int]:
    labels, count = ndimage.label(values > 0.502, np.ones((3, 3)))
    return labels, count


@pytest.mark.parametrize("name, lost", [("depot", 131), ("tb3_sandbox", 9)])
def test_real_maps_keep_every_obstacle(shared_data: Path, name: str, lost: int) -> None:
    source = opened(shared_data / "maps" / f"{name}.yaml")
    values = source.dataset.read(Window(0, 0, *source.geobox.shape))[0][0]
    labels, count = obstacles(values)
    paper, found = classify(source, SCAN), classify(source)
    missing = set(range(1, count + 1)) - set(labels[paper.states == OCCUPIED])
    assert len(missing) == paper.lost_obstacles == lost
    assert (found.states[values > 0.502] == OCCUPIED).all() and found.lost_obstacles == 0
    assert found.occupied_in_free == found.unknown_in_free == 0
    assert np.array_equal(found.states, StateLimits().of(values))


@settings(max_examples=25)
@given(st.integers(0, 10**6))
def test_a_trinary_map_keeps_the_state_of_every_cell(seed: int) -> None:
    values = random_map(seed)
    values = np.select([values < 0.3, values > 0.7, np.isnan(values)], [0, 1, np.nan], 0.5)
    found = classify(source_of(values))
    own = np.select([values == 0, values == 0.5, values == 1], [FREE, UNKNOWN, OCCUPIED], 0)
    assert np.array_equal(found.states, own)
    assert found.unknown_in_free == found.occupied_in_free == found.lost_obstacles == 0
    assert not found.warnings


@pytest.mark.slow
@settings(max_examples=25)
@given(st.integers(0, 10**6), st.sampled_from([0.0, 0.02, 0.05]))
def test_a_map_of_probabilities_loses_no_obstacle_of_three_cells(seed: int, sigma: float) -> None:
    rng = np.random.default_rng(seed)
    values = random_map(seed).astype(float)
    shape = values.shape
    for _ in range(5):
        row, col = rng.integers(shape[0]), rng.integers(shape[1])
        values[row : row + rng.integers(1, 30), col : col + rng.integers(1, 3)] = 0.8
    values = np.clip(values + rng.normal(0, sigma, shape), 0, 1)
    found = classify(source_of(values))
    assert not lost_groups(values, found.states)


def lost_groups(values: NDArray[np.floating], states: NDArray[np.uint8]) -> list[int]:
    """8-connected groups of three cells or more above 0.65 of which no cell is occupied."""
    labels, count = ndimage.label(values > 0.65, np.ones((3, 3)))
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    kept = set(labels[states == OCCUPIED])
    return [k for k in range(1, count + 1) if sizes[k] >= 3 and k not in kept]


@pytest.mark.parametrize("name, of_paper", [("intel_crop64", 10), ("intel_crop192", 40)])
def test_walls_of_a_real_log_are_kept(shared_data: Path, name: str, of_paper: int) -> None:
    """A wall of 8 cells was free in the larger crop: weaker cells join it to an occupied one."""
    source = opened(shared_data / "maps" / f"{name}.tif")
    values = source.dataset.read(Window(0, 0, *source.geobox.shape))[0][0]
    assert not lost_groups(values, classify(source).states)
    paper = classify(source, SCAN)
    assert paper.lost_obstacles >= len(lost_groups(values, paper.states)) == of_paper


@pytest.mark.parametrize("sigma", [0.01, 0.03, 0.08])
@pytest.mark.parametrize("aisle", [4, 8, 32])
def test_unknown_is_not_the_mean_of_free_and_occupied(aisle: int, sigma: float) -> None:
    """Racks and aisles as wide as each other: the mean of a leaf is one half, and no cell is near it."""
    rack = np.arange(256) // aisle % 2 == 1
    values = np.where(rack, 0.9, 0.1) + np.random.default_rng(aisle).normal(0, sigma, (256, 256))
    found = classify(source_of(np.clip(values, 0, 1)))
    assert (found.states != np.where(rack, OCCUPIED, FREE)).mean() < 0.002


def test_obstacles_that_are_lost_are_refused_unless_that_is_allowed() -> None:
    values = np.zeros((128, 128))
    values[10:120, 30] = 1
    values[5, 70:90] = 1
    paper = replace(SCAN, allow_lost_obstacles=False)
    with pytest.raises(LostObstaclesError, match="2 obstacles of map have no occupied cell"):
        classify(source_of(values), paper)
    found = classify(source_of(values), SCAN)
    assert found.lost_obstacles == 2 and (found.states == FREE).all()
    assert any("2 obstacles of map have no occupied cell" in warning for warning in found.warnings)
    values[5] = 0
    with pytest.raises(LostObstaclesError, match="1 obstacle of map has no"):
        classify(source_of(values), paper)
    assert classify(source_of(values)).lost_obstacles == 0


@pytest.mark.parametrize("name", ["lens", "circles"])
def test_restored_obstacles_leave_the_accuracy_of_states_as_it_is(name: str) -> None:
    simulation = BUILT_IN_SCENES[name]()
    truth = simulation.truth().states
    for seed in range(3):
        source = opened(simulation.run(seed))
        paper, found = classify(source, SCAN), classify(source)
        for state in (FREE, UNKNOWN, OCCUPIED):
            assert iou(found, truth, state) > iou(paper, truth, state) - 0.006
        assert len(found.frame()) <= len(paper.frame()) + 12


@pytest.mark.parametrize("shape", [(64, 64), (65, 63), (100, 150)])
@pytest.mark.parametrize("level", [1.0, 0.7])
def test_walls_at_the_border_survive_an_update(shape: tuple[int, int], level: float) -> None:
    border = np.pad(np.zeros((shape[0] - 2, shape[1] - 2), bool), 1, constant_values=True)
    geobox = local_geobox(shape, 0.05, (0.0, 0.0))
    grid = OccupancyGrid.from_probabilities(np.where(border, level, 0.02), geobox)
    assert (classify(opened(grid)).states[border] == OCCUPIED).all()
    top, right = 0.05 * shape[0], 0.05 * shape[1]
    x, y = right / 2 + 0.013, top / 2 - 0.007
    angles = np.linspace(-np.pi, np.pi, 720, endpoint=False) + 1e-3
    walls_x = np.where(np.cos(angles) > 0, right - 0.05, 0.05)
    walls_y = np.where(np.sin(angles) > 0, top - 0.05, 0.05)
    ranges = np.minimum((walls_x - x) / np.cos(angles), (walls_y - y) / np.sin(angles))
    for _ in range(5):
        grid.update(Scan(Pose(x, y), angles, ranges, 30.0, 0.03))
    found = classify(opened(grid))
    assert (found.states[border] == OCCUPIED).all() and found.lost_obstacles == 0
