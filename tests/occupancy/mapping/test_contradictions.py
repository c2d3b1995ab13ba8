"""Evidence that is revised: walls stay, what moved away is forgotten, and without fading nothing changes."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from benchmarks.changes import cleared_cells
from tests.occupancy.random_scans import random_scan
from uavseg.errors import MapError, ParameterError
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.log_odds import probabilities_and_grey
from uavseg.occupancy.mapping.scan import Pose, Scan
from uavseg.occupancy.simulation.simulate import RangeFinder, Scene
from uavseg.raster.formats.geotiff import write_geotiff

SHAPE, CELL_M = (100, 120), 0.05
WALLS = [
    [(0.3, 0.2), (5.7, 0.2), (5.7, 0.3), (0.3, 0.3)],
    [(0.3, 4.7), (5.7, 4.7), (5.7, 4.8), (0.3, 4.8)],
    [(0.3, 0.3), (0.4, 0.3), (0.4, 4.7), (0.3, 4.7)],
    [(5.6, 0.3), (5.7, 0.3), (5.7, 4.7), (5.6, 4.7)],
]
BOX = [(3.0, 2.0), (3.5, 2.0), (3.5, 2.5), (3.0, 2.5)]
SENSOR = RangeFinder(0.03, 8.0, 360.0, 0.5)


def grid(**fading: float) -> OccupancyGrid:
    return OccupancyGrid.empty(SHAPE, CELL_M, **fading)


def scans(scene: Scene, count: int, seed: int) -> list[Scan]:
    """Scan from random free places, near walls too, so that beams graze them."""
    rng = np.random.default_rng(seed)
    found: list[Scan] = []
    while len(found) < count:
        x, y = rng.uniform(0.5, 5.5), rng.uniform(0.4, 4.6)
        if not (2.9 < x < 3.6 and 1.9 < y < 2.6):
            found.append(SENSOR.scan(scene, Pose(x, y, heading_rad=rng.uniform(0, math.tau)), rng))
    return found


def near_box() -> np.ndarray:
    row, col = np.indices(SHAPE) + 0.5
    x, y = col * CELL_M, (SHAPE[0] - row) * CELL_M
    return (np.abs(x - 3.25) < 0.4) & (np.abs(y - 2.25) < 0.4)


def test_what_moved_away_is_gone_after_three_scans_that_see_through_it() -> None:
    one = grid(forget_after=3)
    for scan in scans(Scene(polygons=[*WALLS, BOX]), 40, 1):
        one.merge(scan)
    held = near_box() & (one.log_odds > 0)
    assert held.sum() > 30
    left = []
    for scan in scans(Scene(polygons=WALLS), 4, 2):
        one.merge(scan)
        left.append(int((held & (one.log_odds > 0)).sum()))
    assert left[0] == left[1] == held.sum() and left[3] == 0


@pytest.mark.slow
def test_no_wall_is_cleared_where_plain_log_odds_clear_some() -> None:
    known, cleared, stray = cleared_cells({"forget_after": 3}, 600, warm=100)
    assert known > 1000 and cleared == 0
    plain = cleared_cells({}, 600, warm=100)
    assert plain[1] > 100 and stray <= 2 * plain[2]


@given(st.integers(0, 9999))
@settings(max_examples=15, deadline=None)
def test_probabilities_and_grey_follow_the_log_odds_however_they_fade(seed: int) -> None:
    rng = np.random.default_rng(seed)
    fading = [{"forget_after": 1}, {"clamp": 1.5}, {"half_life": 3.0}, {"forget_after": 2, "clamp": 3.0}][
        seed % 4
    ]
    one = grid(**fading)
    live = one.segment()
    _ = one.probabilities
    for _ in range(6):
        one.update(random_scan(rng, SHAPE, CELL_M))
        assert np.abs(one.log_odds).max() <= fading.get("clamp", 6.0)
        probabilities, grey = probabilities_and_grey(one.log_odds)
        assert np.array_equal(one.probabilities, probabilities)
        assert np.array_equal(one._grey_map.grey[1 : SHAPE[0] + 1, 1 : SHAPE[1] + 1], grey)
    fresh = grid()
    fresh.log_odds[...] = one.log_odds
    fresh._recompute()
    again = fresh.segment()
    if np.array_equal(live.bin_edges, again.bin_edges):
        assert np.array_equal(live.intervals, again.intervals)


@given(st.integers(0, 9999))
@settings(max_examples=15, deadline=None)
def test_what_never_fades_is_the_plain_grid_to_the_bit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    plain, clamped, free = grid(), grid(clamp=6.0), grid(forget_after=3)
    for _ in range(5):
        scan = random_scan(rng, SHAPE, CELL_M)
        before = free.log_odds.copy()
        for one in (plain, clamped):
            one.merge(scan)
        window = free.merge(scan)
        outside = np.ones(SHAPE, bool)
        outside[window.slices] = False
        assert np.array_equal(free.log_odds[outside], before[outside])
        lost = (before > 0) & (free.log_odds < before)
        assert not lost.any() or not (free.log_odds[lost] > 0).any()  # evidence is lost whole or not at all
    assert np.array_equal(plain.log_odds, clamped.log_odds)
    assert np.array_equal(plain.probabilities, clamped.probabilities)
    never = plain.log_odds < 0
    assert (free.log_odds[never & (free.log_odds <= 0)] <= 0).all()


def test_a_half_life_halves_what_is_not_seen() -> None:
    one = grid(half_life=2.0)
    one.log_odds[0, 0] = 4.0
    for _ in range(4):
        one.merge(Scan(Pose(5, 0.5), np.zeros(1), np.array([0.5]), max_range_m=1.0, sigma_m=0.03))
    assert one.log_odds[0, 0] == pytest.approx(1.0)


def test_fading_is_saved_with_the_grid(tmp_path: Path) -> None:
    for n, fading in enumerate(({"forget_after": 3}, {"clamp": 2.5, "half_life": 100.0}, {})):
        one = grid(**fading)
        for scan in scans(Scene(polygons=WALLS), 2, n):
            one.merge(scan)
        one.save(tmp_path / f"{n}.tif")
        loaded = OccupancyGrid.load(tmp_path / f"{n}.tif")
        assert loaded.fading == one.fading and np.array_equal(loaded.log_odds, one.log_odds)
        later = scans(Scene(polygons=WALLS), 1, 9)[0]
        for each in (one, loaded):
            each.merge(later)
        assert np.array_equal(loaded.log_odds, one.log_odds)


@pytest.mark.parametrize(
    "fading",
    [
        {"clamp": 0.0},
        {"clamp": 7.0},
        {"half_life": 0.0},
        {"forget_after": 0},
        {"clamp": math.nan},
        {"half_life": math.inf},
        {"forget_after": 10**9},
    ],
)
def test_numbers_that_are_not_possible_are_refused(fading: dict[str, float]) -> None:
    with pytest.raises(ParameterError, match=next(iter(fading))):
        grid(**fading)


@pytest.mark.parametrize("text", ["x", "6.0", "6.0 None", "6.0 None None None", "nan None None", "6 0 0"])
def test_a_damaged_file_is_one_clear_line(tmp_path: Path, text: str) -> None:
    tags = {"UAVSEG_OCCUPANCY_GRID": "log-odds", "UAVSEG_FADING": text}
    one = grid()
    write_geotiff(tmp_path / "a.tif", [one.log_odds], one.geobox, ["log-odds of occupancy"], tags)
    with pytest.raises((MapError, ParameterError)):
        OccupancyGrid.load(tmp_path / "a.tif")
