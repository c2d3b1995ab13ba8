"""States, levels and objects of maps agree with the reference implementation.

What the default method adds (free pixels of mixed leaves, thin obstacles) is that of the plain version.
"""

import shutil
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import pytest
from affine import Affine
from numpy.typing import NDArray

from tests import plain_thin_obstacles
from uavseg.execution.executors import Map, serial, threads
from uavseg.jobs.maps.classify import ClassifyRequest, classify
from uavseg.jobs.result.result import Extraction
from uavseg.jobs.segment_classes import LevelsRequest, levels
from uavseg.jobs.source.source import ProbabilityMap
from uavseg.jobs.source.work import Work
from uavseg.occupancy.map_file import open_map, stretch_of
from uavseg.raster.formats.geotiff import Page, write_geotiff_pages
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.dataset import Dataset
from uavseg.regions.outline.rings import rasterise
from uavseg.segmentation.params.segment import Levels, SegmentParams
from uavseg.segmentation.states import classify_strips

MAPS = 220
CHUNK = 20
CHUNKS = range(0, MAPS, CHUNK)
RUNNERS: list[tuple[int, Map]] = [(64, serial), (128, threads(2))]
REAL = [
    *("tb3_sandbox", "turtlebot3_map"),
    *(pytest.param(name, marks=pytest.mark.slow) for name in ("depot", "willow-full")),
]


def random_map(seed: int) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """An occupancy map: patches, walls and specks of values around one half, and nodata."""
    rng = np.random.default_rng(seed)
    sizes = [(3, 64), (64, 98), (98, 201)]
    rows, cols = (int(rng.integers(*sizes[rng.choice(3, p=[0.4, 0.57, 0.03])])) for _ in range(2))
    field = np.full((rows, cols), 0.5)
    for _ in range(rng.integers(1, 16)):
        row, col = rng.integers(rows), rng.integers(cols)
        height, width = rng.integers(1, (80, 4)[rng.integers(2)], 2) * rng.choice([1, 30], 2).clip(1, 3)
        field[row : row + height, col : col + width] = rng.choice([0.0, 0.1, 0.497, 0.5, 0.503, 0.9, 1.0])
    speck = rng.random((rows, cols)) < rng.choice([0, 0.02, 0.3])
    field[speck] = rng.choice([0.05, 0.498, 0.5, 0.502, 0.95], int(speck.sum()))
    if rng.random() < 0.3:
        field = np.clip(field + rng.normal(0, rng.choice([0.002, 0.05]), field.shape), 0, 1)
    valid = np.ones((rows, cols), bool)
    if rng.random() < 0.5:
        row, col = rng.integers(rows), rng.integers(cols)
        valid[row : row + 40, col : col + 30] = False
        valid &= rng.random((rows, cols)) > rng.choice([0, 0.01, 0.2])
    if not valid.any():
        valid[0, 0] = True
    if rng.random() < 0.4:
        return np.floor(field * 255 + rng.choice([0, 0.5])).clip(0, 255).astype(np.uint8), valid
    return field.astype((np.float32, np.float64)[rng.integers(2)]), valid


def choices(seed: int) -> tuple[float, float | None, float]:
    """X, tau and the width of levels."""
    rng = np.random.default_rng([seed, 1])
    tau = [None, None, 0.0173, 0.05, 0.21][int(rng.integers(5))]
    return (
        float(rng.choice([1.03, 1.2, 1.2, 3.0])),
        tau,
        float(rng.choice([0.1, 0.15, 0.3, 0.07, 1.0, 0.003])),
    )


def dataset_of(folder: Path, seed: int, values: NDArray[Any], valid: NDArray[np.bool_]) -> Dataset:
    """A map in memory with NaN, or one of bytes with a nodata value in a file."""
    box = GeoBox(values.shape, Affine(0.05, 0, -3, 0, -0.05, 7), None)
    if values.dtype.kind == "f":
        return Dataset.of_values(np.where(valid, values, values.dtype.type(np.nan)), box, "map")
    free = np.setdiff1d(np.arange(256, dtype=np.uint8), values[valid])
    if valid.all() or not len(free):
        valid[:] = True
        return Dataset.of_values(values, box, "map")
    path = folder / f"{seed}.tif"
    write_geotiff_pages(path, [Page([np.where(valid, values, free[0])], box, [""], int(free[0]))])
    return Dataset.open(path)


class Case(NamedTuple):
    """A map, its division parameters, and the leaves of the reference."""

    source: ProbabilityMap
    grey: NDArray[np.uint16]
    valid: NDArray[np.bool_]
    X: float
    tau: float | None
    leaves: Any


def case_of(
    reference: ModuleType,
    dataset: Dataset,
    values: Any,
    valid: Any,
    X: float,
    tau: float | None,
    width: float | None = None,
) -> Case:
    """A case of states, or of levels of a width."""
    edges = (0.498, 0.502) if width is None else reference.level_edges(width)
    grey = reference.grey(values, valid, 0, 255.0 if values.dtype == np.uint8 else 1.0, edges=edges)
    source = ProbabilityMap(dataset, stretch_of(dataset))
    return Case(source, grey, valid, X, tau, reference.divide(grey, valid, X, tau))


def labels_of(found: Extraction) -> NDArray[np.uint32]:
    return rasterise(found.rings, Window(0, 0, *found.geobox.shape))


def params_of(case: Case, refine: str) -> SegmentParams:
    method = "paper" if case.tau is None else "adaptive"
    return SegmentParams(method, case.X, case.tau or 0.0, refine)  # type: ignore[arg-type]


def wrong_states(reference: ModuleType, case: Case, runner: tuple[int, Map]) -> list[tuple[object, ...]]:
    """Differences of states and objects, refined or not."""
    different = []
    by_value = case.grey / 65535 > reference.UNKNOWN_TO
    for refine in ("scan", "none"):
        states, segments = reference.states_of_leaves(case.leaves, case.grey, case.valid, refine == "scan")
        request = ClassifyRequest(segment=params_of(case, refine), allow_lost_obstacles=True)
        found = classify(case.source, request, Work(*runner))
        if request.restores:
            states = default_states(reference, case)
            segments = reference.connected((states == 3).astype(np.int64))
        same_lost = plain_thin_obstacles.lost(states, case.grey, case.valid)
        same = np.array_equal(found.states, states)
        same &= np.array_equal(labels_of(found.objects), reference.by_size(segments))
        same &= found.cells == {k: int((states == k).sum()) for k in range(4)}
        same &= found.occupied_in_free == ((states == 1) & by_value).sum()
        same &= found.occupied_by_value == (case.valid & by_value).sum()
        same &= found.lost_obstacles == same_lost
        if not same:
            different.append((refine, runner[0], case.X, case.tau))
    return different


def default_states(reference: ModuleType, case: Case) -> NDArray[Any]:
    """States of the default method: in a trinary map those of cells; else of leaves, scans and obstacles."""
    if plain_thin_obstacles.is_trinary(case.grey, case.valid, (reference.FREE_TO, reference.UNKNOWN_TO)):
        own = np.vectorize(reference.state_of)(case.grey / 65535)
        return np.where(case.valid, own, 0)
    leaves, _ = reference.states_of_leaves(case.leaves, case.grey, case.valid, False)
    mixed = plain_thin_obstacles.with_free_of_mixed(leaves, case.grey)
    scanned = reference.refine_states(mixed, case.grey)
    return plain_thin_obstacles.restored(scanned, case.grey, case.valid)


def wrong_levels(
    reference: ModuleType, case: Case, width: float, runner: tuple[int, Map]
) -> list[tuple[object, ...]]:
    """Differences of levels, their segments and bounds."""
    level, labels = reference.levels_of_leaves(case.leaves, case.valid, width)
    edges = reference.level_edges(width)
    found = levels(case.source, LevelsRequest(Levels(width), params_of(case, "none")), Work(*runner))
    columns = found.regions.columns
    image = labels_of(found)
    same = np.array_equal(image, labels)
    same &= np.array_equal(np.concatenate([[-1], columns["level"]])[image], level)
    same &= columns["range_low"].tolist() == [edges[k] for k in columns["level"]]
    high = [min(edges[k + 1], 1.0) for k in columns["level"]]
    same &= np.allclose(columns["range_high"], high, rtol=0, atol=1e-9)  # the last edge may be slightly less
    return [] if same else [("levels", width, runner[0], case.X, case.tau)]


@pytest.mark.slow
@pytest.mark.parametrize(
    "first",
    [
        CHUNKS[0],
        *(
            pytest.param(first, marks=pytest.mark.slow if first < MAPS / 2 else pytest.mark.thorough)
            for first in CHUNKS[1:]
        ),
    ],
    ids=lambda first: f"maps {first} to {first + CHUNK - 1}",
)
def test_maps_are_those_of_the_reference(reference: ModuleType, tmp_path: Path, first: int) -> None:
    different = []
    for seed in range(first, first + CHUNK):
        values, valid = random_map(seed)
        X, tau, width = choices(seed)
        dataset = dataset_of(tmp_path, seed, values, valid)
        case = case_of(reference, dataset, values, valid, X, tau)
        wrong = wrong_states(reference, case, RUNNERS[seed % 2])
        case = case_of(reference, dataset, values, valid, X, tau, width)
        wrong += wrong_levels(reference, case, width, RUNNERS[seed // 2 % 2])
        different += [(seed, *case) for case in wrong]
    assert not different


@pytest.mark.slow
def test_the_maps_are_of_every_kind(reference: ModuleType) -> None:
    maps = [random_map(seed) for seed in range(MAPS)]
    assert {values.dtype.name for values, _ in maps} == {"uint8", "float32", "float64"}
    assert min(min(valid.shape) for _, valid in maps) < 10
    assert sum(any(side % 64 for side in valid.shape) for _, valid in maps) > 180
    assert sum(not valid.all() for _, valid in maps) > 60
    changed = 0
    for seed in range(0, MAPS, 10):
        values, valid = maps[seed]
        full = 255.0 if values.dtype == np.uint8 else 1.0
        one, other = (reference.states(values, valid, 0, full, refine=refine)[0] for refine in (True, False))
        changed += not np.array_equal(one, other)
    assert changed > 10


def real_map(folder: Path, name: str, tmp_path: Path) -> Path:
    """The YAML file of a real map; written here if it is missing or names another image."""
    picture, described = folder / f"{name}.pgm", folder / f"{name}.yaml"
    if not picture.is_file():
        pytest.skip(f"{picture.name} is not among the shared data")
    if described.is_file() and f"image: {picture.name}" in described.read_text():
        return described
    path = tmp_path / f"{name}.yaml"
    shutil.copy(picture, tmp_path)
    place = "resolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    path.write_text(f"image: {picture.name}\n{place}")
    return path


@pytest.mark.slow
@pytest.mark.parametrize("name", REAL)
def test_real_maps_are_those_of_the_reference(
    reference: ModuleType, shared_data: Path, tmp_path: Path, name: str
) -> None:
    dataset, _ = open_map(real_map(shared_data / "maps", name, tmp_path))
    values, _ = dataset.read(Window(0, 0, *dataset.geobox.shape))
    everywhere = np.ones(dataset.geobox.shape, bool)
    case = case_of(reference, dataset, values[0], everywhere, 1.2, None)
    assert not wrong_states(reference, case, (192, serial))
    adaptive = case_of(reference, dataset, values[0], everywhere, 1.2, 0.05, 0.1)
    assert not wrong_levels(reference, adaptive, 0.1, (192, serial))


def test_very_wide_maps_are_split_into_low_strips(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(classify_strips, "_MAX_STRIP_PIXELS", 64 * 256)
    values, _ = random_map(7)
    values = np.tile(values, (-(-200 // len(values)), 4))
    dataset = Dataset.of_values(values, GeoBox(values.shape, Affine.identity(), None), "map")
    strips = classify_strips.state_strips(values.shape, (512, 512))
    assert {window.rows for strip in strips[:-1] for window in strip} == {64}
    source = ProbabilityMap(dataset, stretch_of(dataset))
    found = classify(source, ClassifyRequest())
    monkeypatch.undo()
    assert np.array_equal(found.states, classify(source).states)
