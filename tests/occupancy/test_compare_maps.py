"""Two maps of one place: they register, and what was moved is found while what is noise is not."""

import math
from functools import cache

import numpy as np
import pytest
from affine import Affine

from benchmarks.changes import CELL_M, SHIFTS, draw_pair, place_of, run_map
from uavseg.errors import MapError
from uavseg.occupancy.several_maps import Evidence, PlacedMap, changed_objects, moved, register
from uavseg.raster.grid.geobox import GeoBox, local_geobox

ROOM = (120, 180)
HARD = SHIFTS["(2, 1) cells, 1 degree"]


def evidence(probabilities: np.ndarray, geobox: GeoBox | None = None) -> Evidence:
    place = geobox or local_geobox(probabilities.shape, CELL_M, (0.0, 0.0))
    return Evidence(PlacedMap("map", probabilities.astype(np.float32), place))


@cache
def seen(seed: int, after: bool, motion: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Evidence:
    pair = draw_pair(seed)
    grid = run_map(pair.scene(pair.after if after else pair.before), seed + 100 * after, motion)
    return evidence(grid.probabilities, grid.geobox)


def drawn(*boxes: tuple[int, int, int, int]) -> np.ndarray:
    """Draw free ground with the outlines of boxes: row, column, rows, columns."""
    cells = np.full(ROOM, 0.02)
    for row, col, rows, cols in ((5, 5, 110, 170), *boxes):
        cells[row : row + rows, col : col + cols] = 0.98
        cells[row + 2 : row + rows - 2, col + 2 : col + cols - 2] = 0.5 if rows < 100 else 0.02
    return cells


@pytest.mark.slow
@pytest.mark.parametrize("name", SHIFTS)
def test_the_motion_of_the_second_map_is_found(name: str) -> None:
    x, y, degrees = SHIFTS[name]
    found = register(seen(0, False), seen(0, True, SHIFTS[name]))
    assert math.hypot(found.shift[0] - x, found.shift[1] - y) < 0.3
    assert abs(found.angle_deg - degrees) < 0.2
    corner = np.array([place_of((2.0, 4.0), SHIFTS[name])])
    assert np.abs(moved(found.motion, np.array([[2.0, 4.0]])) - corner).max() < 0.5 * CELL_M


@pytest.mark.slow
def test_the_other_way_round_is_exactly_the_reverse() -> None:
    first, second = seen(1, False), seen(1, True, HARD)
    there, back = register(first, second), register(second, first)
    assert (there.motion, there.back) == (back.back, back.motion)
    assert there.share == back.share and there.angle_deg == pytest.approx(-back.angle_deg)


@pytest.mark.slow
def test_a_map_lies_on_itself_and_nothing_changed() -> None:
    one = seen(2, False)
    found = register(one, one)
    assert found.shift == (0, 0) and found.angle_deg == 0 and found.share == 1
    labels, kinds = changed_objects(one, one, found.motion, found.cell_m)
    assert not labels.any() and not len(kinds)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_boxes_that_went_and_came_are_found_and_nothing_else(seed: int) -> None:
    before, after = seen(seed, False), seen(seed, True, HARD)
    found, pair = register(before, after), draw_pair(seed)
    for one, other, motion, boxes, how in (
        (before, after, found.motion, pair.before[6:], (0.0, 0.0, 0.0)),
        (after, before, found.back, pair.after[6:], HARD),
    ):
        labels, kinds = changed_objects(one, other, motion, found.cell_m)
        hits = set()
        for k in np.flatnonzero(kinds == 1) + 1:
            row, col = (np.argwhere(labels == k) + 0.5).mean(axis=0)
            at = np.ravel(one.geobox.xy_from_pixel(row, col))
            near = [np.abs(at - place_of(box[:2], how)).max() < max(box[2:]) + 0.1 for box in boxes]
            assert any(near), "a change where none is"
            hits.add(near.index(True))
        assert hits == {0, 1}


def test_what_is_unknown_in_the_other_map_is_not_gone() -> None:
    before, after = drawn((30, 40, 12, 12)), drawn()
    after[20:60, 30:70] = 0.5
    one, other = evidence(before), evidence(after)
    labels, kinds = changed_objects(one, other, Affine.identity(), CELL_M)
    assert kinds.tolist() == [2] and (labels > 0).sum() == 12 * 12 - 8 * 8
    assert changed_objects(one, evidence(drawn()), Affine.identity(), CELL_M)[1].tolist() == [1]


def test_a_side_that_beams_have_cleared_is_no_change_and_a_box_at_a_wall_is_one() -> None:
    box = (30, 40, 14, 14)
    eroded = drawn(box)
    eroded[32:36, 40:44] = 0.02  # a part of a side, seven cells of which lie far from the others
    one = evidence(drawn(box))
    assert not len(changed_objects(one, evidence(eroded), Affine.identity(), CELL_M)[1])
    at_wall = evidence(drawn((30, 7, 14, 14)))
    assert changed_objects(at_wall, evidence(drawn()), Affine.identity(), CELL_M)[1].tolist() == [1]


def test_other_resolutions_register() -> None:
    fine = drawn((30, 40, 12, 12), (70, 120, 20, 16))
    coarse = fine.reshape(60, 2, 90, 2).max(axis=(1, 3))
    found = register(evidence(fine), evidence(coarse, local_geobox((60, 90), 2 * CELL_M, (0.03, 0.0))))
    assert found.cell_m == 2 * CELL_M
    assert abs(found.shift[0] - 0.3) < 0.3 and abs(found.angle_deg) < 0.3


@pytest.mark.slow
def test_maps_of_other_places_and_motions_beyond_the_limits_are_refused() -> None:
    rng = np.random.default_rng(1)
    boxes = [[(*rng.integers(10, 90, 1), *rng.integers(10, 150, 1), 14, 14) for _ in range(9)] for _ in "ab"]
    first, second = (np.where(drawn(*several) > 0.9, drawn(*several), 0.02) for several in boxes)
    first[:, :8], second[:, 172:] = 0.02, 0.02
    with pytest.raises(MapError, match="do not register within 5 cells and 2 degrees"):
        register(evidence(first[10:110, 10:170]), evidence(second[10:110, 10:170]))
    same = drawn((30, 40, 12, 12))
    with pytest.raises(MapError, match="do not register"):
        register(evidence(same), evidence(same, local_geobox(ROOM, CELL_M, (6 * CELL_M, 0.0))))
    with pytest.raises(MapError, match="no occupied cell"):
        evidence(np.full(ROOM, 0.5))


@pytest.mark.slow
def test_a_map_whose_raster_is_turned_by_a_quarter_gives_the_same() -> None:
    one, other = seen(1, False), seen(1, True, HARD)
    cols = other.states.shape[1]
    place = GeoBox((cols, len(other.states)), other.geobox.transform * Affine(0, -1, cols, 1, 0, 0), None)
    pair = draw_pair(1)
    grid = run_map(pair.scene(pair.after), 101, HARD)
    turned = evidence(np.ascontiguousarray(np.rot90(grid.probabilities)), place)
    straight, quarter = register(one, other), register(one, turned)
    assert quarter.shift == pytest.approx(straight.shift) and quarter.share == pytest.approx(straight.share)
    labels = [changed_objects(one, each, straight.motion, CELL_M)[0] for each in (other, turned)]
    assert np.array_equal(*labels)
