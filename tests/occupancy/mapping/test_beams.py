"""The beam model, compared with a plain transcription and an exact traversal in fractions; invariances."""

import math
from fractions import Fraction

import numpy as np
import pytest
from affine import Affine
from hypothesis import given, settings, strategies as st

from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.scan import Pose, Scan
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window

FREE = math.log(0.1 / 0.9)


def model(d: float, r: float, sigma: float) -> float:
    """P(d) by its formula, one number at a time."""
    if d > r + 3 * sigma:
        return 0.5
    x = (d - r) / sigma
    p = 0.5 * (0.5 + 0.5 * math.erf(x / math.sqrt(2))) + (0.9 - 0.25) * math.exp(-(x**2) / 2)
    return min(max(p, 0.1), 0.95)


def one_beam(
    ranges: float, heading: float = 0.0, pose: tuple[float, float] = (0.0, 0.5), **how: float
) -> Scan:
    how = {"max_range_m": 50.0, "sigma_m": 1.0} | how
    return Scan(Pose(*pose, heading_rad=math.radians(heading)), np.zeros(1), np.array([ranges]), **how)


def crossings(
    u0: float, v0: float, du: float, dv: float, shape: tuple[int, int]
) -> dict[tuple[int, int], tuple[Fraction, Fraction]]:
    """Exact entry and exit of a ray in every cell that it comes near."""
    found = {}
    for row in range(shape[0]):
        for col in range(shape[1]):
            low, high = Fraction(0), Fraction(10**9)
            for place, step, first in ((u0, du, col), (v0, dv, row)):
                place, step = Fraction(place), Fraction(step)
                if step == 0:
                    if not first <= place < first + 1:
                        low, high = Fraction(1), Fraction(0)
                    continue
                ends = sorted([(first - place) / step, (first + 1 - place) / step])
                low, high = max(low, ends[0]), min(high, ends[1])
            if high - low > -Fraction(1, 10**9):
                found[row, col] = (low, high)
    return found


def rotated(quarters: int, scan: Scan, side: float) -> Scan:
    """A scan turned around the middle of a square map, counterclockwise."""
    x, y = scan.pose.x, scan.pose.y
    for _ in range(quarters):
        x, y = side - y, x
    return Scan(
        Pose(x, y, heading_rad=scan.pose.heading_rad + math.pi / 2 * quarters),
        scan.angles,
        scan.ranges,
        scan.max_range_m,
        scan.sigma_m,
    )


def six_digits(number: float) -> float:
    return round(number, 6)


@st.composite
def scans(draw: st.DrawFn, side: float = 12.0) -> Scan:
    places = st.one_of(
        st.integers(-16, 16).map(lambda n: side / 2 + n / 2), st.floats(-3, side + 3).map(six_digits)
    )
    count = draw(st.integers(1, 12))
    ranges = draw(st.lists(st.one_of(st.floats(0, side), st.just(math.inf)), min_size=count, max_size=count))
    angles = draw(st.lists(st.floats(-3.14, 3.14).map(six_digits), min_size=count, max_size=count))
    turns = st.floats(-360, 360).map(six_digits)
    heading = draw(st.one_of(st.sampled_from([0.0, 45.0, 90.0, 180.0, 270.0]), turns))
    pose = Pose(draw(places), draw(places), heading_rad=math.radians(heading))
    return Scan(pose, np.array(angles), np.array(ranges), draw(st.floats(0.5, 15)), draw(st.floats(0.05, 2)))


@st.composite
def unaligned_scans(draw: st.DrawFn) -> Scan:
    """Beams that run along no edge and through no corner, and end in the middle of no cell."""

    def numbers(low: float, step: float) -> st.SearchStrategy[float]:
        return st.integers(0, 40).map(lambda n: low + n * step)

    count = draw(st.integers(1, 12))
    far = st.one_of(numbers(0.1137, 0.3719), st.just(math.inf))
    ranges = draw(st.lists(far, min_size=count, max_size=count))
    angles = draw(st.lists(numbers(-3.0371, 0.1531), min_size=count, max_size=count))
    place = numbers(-2.7193, 0.4337)
    pose = Pose(draw(place), draw(place), heading_rad=math.radians(draw(numbers(1.1379, 8.7713))))
    reach, sigma = draw(numbers(0.2339, 0.4127)), draw(numbers(0.0517, 0.0731))
    return Scan(pose, np.array(angles), np.array(ranges), reach, sigma)


@pytest.mark.parametrize("measured", [0.0, 3.3, 20.0, 49.7])
@pytest.mark.parametrize("sigma", [0.2, 1.0, 5.0])
def test_cells_along_a_beam_follow_the_model(measured: float, sigma: float) -> None:
    grid = OccupancyGrid.empty((1, 60), 1.0)
    grid.merge(one_beam(measured, sigma_m=sigma))
    expected = [model(col + 0.5, measured, sigma) for col in range(60)]
    np.testing.assert_allclose(grid.probabilities[0], expected, rtol=1e-6)


def test_the_model_has_its_documented_values() -> None:
    grid = OccupancyGrid.empty((1, 60), 1.0)
    grid.merge(one_beam(30.5))
    assert grid.probabilities[0, 30] == pytest.approx(0.9, rel=1e-6)  # at the return
    np.testing.assert_allclose(grid.probabilities[0, :27], 0.1, rtol=1e-6)  # well before it
    assert (grid.probabilities[0, 34:] == 0.5).all()  # beyond three sigmas


def test_without_a_return_all_up_to_the_range_is_free() -> None:
    grid = OccupancyGrid.empty((3, 60), 1.0)
    window = grid.merge(one_beam(math.inf, pose=(0.0, 1.5), max_range_m=20.0))
    assert window == Window(1, 0, 1, 20)
    np.testing.assert_allclose(grid.probabilities[1, :20], 0.1, rtol=1e-6)
    assert (grid.probabilities[1, 20:] == 0.5).all()


@pytest.mark.slow
@given(
    st.floats(-2, 9) | st.integers(-4, 18).map(lambda n: n / 2),
    st.floats(-2, 9) | st.integers(-4, 18).map(lambda n: n / 2),
    st.integers(0, 360_000_000).map(lambda n: n / 1e6) | st.integers(0, 23).map(lambda n: 15.0 * n),
    st.floats(0.1, 14),
)
@settings(max_examples=150)
def test_every_crossed_cell_is_updated_once_and_no_other(
    x: float, y: float, heading: float, far: float
) -> None:
    grid = OccupancyGrid.empty((7, 6), 1.0)
    window = grid.merge(one_beam(math.inf, heading, (x, y), max_range_m=far))
    turned = math.radians(heading)
    exact = crossings(x, 7.0 - y, float(np.cos(turned)), -float(np.sin(turned)), (7, 6))
    slack = Fraction(1, 10**9)
    sure = {
        cell for cell, (low, high) in exact.items() if high - low > slack and (low + high) / 2 < far - slack
    }
    maybe = {cell for cell, (low, high) in exact.items() if (low + high) / 2 <= far + slack}
    touched = set(zip(*np.nonzero(grid.log_odds), strict=True))
    assert sure <= touched <= maybe
    assert (grid.log_odds[grid.log_odds != 0] == np.float32(FREE)).all()  # once
    assert_bounds(window, touched)


def assert_bounds(window: Window, touched: set[tuple[int, int]]) -> None:
    if not touched:
        assert window == Window(0, 0, 0, 0)
        return
    rows, cols = zip(*touched, strict=True)
    assert (window.row, window.col) == (min(rows), min(cols))
    assert (window.rows, window.cols) == (max(rows) - min(rows) + 1, max(cols) - min(cols) + 1)


@pytest.mark.slow
@given(scans())
@settings(max_examples=60)
def test_merging_is_adding_log_odds_beam_by_beam(scan: Scan) -> None:
    grid = OccupancyGrid.empty((12, 12), 1.0)
    grid.merge(scan)
    odds = np.zeros((12, 12), np.float32)
    doubtful = np.zeros((12, 12), bool)
    for angle, measured in zip(scan.angles, scan.ranges, strict=True):
        turned = scan.pose.heading_rad + angle
        exact = crossings(
            scan.pose.x, 12.0 - scan.pose.y, float(np.cos(turned)), -float(np.sin(turned)), (12, 12)
        )
        reach = scan.max_range_m if math.isinf(measured) else measured + 3 * scan.sigma_m
        for cell, (low, high) in exact.items():
            d = float(low + high) / 2
            doubtful[cell] |= high - low < 1e-9 or abs(d - reach) < 1e-9
            if high > low and d <= reach:
                p = 0.1 if math.isinf(measured) else model(d, measured, scan.sigma_m)
                odds[cell] = np.clip(odds[cell] + math.log(p / (1 - p)), -6, 6)
    sure = ~doubtful
    np.testing.assert_allclose(grid.log_odds[sure], odds[sure], atol=2e-6)
    np.testing.assert_allclose(
        grid.probabilities[sure], 1 / (1 + np.exp(-odds[sure].astype(float))), atol=1e-6
    )
    assert (grid.probabilities[(odds == 0) & sure] == 0.5).all()


@pytest.mark.slow
@given(st.lists(scans(), min_size=2, max_size=4), st.randoms(use_true_random=False))
@settings(max_examples=40)
def test_the_order_of_scans_matters_only_at_the_clamp(taken: list[Scan], random: object) -> None:
    grids = [OccupancyGrid.empty((12, 12), 1.0) for _ in range(2)]
    clamped = np.zeros((12, 12), bool)
    shuffled = list(taken)
    random.shuffle(shuffled)  # type: ignore[attr-defined]
    for grid, order in zip(grids, (taken, shuffled), strict=True):
        for scan in order:
            for k in range(len(scan.angles)):
                one = slice(k, k + 1)
                grid.merge(
                    Scan(scan.pose, scan.angles[one], scan.ranges[one], scan.max_range_m, scan.sigma_m)
                )
                clamped |= np.abs(grid.log_odds) >= 6
    first, second = (grid.log_odds[~clamped] for grid in grids)
    np.testing.assert_allclose(first, second, atol=1e-5)
    assert max(np.abs(grid.log_odds).max() for grid in grids) <= 6


@pytest.mark.slow
@given(unaligned_scans(), st.integers(1, 3))
@settings(max_examples=40)
def test_a_turned_scan_makes_a_turned_map(scan: Scan, quarters: int) -> None:
    grid, turned = (OccupancyGrid.empty((12, 12), 1.0) for _ in range(2))
    grid.merge(scan)
    turned.merge(rotated(quarters, scan, 12.0))
    np.testing.assert_allclose(turned.log_odds, np.rot90(grid.log_odds, quarters), atol=1e-4)


@pytest.mark.slow
@given(unaligned_scans(), st.floats(-180, 180), st.floats(-50, 50))
@settings(max_examples=30)
def test_a_map_turned_with_its_sensor_is_the_same_map(scan: Scan, turn: float, shift: float) -> None:
    grid = OccupancyGrid.empty((12, 12), 1.0)
    grid.merge(scan)
    to_turned = Affine.translation(shift, -shift) @ Affine.rotation(turn)
    turned = OccupancyGrid(GeoBox((12, 12), to_turned @ grid.geobox.transform, None))
    heading = scan.pose.heading_rad + math.radians(turn)
    pose = Pose(*(to_turned @ (scan.pose.x, scan.pose.y)), heading_rad=heading)
    turned.merge(Scan(pose, scan.angles, scan.ranges, scan.max_range_m, scan.sigma_m))
    np.testing.assert_allclose(turned.log_odds, grid.log_odds, atol=1e-4)


@pytest.mark.parametrize("heading", [1e-308, 5e-324, -1e-300])
def test_a_beam_that_hardly_rises_runs_along_its_row(heading: float) -> None:
    grid = OccupancyGrid.empty((3, 9), 1.0)
    assert grid.merge(one_beam(math.inf, heading, (0.0, 1.0), max_range_m=5.0)) == Window(2, 0, 1, 5)


def test_a_beam_without_measurement_changes_nothing() -> None:
    grid = OccupancyGrid.empty((5, 5), 1.0)
    assert grid.merge(one_beam(math.nan)) == Window(0, 0, 0, 0)
    assert (grid.probabilities == 0.5).all()
