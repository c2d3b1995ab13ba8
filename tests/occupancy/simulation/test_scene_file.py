"""JSON files of scenes: defaults, and one line for each fault."""

import json
import math
from pathlib import Path
from typing import Any

import pytest

from tests.occupancy.simulation.json_scene import SCENE
from uavseg.errors import SceneError
from uavseg.occupancy.mapping.scan import Pose
from uavseg.occupancy.simulation.scenes import build_simulation, load_scene
from uavseg.occupancy.simulation.simulate import RangeFinder


def test_a_scene_comes_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "scene.json"
    path.write_text(json.dumps(SCENE))
    simulation = load_scene(path)
    assert simulation.geobox.shape == (40, 60)
    assert simulation.geobox.transform[:6] == (0.1, 0, -1, 0, -0.1, 2)
    assert simulation.sensor == RangeFinder(0.02, 3, 90, 1)
    assert simulation.poses == [Pose(1.2, -0.5, heading_rad=math.radians(20)), Pose(1, 1)]
    assert simulation.scene.contains([0, 2.5, 1], [0, 0.5, 1]).tolist() == [True, True, False]


def test_a_scene_without_sensor_has_the_default_one() -> None:
    simulation = build_simulation({"map": SCENE["map"], "poses": SCENE["poses"]})
    assert simulation.sensor == RangeFinder(0.05, 2.0, 360, 0.5)


def changed(**keys: Any) -> str:
    return json.dumps({key: value for key, value in (SCENE | keys).items() if value is not None})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "is not valid JSON"),
        ("[]", "the scene is an object with map and poses"),
        (changed(map=None), "map is missing"),
        (changed(poses=[]), "at least one pose"),
        (changed(walls=[]), "the scene has no 'walls'"),
        (changed(map=SCENE["map"] | {"cell": 0}), "more than 0, not 0"),
        (changed(map=SCENE["map"] | {"rows": 1.5}), "map rows is a whole number"),
        (changed(map=SCENE["map"] | {"rows": 10**9}), "is too large"),
        (changed(map=SCENE["map"] | {"origin": [0]}), "map origin takes positions as"),
        (changed(sensor={"sigma": -0.1}), "a number above 0, not -0.1"),
        (changed(sensor={"range": "far"}), "sensor range is a finite number"),
        (changed(sensor={"rnage": 1}), "sensor has no 'rnage'"),
        (changed(sensor={"range": True}), "sensor range is a finite number"),
        (changed(circles=[{"center": [0, 0], "radius": -1}]), "circle 1 has a radius of -1"),
        (changed(circles=[[0, 0, 1]]), "circle 1 is an object with center and radius"),
        (changed(polygons=[[[0, 0], [2, 2], [2, 0], [0, 2]]]), "polygon 1 crosses or touches itself"),
        (changed(polygons=[[0, 0, 1]]), "polygon 1 takes positions as"),
        (changed(poses=[{"at": [0, 0.1]}]), "pose 1 at .* stands inside something solid"),
        (changed(poses=[{"at": [0, 0], "yaw": 1}]), "pose 1 has no 'yaw'"),
        (changed().replace("0.4", "NaN"), "NaN is not a number"),
        (changed().replace("0.4", "1e999"), "is a finite number"),
        ('{"map": {}, "map": {}}', "'map' is there twice"),
    ],
)
def test_an_invalid_scene_is_refused_in_one_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "scene.json"
    path.write_text(text)
    with pytest.raises(SceneError, match=message) as caught:
        load_scene(path)
    assert "\n" not in str(caught.value) and str(path) in str(caught.value)


def test_a_missing_scene_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="there is no such file; name lens, circles or a JSON file"):
        load_scene(tmp_path / "none.json")
