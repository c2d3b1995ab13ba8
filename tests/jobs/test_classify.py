"""Maps classified: what holds of states and objects on simulated and on real maps."""

from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from uavseg.execution.executors import serial, threads
from uavseg.jobs.classify import Classification, ClassifyRequest, classify
from uavseg.jobs.open_source import open_probability_map
from uavseg.jobs.source import ProbabilityMap
from uavseg.jobs.work import Work
from uavseg.occupancy.simulation.paper_scenes import BUILT_IN_SCENES
from uavseg.raster.dataset import Dataset
from uavseg.raster.geobox import GeoBox
from uavseg.raster.tiling import Window
from uavseg.segmentation.params import SegmentParams, StateLimits

SCAN, NONE = (ClassifyRequest(segment=SegmentParams("paper", refine=refine)) for refine in ("scan", "none"))
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


@settings(deadline=None, max_examples=25)
@given(
    st.integers(0, 10**6), st.sampled_from([64, 128, 192, 4096]), st.booleans(), st.sampled_from([SCAN, NONE])
)
def test_tiles_and_threads_change_nothing(seed: int, tile: int, many: bool, request: ClassifyRequest) -> None:
    source = source_of(random_map(seed))
    one = classify(source, request)
    other = classify(source, request, Work(tile, threads(2) if many else serial))
    assert np.array_equal(one.states, other.states)
    assert (one.cells, one.occupied_in_free) == (other.cells, other.occupied_in_free)
    assert one.frame().to_wkb().equals(other.frame().to_wkb())


@settings(deadline=None, max_examples=25)
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


def test_a_turned_map_need_not_have_turned_states() -> None:
    """Rows are scanned before columns, so this is no law."""
    different = 0
    for seed in range(20):
        values = random_map(seed)
        one, other = classify(source_of(values)).states, classify(source_of(values.T.copy())).states.T
        different += not np.array_equal(one, other)
    assert different > 0


def test_progress_ends_at_the_end() -> None:
    told: list[tuple[int, int]] = []
    classify(source_of(random_map(3)), SCAN, Work(64, progress=lambda *a: told.append(a)))
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
def test_walls_that_are_called_free_are_counted(shared_data: Path, name: str) -> None:
    source = opened(shared_data / "maps" / f"{name}.yaml")
    found = classify(source)
    values, _ = source.dataset.read(Window(0, 0, *source.geobox.shape))
    above = values[0] > StateLimits().occupied_above
    assert found.occupied_by_value == above.sum() > 500
    assert found.occupied_in_free == (above & (found.states == FREE)).sum() > 0.4 * above.sum()
