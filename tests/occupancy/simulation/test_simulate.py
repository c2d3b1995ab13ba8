"""Simulations: the two of the paper, scenes from files, and the truth beside them."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from uavseg.errors import SceneError
from uavseg.occupancy.mapping.scan import Pose
from uavseg.occupancy.simulation.paper_scenes import BUILT_IN
from uavseg.occupancy.simulation.range_finder import RangeFinder
from uavseg.occupancy.simulation.scene import Scene
from uavseg.occupancy.simulation.scene_file import load_scene, simulation_from
from uavseg.occupancy.simulation.simulate import Simulation
from uavseg.units import FREE, OCCUPIED, UNKNOWN

SCENE: dict[str, Any] = {
    "map": {"rows": 40, "cols": 60, "cell": 0.1, "origin": [-1, -2]},
    "polygons": [[[2, 0], [3, 0], [2.5, 1]]],
    "circles": [{"center": [0, 0], "radius": 0.4}],
    "sensor": {"sigma": 0.02, "range": 3, "fov": 90, "step": 1},
    "poses": [{"at": [1.2, -0.5], "heading": 20}, {"at": [1, 1]}],
}


@pytest.mark.parametrize(("name", "views", "sigma"), [("lens", 5, 0.05), ("circles", 8, 0.03)])
def test_the_scenes_of_the_paper_are_as_it_tells(name: str, views: int, sigma: float) -> None:
    simulation = BUILT_IN[name]()
    assert simulation.geobox.shape == (320, 320)
    assert len(simulation.poses) == views
    sensor = simulation.sensor
    assert sensor.sigma_m == sigma and sensor.max_range_m == 2 and sensor.step_deg == 0.5
    p = simulation.run(0).probabilities
    assert p.dtype == np.float32 and p.min() > 0 and p.max() < 1
    truth = simulation.truth()
    inner = truth.solid & ~truth.visible
    assert inner.any() and (p[inner] == 0.5).mean() > 0.5  # what is inside objects is never seen
    assert (p[truth.states == FREE] < 0.5).mean() > 0.9
    assert (p[truth.states == OCCUPIED] > 0.5).mean() > 0.6
    assert (p[truth.states == UNKNOWN] == 0.5).mean() > 0.9


def test_the_same_seed_gives_the_same_map() -> None:
    simulation = BUILT_IN["lens"]()
    first, again, other = (simulation.run(seed).probabilities for seed in (3, 3, 4))
    assert (first == again).all() and (first != other).any()


def test_the_first_views_do_not_depend_on_those_after_them() -> None:
    whole = simulation_from(SCENE)
    alone = Simulation(whole.scene, whole.sensor, whole.poses[:1], whole.geobox)
    both = alone.run(1)
    both.merge(whole.sensor.scan(whole.scene, whole.poses[1], np.random.default_rng([1, 1])))
    assert (both.probabilities == whole.run(1).probabilities).all()


@pytest.mark.parametrize("seed", range(3))
def test_the_truth_is_what_lines_of_sight_say(seed: int) -> None:
    simulation = simulation_from(SCENE)
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
            aside = math.degrees(math.atan2(y - pose.y, x - pose.x)) - pose.heading_deg
            if abs((aside + 180) % 360 - 180) > 45:
                continue
            blocked = sight.intersection(solid).length
            if inside:
                seen |= blocked <= skin and sight.length - blocked <= sensor.max_range_m
            else:
                seen |= blocked == 0 and sight.length <= sensor.max_range_m
        assert truth.visible[row, col] == seen
        assert truth.states[row, col] == ((OCCUPIED if inside else FREE) if seen else UNKNOWN)


def test_a_scene_comes_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "scene.json"
    path.write_text(json.dumps(SCENE))
    simulation = load_scene(path)
    assert simulation.geobox.shape == (40, 60)
    assert simulation.geobox.transform[:6] == (0.1, 0, -1, 0, -0.1, 2)
    assert simulation.sensor == RangeFinder(0.02, 3, 90, 1)
    assert simulation.poses == [Pose(1.2, -0.5, 20), Pose(1, 1, 0)]
    assert simulation.scene.contains([0, 2.5, 1], [0, 0.5, 1]).tolist() == [True, True, False]


def test_a_sensor_left_out_is_the_usual_one() -> None:
    simulation = simulation_from({"map": SCENE["map"], "poses": SCENE["poses"]})
    assert simulation.sensor == RangeFinder(0.05, 2.0, 360, 0.5)


def changed(**keys: Any) -> str:
    return json.dumps({key: value for key, value in (SCENE | keys).items() if value is not None})


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("{", "is no JSON"),
        ("[]", "the scene is an object with map and poses"),
        (changed(map=None), "map is missing"),
        (changed(poses=[]), "at least one pose"),
        (changed(walls=[]), "the scene has no 'walls'"),
        (changed(map=SCENE["map"] | {"cell": 0}), "more than 0, not 0"),
        (changed(map=SCENE["map"] | {"rows": 1.5}), "map rows is a whole number"),
        (changed(map=SCENE["map"] | {"rows": 10**9}), "is too large"),
        (changed(map=SCENE["map"] | {"origin": [0]}), "map origin wants places as"),
        (changed(sensor={"sigma": -0.1}), "a number above 0, not -0.1"),
        (changed(sensor={"range": "far"}), "sensor range wants a finite number"),
        (changed(sensor={"rnage": 1}), "sensor has no 'rnage'"),
        (changed(sensor={"range": True}), "sensor range wants a finite number"),
        (changed(circles=[{"center": [0, 0], "radius": -1}]), "circle 1 has a radius of -1"),
        (changed(circles=[[0, 0, 1]]), "circle 1 is an object with center and radius"),
        (changed(polygons=[[[0, 0], [2, 2], [2, 0], [0, 2]]]), "polygon 1 crosses or touches itself"),
        (changed(polygons=[[0, 0, 1]]), "polygon 1 wants places as"),
        (changed(poses=[{"at": [0, 0.1]}]), "pose 1 at .* stands inside something solid"),
        (changed(poses=[{"at": [0, 0], "yaw": 1}]), "pose 1 has no 'yaw'"),
        (changed().replace("0.4", "NaN"), "NaN is not a number"),
        (changed().replace("0.4", "1e999"), "wants a finite number"),
        ('{"map": {}, "map": {}}', "'map' is there twice"),
    ],
)
def test_a_scene_that_cannot_be_is_refused_in_one_line(tmp_path: Path, text: str, told: str) -> None:
    path = tmp_path / "scene.json"
    path.write_text(text)
    with pytest.raises(SceneError, match=told) as caught:
        load_scene(path)
    assert "\n" not in str(caught.value) and str(path) in str(caught.value)


def test_a_missing_scene_is_told(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="there is no such file; name lens, circles or a JSON file"):
        load_scene(tmp_path / "none.json")


def test_a_scene_with_nothing_in_it_is_all_free() -> None:
    simulation = Simulation(Scene(), RangeFinder(0.05, 1.0), [Pose(1.6, 1.6)], BUILT_IN["lens"]().geobox)
    p, truth = simulation.run().probabilities, simulation.truth()
    assert p.max() == 0.5
    assert not truth.solid.any() and set(np.unique(truth.states)) == {FREE, UNKNOWN}
    seen = (p < 0.5) & (truth.states == UNKNOWN)  # a cell is crossed though its centre lies beyond the range
    assert seen.mean() < 0.01
