"""Drives through drawn scenes: all that can be known is known, from any start, again and again the same."""

import math

import numpy as np
import pytest

from uavseg.occupancy.explore.drive import Drive, Explorer, is_frontier, knowable_cells
from uavseg.occupancy.explore.frontiers import find_frontiers
from uavseg.occupancy.explore.next_view import ViewPlanner, tour_from
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.scan import Pose
from uavseg.occupancy.simulation.simulate import CellScene, RangeFinder
from uavseg.raster.grid.geobox import local_geobox
from uavseg.segmentation.params.segment import StateLimits
from uavseg.units import FREE, OCCUPIED, UNKNOWN

CELL = 0.1


def two_rooms() -> np.ndarray:
    solid = np.ones((40, 60), bool)
    solid[2:38, 2:28] = solid[2:38, 31:58] = False
    solid[18:26, 28:31] = False  # the door
    solid[8:14, 40:46] = True
    return solid


def explorer_of(solid: np.ndarray) -> Explorer:
    geobox = local_geobox(solid.shape, CELL, (0.0, 0.0))
    sensor = RangeFinder(sigma_m=0.03, max_range_m=2.5, step_deg=1.0)
    return Explorer(CellScene(solid, geobox), sensor, OccupancyGrid(geobox))


def explored(
    solid: np.ndarray, at: tuple[float, float], fov: float = 360.0, clearance: float = 0.0, seed: int = 0
) -> tuple[Drive, float]:
    geobox = local_geobox(solid.shape, CELL, (0.0, 0.0))
    sensor = RangeFinder(sigma_m=0.03, max_range_m=2.5, fov_deg=fov, step_deg=1.0)
    explorer = Explorer(CellScene(solid, geobox), sensor, OccupancyGrid(geobox), clearance, seed)
    drive = explorer.run(Pose(*at))
    col, row = ~geobox.transform * at
    knowable = knowable_cells(solid, (int(row), int(col)), CELL, 2.5, clearance)
    known = StateLimits().of(drive.grid.probabilities) != UNKNOWN
    return drive, float((known & knowable).sum() / knowable.sum())


@pytest.mark.parametrize(("fov", "clearance"), [(360.0, 0.0), (360.0, 0.25), (60.0, 0.0), (90.0, 0.2)])
@pytest.mark.parametrize("at", [(1.0, 1.0), (5.0, 3.0)])
def test_a_drive_ends_when_all_that_can_be_known_is_known(
    at: tuple[float, float], fov: float, clearance: float
) -> None:
    solid = two_rooms()
    drive, share = explored(solid, at, fov, clearance)
    assert share >= 0.99
    assert drive.metres[-1] < 60
    assert not CellScene(solid, drive.grid.geobox).contains(*drive.xy.T).any()  # never into something solid
    steps = np.hypot(*np.diff(drive.xy, axis=0).T)
    assert steps.max() <= 0.25 + CELL and steps.sum() == pytest.approx(drive.metres[-1], abs=1e-6)


def test_the_same_seed_gives_the_same_drive_and_scans_again() -> None:
    one, _ = explored(two_rooms(), (1.0, 1.0), seed=3)
    two, _ = explored(two_rooms(), (1.0, 1.0), seed=3)
    assert one.poses == two.poses and one.known == two.known
    again = OccupancyGrid(one.grid.geobox)
    for number in range(len(one.poses)):
        again.merge(one.scan(number))
    assert np.array_equal(again.log_odds, one.grid.log_odds)


def test_what_was_seen_before_changes_no_choice() -> None:
    explorer = explorer_of(two_rooms())

    def choose(states: np.ndarray, at: tuple[int, int]) -> tuple[tuple[int, int], np.ndarray] | None:
        fresh = ViewPlanner(states.shape, CELL, 2.5)
        fresh.tried, fresh.driven = explorer.planner.tried, explorer.planner.driven
        one, two = explorer.planner.choose(states, at), fresh.choose(states, at)
        assert (one is None) == (two is None)
        assert one is None or two is None or (one[0] == two[0] and np.array_equal(one[1], two[1]))
        return one

    assert len(explorer.run(Pose(1.0, 1.0), choose).seconds) >= 5


def test_a_way_that_scans_block_is_planned_again() -> None:
    solid = two_rooms()
    explorer = explorer_of(solid)

    def choose(states: np.ndarray, _: tuple[int, int]) -> tuple[tuple[int, int], np.ndarray] | None:
        if explorer.drive.views:
            return None
        states[...] = np.where(solid, OCCUPIED, FREE)
        states[4:8, 28:31] = FREE  # an opening that is none
        states[2, 50] = UNKNOWN
        return (6, 50), np.array([[2, 51]])

    drive = explorer.run(Pose(1.0, 3.4), choose)
    assert len(drive.views) == 1 and explorer.at == (6, 50)
    assert drive.metres[-1] > 4.5  # by the door; 4 m straight on


def test_what_a_view_left_unknown_was_looked_at_in_vain_whatever_else_was_learned() -> None:
    solid = two_rooms()
    explorer = explorer_of(solid)
    hidden = np.array([[30, 50]])  # in the other room

    def choose(states: np.ndarray, at: tuple[int, int]) -> tuple[tuple[int, int], np.ndarray] | None:
        if explorer.drive.views:
            return None
        states[30, 50] = FREE
        return (at[0] + 5, at[1] + 5), hidden

    drive = explorer.run(Pose(1.0, 1.0), choose)
    assert drive.known[-1] > drive.known[0]
    assert explorer.planner.tried[30, 50] == 1 and explorer.planner.tried.sum() == 1


def test_a_closed_room_needs_no_drive() -> None:
    solid = np.ones((20, 20), bool)
    solid[5:15, 5:15] = False
    drive, share = explored(solid, (1.0, 1.0))
    assert share == 1.0 and drive.metres[-1] < 2.0


def test_tours_end_where_unknown_space_goes_on() -> None:
    x = np.array([0.0, -1.0, 2.0])  # the robot, a view behind, a view ahead
    lengths = np.abs(x[:, None] - x)
    assert tour_from(lengths, np.array([0.0, 0.0])) == [0, 1]
    assert tour_from(lengths, np.array([5.0, 0.0])) == [1, 0]


def test_what_was_looked_at_in_vain_comes_last_and_is_then_none() -> None:
    states = np.full((40, 60), FREE, np.uint8)
    states[:, 50:] = UNKNOWN
    planner = ViewPlanner(states.shape, CELL, 2.0)
    for _ in range(3):
        chosen = planner.choose(states, (20, 5))
        assert chosen is not None
        planner.tried[tuple(find_frontiers(states).cells.T)] += 1
    assert planner.choose(states, (20, 5)) is None


@pytest.mark.parametrize("angle", [0.0, 1.0, -2.5, math.pi])
def test_the_heading_has_the_cells_in_view(angle: float) -> None:
    planner = ViewPlanner((100, 100), CELL, 5.0, fov_deg=60.0)
    around = angle + np.linspace(-0.4, 0.4, 9)
    cells = np.round(50 + 40 * np.stack([np.sin(around), np.cos(around)], axis=1)).astype(np.int64)
    outlier = np.array([[50 - round(40 * math.sin(angle)), 50 - round(40 * math.cos(angle))]])
    heading, seen = planner.heading((50, 50), np.vstack([cells, outlier]))
    assert len(seen) == 9
    assert abs((heading - angle + math.pi) % math.tau - math.pi) < 0.05


def test_frontier_cells_are_told_from_others() -> None:
    states = np.array([[1, 1, 2], [1, 3, 2]], np.uint8)
    cells = np.argwhere(states < 9)
    expected = find_frontiers(states).index[tuple(cells.T)] >= 0
    assert np.array_equal(is_frontier(states, cells), expected)


def test_depths_tell_a_closed_room_from_a_corridor_that_goes_on() -> None:
    states = np.full((30, 120), OCCUPIED, np.uint8)
    states[10:20, 20:60] = FREE
    states[10:20, 8:20] = UNKNOWN  # 12 cells to the left, and walls around
    states[10:20, 60:118] = UNKNOWN  # 58 cells to the right
    tour = ViewPlanner(states.shape, CELL, 2.0).tour(states, (15, 40))
    assert tour is not None and len(tour.views) == 2
    left, right = sorted(zip(tour.candidates.cells[tour.views, 1], tour.depths, strict=True))
    assert left[1] == pytest.approx(12, abs=4) and right[1] == pytest.approx(58, abs=4)
    assert tour.candidates.cells[tour.views[0], 1] == left[0]  # the room is finished before


def test_a_robot_can_return_where_it_was_whatever_noise_says_of_it() -> None:
    states = np.full((20, 60), OCCUPIED, np.uint8)
    states[8:12, 5:50], states[8:12, 50:55] = FREE, UNKNOWN
    states[8:12, 20] = OCCUPIED  # noise closed the way on which it came
    planner = ViewPlanner(states.shape, CELL, 1.0)
    assert planner.choose(states, (10, 8)) is None
    planner.driven[10, 6:30] = True
    assert planner.choose(states, (10, 8)) is not None
