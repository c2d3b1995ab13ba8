"""Simulations: seeds, and the ground truth compared with lines of sight."""

import math

import numpy as np
import pytest
import shapely

from tests.occupancy.simulation.json_scene import SCENE
from uavseg.occupancy.mapping.scan import Pose
from uavseg.occupancy.simulation.scenes import BUILT_IN_SCENES, build_simulation
from uavseg.occupancy.simulation.simulate import RangeFinder, Scene, Simulation
from uavseg.units import FREE, OCCUPIED, UNKNOWN


def test_the_same_seed_gives_the_same_map() -> None:
    simulation = BUILT_IN_SCENES["lens"]()
    first, again, other = (simulation.run(seed).probabilities for seed in (3, 3, 4))
    assert (first == again).all() and (first != other).any()


def test_the_first_views_do_not_depend_on_those_after_them() -> None:
    whole = build_simulation(SCENE)
    alone = Simulation(whole.scene, whole.sensor, whole.poses[:1], whole.geobox)
    both = alone.run(1)
    both.merge(whole.sensor.scan(whole.scene, whole.poses[1], np.random.default_rng([1, 1])))
    assert (both.probabilities == whole.run(1).probabilities).all()


@pytest.mark.parametrize("seed", range(3))
def test_the_truth_is_what_lines_of_sight_say(seed: int) -> None:
    simulation = build_simulation(SCENE)
    truth = simulation.truth()
    solid = shapely.union_all([shapely.Polygon(SCENE["polygons"][0]), shapely.Point(0, 0).buffer(0.4, 2000)])
    sensor, skin = simulation.sensor, 3 * simulation.sensor.sigma_m
    for row, col in np.random.default_rng(seed).integers(0, (40, 60), (300, 2)):
        x, y = -1 + (col + 0.5) * 0.1, 2 - (row + 0.5) * 0.1
        inside = solid.contains(shapely.Point(x, y))
        assert truth.solid[row, col] == inside
        seen = False
        for pose in simulation.poses:
            sight = shapely.LineString([(pose.x, pose.y), (x, y)])
            aside = math.degrees(math.atan2(y - pose.y, x - pose.x)) - math.degrees(pose.heading_rad)
            if abs((aside + 180) % 360 - 180) > 45:
                continue
            blocked = sight.intersection(solid).length
            if inside:
                seen |= blocked <= skin and sight.length - blocked <= sensor.max_range_m
            else:
                seen |= blocked == 0 and sight.length <= sensor.max_range_m
        assert truth.visible[row, col] == seen
        assert truth.states[row, col] == ((OCCUPIED if inside else FREE) if seen else UNKNOWN)


def test_a_scene_with_nothing_in_it_is_all_free() -> None:
    simulation = Simulation(
        Scene(), RangeFinder(0.05, 1.0), [Pose(1.6, 1.6)], BUILT_IN_SCENES["lens"]().geobox
    )
    p, truth = simulation.run().probabilities, simulation.truth()
    assert p.max() == 0.5
    assert not truth.solid.any() and set(np.unique(truth.states)) == {FREE, UNKNOWN}
    seen = (p < 0.5) & (truth.states == UNKNOWN)  # a cell is crossed though its centre lies beyond the range
    assert seen.mean() < 0.01
