"""Scenes to simulate: the two of the paper, and JSON files of others.

For both the paper gives the size of the map (320 x 320 cells), the number of scans, their noise, a range of 2
m and beams 0.5 degrees apart. It shows scanned triangles with the sensor at a vertex, and cells between beams
that no beam crosses. Beams 0.5 degrees apart are 17 mm apart at 2 m, so cells are 10 mm here. The positions
of the objects and the sensor are chosen to look like the figures.

In a file all lengths are in metres, all angles in degrees counterclockwise from the x axis; y points up.
``map`` and ``poses`` are required, the other keys are optional, and unknown keys are refused.

.. code-block:: json

    {
      "map": {"rows": 320, "cols": 320, "cell": 0.01, "origin": [0, 0]},
      "polygons": [[[1.0, 1.0], [1.5, 1.0], [1.2, 1.4]]],
      "circles": [{"center": [2.2, 2.0], "radius": 0.3}],
      "sensor": {"sigma": 0.05, "range": 2.0, "fov": 60, "step": 0.5},
      "poses": [{"at": [0.2, 0.2], "heading": 45}]
    }

``origin`` is the lower left corner of the map (default [0, 0]); ``heading`` is the direction of the middle of
the field of view (default 0). The defaults of the sensor are σ = 0.05, a range of 2, a field of view of 360
degrees and beams 0.5 degrees apart.
"""

import json
import math
import os
from collections.abc import Callable, Sequence
from typing import Any, NoReturn

import numpy as np

from uavseg.arrays import Floats
from uavseg.errors import RasterError, SceneError, caused_errors, named_errors
from uavseg.inputs import parse_json, read_bytes
from uavseg.occupancy.mapping.scan import Pose
from uavseg.occupancy.simulation.simulate import RangeFinder, Scene, Simulation
from uavseg.plain_text import joined, shown
from uavseg.raster.grid.geobox import GeoBox, local_geobox

_MAP_SHAPE = (320, 320)
_CELL_M = 0.01
_MIDDLE_M = 1.6
_ARC_CORNERS = 65
_MAX_SCENE_CELLS = 1 << 28
_SENSOR = {"sigma": "sigma_m", "range": "max_range_m", "fov": "fov_deg", "step": "step_deg"}


def lens() -> Simulation:
    """Make the scene of a divergent lens, thin in the middle, seen in five views with σ = 5 cm."""
    scene = Scene(polygons=[lens_outline(_MIDDLE_M, _MIDDLE_M, height=1.1, edge=1.0, waist=0.5)])
    return _views_around(scene, views=5, distance_m=1.5, first_deg=90.0, fov_deg=75.0, sigma_m=0.05)


def circles() -> Simulation:
    """Make the scene of two circles side by side, seen in eight views with σ = 3 cm."""
    scene = Scene(circles=[(_MIDDLE_M - 0.4, _MIDDLE_M, 0.35), (_MIDDLE_M + 0.4, _MIDDLE_M, 0.35)])
    return _views_around(scene, views=8, distance_m=1.4, first_deg=22.5, fov_deg=60.0, sigma_m=0.03)


BUILT_IN_SCENES: dict[str, Callable[[], Simulation]] = {"lens": lens, "circles": circles}


def lens_outline(x: float, y: float, height: float, edge: float, waist: float) -> Floats:
    """Compute the corners (130, 2) of a lens with two concave sides, counterclockwise.

    The centre and all lengths are in metres; `edge` is the width at the top and bottom, `waist` in the
    middle.
    """
    sag = (edge - waist) / 2
    radius = (sag**2 + (height / 2) ** 2) / (2 * sag)
    half_angle = math.asin(height / 2 / radius)
    turned = np.linspace(-half_angle, half_angle, _ARC_CORNERS)
    right = np.column_stack([waist / 2 + radius * (1 - np.cos(turned)), radius * np.sin(turned)])
    left = -right  # mirrored in both axes, so the order continues
    return np.asarray(np.vstack([right, left]) + np.array([x, y]))


def _views_around(
    scene: Scene, views: int, distance_m: float, first_deg: float, fov_deg: float, sigma_m: float
) -> Simulation:
    """Place poses on a circle around the middle of the map, facing it."""
    angles = [first_deg + 360.0 * view / views for view in range(views)]
    poses = [
        Pose(
            _MIDDLE_M + distance_m * math.cos(math.radians(angle)),
            _MIDDLE_M + distance_m * math.sin(math.radians(angle)),
            heading_rad=math.radians((angle + 180.0) % 360.0),
        )
        for angle in angles
    ]
    sensor = RangeFinder(sigma_m=sigma_m, max_range_m=2.0, fov_deg=fov_deg, step_deg=0.5)
    geobox = local_geobox(_MAP_SHAPE, _CELL_M, (0.0, 0.0))
    return Simulation(scene=scene, sensor=sensor, poses=poses, geobox=geobox)


def load_scene(path: str | os.PathLike[str]) -> Simulation:
    """Read a simulation from a JSON file; the module's docstring describes the format."""
    with named_errors(os.fspath(path), SceneError):
        return build_simulation(_read(path))


def build_simulation(content: Any) -> Simulation:
    """Make a simulation from the contents of a scene file, as `json` reads them."""
    parts = _object("the scene", content, ("map", "poses"), ("polygons", "circles", "sensor"))
    polygons = _list("polygons", parts.get("polygons", []))
    circles = _list("circles", parts.get("circles", []))
    scene = Scene(
        polygons=[
            [_pair(f"polygon {n}", xy) for xy in _list(f"polygon {n}", ring)]
            for n, ring in enumerate(polygons, start=1)
        ],
        circles=[_circle(f"circle {n}", circle) for n, circle in enumerate(circles, start=1)],
    )
    numbers = _object("sensor", parts.get("sensor", {}), (), tuple(_SENSOR))
    sensor = RangeFinder(
        **{_SENSOR[key]: _finite_number(f"sensor {key}", value) for key, value in numbers.items()}
    )
    poses = [_pose(f"pose {n}", pose) for n, pose in enumerate(_list("poses", parts["poses"]), start=1)]
    return Simulation(scene=scene, sensor=sensor, poses=poses, geobox=_cells(parts["map"]))


def _read(path: str | os.PathLike[str]) -> Any:
    if not os.path.exists(path):  # noqa: PTH110 - false for a name that is too long
        raise SceneError("there is no such file; name lens, circles or a JSON file of a scene")
    with caused_errors("it cannot be read as text", SceneError, UnicodeDecodeError):
        text = read_bytes(path, SceneError).decode()
    with caused_errors("it is not valid JSON", SceneError, ValueError, RecursionError):
        return parse_json(text, parse_constant=_reject_constant, object_pairs_hook=_unique_keys)


def _reject_constant(text: str) -> NoReturn:
    raise SceneError(f"{text} is not a number that a scene can have")


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    named = dict(pairs)
    if len(named) < len(pairs):
        names = [name for name, _ in pairs]
        raise SceneError(f"the key {next(name for name in names if names.count(name) > 1)!r} is there twice")
    return named


def _cells(content: Any) -> GeoBox:
    numbers = _object("map", content, ("rows", "cols", "cell"), ("origin",))
    rows, cols = (_count(f"map {key}", numbers[key]) for key in ("rows", "cols"))
    cell = _finite_number("map cell", numbers["cell"])
    if not cell > 0:
        raise SceneError(f"map cell is the side of a cell in metres, more than 0, not {cell:g}")
    if rows * cols > _MAX_SCENE_CELLS:
        raise SceneError(
            f"a map of {rows} x {cols} cells is too large; at most {_MAX_SCENE_CELLS} can be simulated"
        )
    origin = _pair("map origin", numbers.get("origin", [0, 0]))
    with named_errors("map", RasterError, SceneError):
        return local_geobox((rows, cols), cell, origin)


def _pose(name: str, content: Any) -> Pose:
    pose = _object(name, content, ("at",), ("heading",))
    heading_deg = _finite_number(f"{name} heading", pose.get("heading", 0))
    return Pose(*_pair(f"{name} at", pose["at"]), heading_rad=math.radians(heading_deg))


def _circle(name: str, content: Any) -> tuple[float, float, float]:
    circle = _object(name, content, ("center", "radius"), ())
    return (*_pair(f"{name} center", circle["center"]), _finite_number(f"{name} radius", circle["radius"]))


def _object(name: str, value: Any, required: Sequence[str], optional: Sequence[str]) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise SceneError(f"{name} is an object with {joined(required or optional)}, not {_as_json(value)}")
    for key in required:
        if key not in value:
            raise SceneError(f"{name} needs {joined(required)}; {key} is missing")
    for key in value:
        if key not in (*required, *optional):
            raise SceneError(f"{name} has no {key!r}; it has {joined((*required, *optional))}")
    return value


def _list(name: str, value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise SceneError(f"{name} is a list, not {_as_json(value)}")
    return value


def _pair(name: str, value: Any) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise SceneError(f"{name} takes positions as [x, y], not {_as_json(value)}")
    return _finite_number(name, value[0]), _finite_number(name, value[1])


def _finite_number(name: str, value: Any) -> float:
    try:
        if not isinstance(value, bool) and isinstance(value, int | float) and math.isfinite(value):
            return float(value)
    except OverflowError:  # a whole number that no float can hold
        pass
    raise SceneError(f"{name} is a finite number, not {_as_json(value)}")


def _count(name: str, value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise SceneError(f"{name} is a whole number of at least 1, not {_as_json(value)}")
    return value


def _as_json(value: Any) -> str:
    try:
        return shown(json.dumps(value), quoted=False)
    except ValueError:  # a number of thousands of digits
        return shown(value)
