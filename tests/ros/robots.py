"""Drawn maps and regions for tests of the programs of the ROS package, and a plain check of distances."""

import json
from pathlib import Path
from typing import Any

import click
import numpy as np
import shapely
from click.testing import CliRunner, Result
from numpy.typing import NDArray
from uavseg_ros.programs import Program

from tests.ros.messages import room
from tests.ros.test_maps import saved

SIDE = 0.05
ORIGIN = (0.0, 0.0, 0.0)


def rooms() -> NDArray[np.int8]:
    """Two rooms with a door between, in 6.4 x 3.2 m; poles, and a closed closet. The lowest row is first."""
    cells = room()
    cells[:, 4] = cells[0] = cells[-1] = cells[:, -1] = 100
    cells[20:22, 40:42] = cells[30:32, 20:22] = 100
    cells[40:60, 100:102] = 100
    cells[4:20, 110] = cells[20, 110:] = cells[4, 110:] = 100  # closed on all sides
    return cells


def box(west: float, south: float, east: float, north: float) -> list[list[float]]:
    return [[west, south], [east, south], [east, north], [west, north], [west, south]]


REGIONS = {
    1: box(0.4, 0.4, 1.2, 1.2),
    2: box(0.4, 2.2, 2.0, 3.0),
    3: box(2.2, 0.3, 3.2, 1.5),
    4: box(4.2, 0.3, 5.2, 1.4),
    7: box(5.3, 1.8, 6.2, 2.9),
}
CLOSET = box(5.6, 0.3, 6.2, 0.9)


def regions_file(folder: Path, rings: dict[int, Any], move: Any = None, **named: str) -> Path:
    """Write rings by id as GeoJSON, moved by a function of positions (n, 2), and names, as r1="dock"."""
    features = []
    for number, ring in rings.items():
        name = {"name": named[f"r{number}"]} if f"r{number}" in named else {}
        positions = np.array(ring) if move is None else move(np.array(ring))
        geometry = {"type": "Polygon", "coordinates": [positions.tolist()]}
        features.append({"type": "Feature", "properties": {"id": number} | name, "geometry": geometry})
    path = folder / "regions.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


def map_file(folder: Path, cells: NDArray[np.int8], origin: tuple[float, float, float] = ORIGIN) -> Path:
    return saved(folder, cells, SIDE, origin)


def placed(origin: tuple[float, float, float]) -> Any:
    """A function that moves positions (n, 2) as the origin of a map moves what is on it."""
    x, y, yaw = origin
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    return lambda xy: np.asarray(xy) @ turn.T + (x, y)


def invoke(command: click.Command, *words: Any) -> Result:
    """Run a program as the process does, in this process."""
    return CliRunner().invoke(Program(command), [str(command.name), *map(str, words)])


def away(lines: NDArray[np.float64], cells: NDArray[np.int8], side: float = SIDE) -> float:
    """The least distance in metres of samples of lines (n, 2, 2) from squares that are not free, (x, y).

    The lower left corner of the map, whose lowest row comes first, is at 0, 0; outside of it nothing is free.
    """
    walls = np.pad(cells != 0, 1, constant_values=True)
    inner = walls.copy()  # squares with only walls around are not the nearest
    for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
        inner &= np.roll(walls, step, axis)
    rows, cols = np.nonzero(walls & ~inner)
    centres = (np.stack([cols, rows], axis=1) - 0.5) * side
    least = np.inf
    for start, end in lines:
        count = int(np.hypot(*(end - start)) / side * 4) + 2
        places = start + np.linspace(0, 1, count)[:, None] * (end - start)
        gaps = np.maximum(np.abs(places[:, None] - centres[None]) - side / 2, 0)
        least = min(least, float(np.hypot(*gaps.transpose(2, 0, 1)).min()))
    return least


def polygon(ring: Any) -> shapely.Polygon:
    return shapely.Polygon(ring)
