"""The contents of a scene file."""

from typing import Any

SCENE: dict[str, Any] = {
    "map": {"rows": 40, "cols": 60, "cell": 0.1, "origin": [-1, -2]},
    "polygons": [[[2, 0], [3, 0], [2.5, 1]]],
    "circles": [{"center": [0, 0], "radius": 0.4}],
    "sensor": {"sigma": 0.02, "range": 3, "fov": 90, "step": 1},
    "poses": [{"at": [1.2, -0.5], "heading": 20}, {"at": [1, 1]}],
}
