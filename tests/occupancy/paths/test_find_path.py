"""Planned paths: on the ground, reversible, with clearance, and clear reasons where there is none."""

from itertools import pairwise

import numpy as np
import pytest
from affine import Affine
from hypothesis import given, settings, strategies as st

from tests.occupancy.paths.sight import is_visible
from uavseg.errors import ParameterError, PathError
from uavseg.occupancy.paths.clearance import clearance
from uavseg.occupancy.paths.find_path import FreeCells, PathParams, PlannedPath, find_path
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.intensity.stretch import Stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.regions.outline.trace import trace
from uavseg.segmentation.params.segment import IntensityRange
from uavseg.segmentation.source import GreySource

CELL = 0.25
BOX = GeoBox((24, 36), Affine(CELL, 0, -3, 0, -CELL, 6), None)


def free_cells(p: np.ndarray, regions: np.ndarray, box: GeoBox = BOX) -> FreeCells:
    """Cells below 0.45 in labelled regions."""
    dataset = Dataset.of_values(p.astype(np.float32), box, "map")
    source = GreySource(dataset, Stretch(0.0, 1.0, "none"))
    return FreeCells(source, trace(regions.astype(np.uint32)), IntensityRange(0, 0.45), ("a warning",))


def rooms(seed: int) -> np.ndarray:
    """Obstacles of 3 x 3 cells; the corners of the map are free."""
    rng = np.random.default_rng(seed)
    p = np.where(rng.random((8, 12)) < 0.25, 0.9, 0.1).repeat(3, 0).repeat(3, 1)
    p[:3, :3] = p[-3:, -3:] = 0.1
    return p


def centre(row: int, col: int, box: GeoBox = BOX) -> tuple[float, float]:
    x, y = box.xy_from_pixel(row + 0.5, col + 0.5)
    return float(x), float(y)


def found(p: np.ndarray, params: PathParams, reverse: bool = False) -> PlannedPath | None:
    ends = [centre(1, 1), centre(22, 34)]
    try:
        return find_path(free_cells(p, np.ones(BOX.shape)), *(ends[::-1] if reverse else ends), params)
    except PathError:
        return None


@pytest.mark.slow
@settings(max_examples=40)
@given(st.integers(0, 2**32), st.booleans())
def test_a_path_leads_over_free_cells_and_is_as_long_in_reverse(seed: int, smooth: bool) -> None:
    p = rooms(seed)
    path, back = (found(p, PathParams(smooth=smooth), reverse) for reverse in (False, True))
    assert (path is None) == (back is None)
    if path is None or back is None:
        return
    assert path.xy[0].tolist() == list(centre(1, 1)) and path.xy[-1].tolist() == list(centre(22, 34))
    assert all(is_visible(p < 0.45, *leg) for leg in pairwise(path.corners))
    assert path.length_m == pytest.approx(np.hypot(*np.diff(path.xy, axis=0).T).sum())
    assert path.cells == back.cells and path.walls == (p > 0.45).sum()
    if not smooth:
        assert path.length_m == pytest.approx(back.length_m)
    assert path.warnings[0] == "a warning"


@pytest.mark.slow
@settings(max_examples=40)
@given(st.integers(0, 2**32), st.sampled_from([0.1, 0.3, 0.4]), st.booleans())
def test_a_path_keeps_its_clearance_and_is_no_shorter_with_one(
    seed: int, metres: float, smooth: bool
) -> None:
    p = rooms(seed)
    near, far = found(p, PathParams()), found(p, PathParams(metres, smooth))
    if far is None:
        return
    clear = clearance(p < 0.45, CELL, CELL) >= metres - 1e-9
    assert all(is_visible(clear, *leg) for leg in pairwise(far.corners))
    assert near is not None and far.cells >= near.cells and far.clearance_m == metres


def test_string_pulling_is_no_longer() -> None:
    lengths = [
        (found(rooms(seed), PathParams()), found(rooms(seed), PathParams(smooth=True))) for seed in range(9)
    ]
    assert any(plain is not None for plain, _ in lengths)
    for plain, smooth in lengths:
        assert plain is None or smooth is None or smooth.length_m <= plain.length_m + 1e-9


def test_a_path_of_one_cell_has_no_length() -> None:
    path = find_path(free_cells(np.full(BOX.shape, 0.1), np.ones(BOX.shape)), centre(4, 4), centre(4, 4))
    assert path.length_m == 0 and path.cells == 1 and path.corners.tolist() == [[4, 4]]


@pytest.mark.parametrize(
    ("start", "goal", "message"),
    [
        ((4, 4), (4, 30), "no path .* the start lies in region 1 and the goal lies in region 2"),
        ((4, 4), (4, 15), r"the goal in no region .*nearest free cell of region 1 is 0.75 m from the goal"),
        ((4, 4), (20, 4), "no path leads from the start to the goal: both lie in region 1"),
    ],
)
def test_where_there_is_no_path_the_message_says_why(
    start: tuple[int, int], goal: tuple[int, int], message: str
) -> None:
    p, regions = np.full(BOX.shape, 0.1), np.ones(BOX.shape)
    p[12, :], regions[:, 13:18], regions[:, 18:] = 0.9, 0, 2
    with pytest.raises(PathError, match=message):
        find_path(free_cells(p, regions), centre(*start), centre(*goal))


def test_cells_that_are_not_square_are_warned_of() -> None:
    box = GeoBox(BOX.shape, Affine(0.5, 0, 0, 0, -0.25, 6), None)
    free = free_cells(np.full(box.shape, 0.1), np.ones(box.shape), box)
    path = find_path(free, centre(2, 2, box), centre(9, 9, box))
    assert "0.5 m wide and 0.25 m high" in path.warnings[-1]


@pytest.mark.parametrize("metres", [-0.1, np.nan, np.inf])
def test_a_clearance_that_is_not_a_distance_is_refused(metres: float) -> None:
    with pytest.raises(ParameterError, match="finite and not negative"):
        PathParams(metres)
