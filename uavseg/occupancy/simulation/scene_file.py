"""Scenes as JSON files.

All lengths are in metres, all angles in degrees counterclockwise from the x axis; y points up. ``map`` and
``poses`` are wanted, everything else may be left out; nothing else may be there.

.. code-block:: json

    {
      "map": {"rows": 320, "cols": 320, "cell": 0.01, "origin": [0, 0]},
      "polygons": [[[1.0, 1.0], [1.5, 1.0], [1.2, 1.4]]],
      "circles": [{"center": [2.2, 2.0], "radius": 0.3}],
      "sensor": {"sigma": 0.05, "range": 2.0, "fov": 60, "step": 0.5},
      "poses": [{"at": [0.2, 0.2], "heading": 45}]
    }

``origin`` is the lower left corner of the map ([0, 0]); ``heading`` is where the middle of the field of view
points (0). A sensor left out, or a part of it, has σ = 0.05, a range of 2, sees 360 degrees and has beams 0.5
degrees apart.
"""

import json
import math
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NoReturn

from uavseg.errors import SceneError
from uavseg.occupancy.mapping.scan import Pose
from uavseg.occupancy.simulation.range_finder import RangeFinder
from uavseg.occupancy.simulation.scene import Scene
from uavseg.occupancy.simulation.simulate import Simulation
from uavseg.raster.geobox import GeoBox, local_geobox

MAX_CELLS = 1 << 28
_SENSOR = {"sigma": "sigma_m", "range": "max_range_m", "fov": "fov_deg", "step": "step_deg"}


def load_scene(path: str | os.PathLike[str]) -> Simulation:
    """The simulation that a JSON file describes; see the head of this module.

    Raises
    ------
    SceneError
        If the file is missing, is no JSON, has other keys or values than described, or describes what cannot
        be.
    """
    name = os.fspath(path)
    try:
        return simulation_from(_read(path))
    except SceneError as error:
        raise SceneError(f"{name}: {error}") from error


def simulation_from(described: Any) -> Simulation:
    """The simulation that the contents of a scene file describe, as `json` reads them."""
    found = _object("the scene", described, ("map", "poses"), ("polygons", "circles", "sensor"))
    polygons = _list("polygons", found.get("polygons", []))
    circles = _list("circles", found.get("circles", []))
    scene = Scene(
        [
            [_pair(f"polygon {n}", xy) for xy in _list(f"polygon {n}", ring)]
            for n, ring in _numbered(polygons)
        ],
        [_circle(f"circle {n}", circle) for n, circle in _numbered(circles)],
    )
    given = _object("sensor", found.get("sensor", {}), (), tuple(_SENSOR))
    sensor = RangeFinder(**{_SENSOR[key]: _number(f"sensor {key}", value) for key, value in given.items()})
    poses = [_pose(f"pose {n}", pose) for n, pose in _numbered(_list("poses", found["poses"]))]
    return Simulation(scene, sensor, poses, _cells(found["map"]))


def _read(path: str | os.PathLike[str]) -> Any:
    try:
        text = Path(path).read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise SceneError("there is no such file; name lens, circles or a JSON file of a scene") from error
    except (OSError, UnicodeDecodeError) as error:
        raise SceneError(f"it cannot be read as text ({error})") from error
    try:
        return json.loads(text, parse_constant=_no_number, object_pairs_hook=_once)
    except (json.JSONDecodeError, RecursionError) as error:
        raise SceneError(f"it is no JSON ({error})") from error


def _no_number(word: str) -> NoReturn:
    raise SceneError(f"{word} is not a number that a scene can have")


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    named = dict(pairs)
    if len(named) < len(pairs):
        names = [name for name, _ in pairs]
        raise SceneError(f"the key {next(name for name in names if names.count(name) > 1)!r} is there twice")
    return named


def _cells(described: Any) -> GeoBox:
    found = _object("map", described, ("rows", "cols", "cell"), ("origin",))
    rows, cols = (_count(f"map {key}", found[key]) for key in ("rows", "cols"))
    cell = _number("map cell", found["cell"])
    if not cell > 0:
        raise SceneError(f"map cell is the side of a cell in metres, more than 0, not {cell:g}")
    if rows * cols > MAX_CELLS:
        raise SceneError(f"a map of {rows} x {cols} cells is too large; at most {MAX_CELLS} can be simulated")
    return local_geobox((rows, cols), cell, _pair("map origin", found.get("origin", [0, 0])))


def _pose(name: str, described: Any) -> Pose:
    found = _object(name, described, ("at",), ("heading",))
    return Pose(*_pair(f"{name} at", found["at"]), _number(f"{name} heading", found.get("heading", 0)))


def _circle(name: str, described: Any) -> tuple[float, float, float]:
    found = _object(name, described, ("center", "radius"), ())
    return (*_pair(f"{name} center", found["center"]), _number(f"{name} radius", found["radius"]))


def _object(name: str, value: Any, wanted: Sequence[str], allowed: Sequence[str]) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise SceneError(f"{name} is an object with {_and(wanted or allowed)}, not {_shown(value)}")
    for key in wanted:
        if key not in value:
            raise SceneError(f"{name} wants {_and(wanted)}; {key} is missing")
    for key in value:
        if key not in (*wanted, *allowed):
            raise SceneError(f"{name} has no {key!r}; it has {_and((*wanted, *allowed))}")
    return value


def _list(name: str, value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise SceneError(f"{name} is a list, not {_shown(value)}")
    return value


def _pair(name: str, value: Any) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise SceneError(f"{name} wants places as [x, y], not {_shown(value)}")
    return _number(name, value[0]), _number(name, value[1])


def _number(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise SceneError(f"{name} wants a finite number, not {_shown(value)}")
    return float(value)


def _count(name: str, value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise SceneError(f"{name} is a whole number of at least 1, not {_shown(value)}")
    return value


def _numbered(values: Iterable[Any]) -> Iterable[tuple[int, Any]]:
    return enumerate(values, start=1)


def _and(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def _shown(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
