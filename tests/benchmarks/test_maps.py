"""Benchmarks of maps: states against the ground truth, thin walls, and run times."""

import doctest
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from benchmarks import accuracy, obstacles, smallmap, table
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.ros.ros_map import write_ros_map
from uavseg.occupancy.simulation.scenes import lens
from uavseg.raster.grid.geobox import GeoBox

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def scores() -> dict[tuple[str, str], accuracy.Score]:
    return {(score.scene, score.method): score for score in accuracy.scores(seeds=1)}


def test_refinement_improves_free_and_unknown(scores: dict[tuple[str, str], accuracy.Score]) -> None:
    for scene, method in product(("lens", "circles"), ("uavseg", "uavseg adaptive")):
        before = scores[scene, f"{method}, division and creation"]
        after = scores[scene, f"{method}, refined"]
        assert after.free > before.free + 0.05 and after.unknown > before.unknown + 0.05


def test_the_original_lbpc_is_worse_than_segment_creation(
    scores: dict[tuple[str, str], accuracy.Score],
) -> None:
    for scene in ("lens", "circles"):
        theirs = scores[scene, "original LBP/C, segments classified by their mean"]
        ours = scores[scene, "uavseg, division and creation"]
        assert ours.free > theirs.free and ours.unknown > theirs.unknown


def test_only_the_ground_truth_has_full_overlap() -> None:
    truth = lens().truth().states
    assert accuracy.overlaps(truth, truth) == [1, 1, 1]
    assert max(accuracy.overlaps(truth % 3 + 1, truth)) == 0
    assert doctest.testmod(accuracy).attempted and not doctest.testmod(accuracy).failed


def test_every_method_gives_every_cell_a_state() -> None:
    v = np.full((64, 128), 0.5, np.float32)
    v[:, :32], v[:, 96:] = 0.2, 0.9
    grid = OccupancyGrid.from_probabilities(v, GeoBox(v.shape, lens().geobox.transform, None))
    for find in accuracy.METHODS.values():
        assert set(np.unique(find(grid))) <= {1, 2, 3}
    assert accuracy.overlaps(accuracy.by_threshold(grid), np.repeat([1, 2, 3], [32, 64, 32])[None]) == [
        1,
        1,
        1,
    ]


def test_a_thin_wall_is_classified_as_free_and_a_thick_one_is_not(tmp_path: Path) -> None:
    for name, width, share in (("depot", 1, 1.0), ("tb3_sandbox", 32, 0.0)):
        states = np.ones((128, 128), np.uint8)
        states[:, 64 : 64 + width] = 3
        write_ros_map(tmp_path / f"{name}.yaml", states, GeoBox((128, 128), lens().geobox.transform, None))
        [found] = [hazard for hazard in accuracy.hazards(tmp_path) if hazard.map == name]
        assert (found.cells, found.after) == (128 * width, share)


def test_walls_of_real_maps_are_classified_as_free(shared_data: Path) -> None:
    found = list(accuracy.hazards(shared_data / "maps"))
    assert [hazard.map for hazard in found] == [Path(name).stem for name in accuracy.REAL]
    assert all(0.3 < hazard.after <= hazard.before <= 1 for hazard in found)


def test_every_task_is_timed_on_both_maps() -> None:
    tasks = smallmap.measured(runs=1)
    assert all(task.lens_ms > 0 and task.circles_ms > 0 for task in tasks)
    text = table.small_maps(tasks)
    assert "segment by a range, and plan a path" in text and "felzenszwalb" in text


def test_the_accuracy_table_has_a_part_for_each_map() -> None:
    scores = [
        accuracy.Score("lens", "a", 0.5, 0.25, 1, 8.9),
        accuracy.Score("circles", "b", 0, 0.1, 0.9994, 2),
    ]
    text = table.accuracy(scores, [accuracy.Hazard("depot", 5000, 1.0, 0.449)])
    assert "### lens" in text and "### circles" in text and "### thin walls" in text
    assert "| a" in text and "0.250" in text and "0.999" in text and "45%" in text and "8.9" in text
    assert "thin walls" not in table.accuracy(scores, [])


def test_no_obstacle_of_a_drawn_map_is_lost() -> None:
    """Walls at all angles, poles, grids, furniture and doors, trinary and with noise."""
    found = list(obstacles.measured(Path("nowhere"), runs=1))
    assert len(found) == 24
    for kept in found:
        assert kept.lost[0] > 0.8 * kept.obstacles > 0 and kept.lost[1] == 0, kept
        assert kept.cells[1] > 0.98 and kept.free[1] > kept.free[0], kept
        if "trinary" in kept.map:
            assert kept.cells[1] == 1 and kept.noise[1] == 0


def test_no_obstacle_of_a_real_map_is_lost(shared_data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(obstacles, "DRAWINGS", {})
    found = {kept.map: kept for kept in obstacles.measured(shared_data / "maps", runs=1)}
    assert {name: (kept.obstacles, *kept.lost) for name, kept in found.items()} == {
        "depot": (131, 131, 0),
        "tb3_sandbox": (10, 9, 0),
        "turtlebot3_map": (10, 9, 0),
        "willow-full": (1590, 1371, 0),
    }
    assert all(kept.cells[1] == 1 for kept in found.values())


def test_the_table_of_obstacles_has_both_methods() -> None:
    kept = obstacles.Kept("depot", 131, (131, 0), (0.0, 1.0), (0, 0), (0.9, 1.0), (7.6, 4.7))
    text = table.obstacles([kept])
    assert "131 / 0" in text and "0.0% / 100.0%" in text and "7.6 / 4.7" in text


def test_drawn_maps_have_the_values_of_their_states() -> None:
    truth = obstacles.walls(2)
    assert set(np.unique(obstacles.values_of(truth, 0.0))) == {0, 0.5, 1}
    noisy = obstacles.values_of(truth, 0.03)
    for state, v in ((1, 0.1), (2, 0.5), (3, 0.9)):
        assert noisy[truth == state].mean() == pytest.approx(v, abs=0.01)
