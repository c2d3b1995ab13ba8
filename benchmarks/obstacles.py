"""Obstacles that the states of maps lose: drawn maps of thin walls, poles and furniture, and real maps.

    python -m benchmarks.obstacles

An obstacle is an 8-connected component of occupied cells: of the drawing, or of a real map's own values. It
is lost where none of its cells is classified as occupied.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any

from benchmarks.accuracy import MAPS, REAL, classified, opened_map, overlaps
from benchmarks.competitors import with_project

SIDE = 480  # cells of a drawn map
SIGMAS = (0.0, 0.03, 0.08)  # standard deviation of the noise of v; 0: a trinary map
_V = {1: 0.1, 2: 0.5, 3: 0.9}  # of drawn maps with noise
_RUNS = 5


@dataclass(frozen=True, slots=True)
class Kept:
    """What one map keeps with the method of the paper, and with the default method.

    Parameters
    ----------
    map : str
    obstacles : int
    lost : (int, int)
        Obstacles without an occupied cell.
    cells : (float, float)
        Share of the cells of obstacles that are occupied.
    noise : (int, int)
        Occupied components that touch no obstacle.
    free : (float, float)
        Intersection over union of the free cells with the drawing.
    cpu_ms : (float, float)
        Processor time, the least of five runs in turn.
    """

    map: str
    obstacles: int
    lost: tuple[int, int]
    cells: tuple[float, float]
    noise: tuple[int, int]
    free: tuple[float, float]
    cpu_ms: tuple[float, float]


def obstacles() -> list[Kept]:
    """All rows, computed in a child process so that the caller needs little memory."""
    command = [sys.executable, "-m", "benchmarks.obstacles"]
    output = subprocess.run(
        command, env=with_project(os.environ), check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    return [Kept(title, count, *map(tuple, pairs)) for title, count, *pairs in json.loads(output)]


def measured(folder: Path = MAPS, runs: int = _RUNS) -> Iterator[Kept]:
    """Real maps, then drawn ones."""
    from uavseg.raster.grid.tiling import Window

    for name in REAL:
        if (folder / name).exists():
            dataset, stretch = opened_map(folder / name)
            values, _ = dataset.read(Window(0, 0, *dataset.geobox.shape))
            truth = 2 + (values[0] > 0.502).astype(int) - (values[0] < 0.498)
            yield _kept(Path(name).stem, (dataset, stretch), truth, runs)
    for drawing in DRAWINGS:
        for sigma in SIGMAS:
            title = f"{drawing}, {'trinary' if not sigma else f'noise {sigma:g}'}"
            truth = DRAWINGS[drawing]()
            yield _kept(title, _source(values_of(truth, sigma)), truth, runs)


def values_of(truth: Any, sigma: float, seed: int = 0) -> Any:
    """v of the states of a drawing: trinary, or 0.1, 0.5 and 0.9 with normal noise."""
    import numpy as np

    if not sigma:
        return np.choose(truth - 1, [0, 0.5, 1]).astype(np.float32)
    noise = np.random.default_rng(seed).normal(0, sigma, truth.shape)
    return np.clip(np.choose(truth - 1, list(_V.values())) + noise, 0, 1).astype(np.float32)


def _source(values: Any) -> Any:
    from affine import Affine

    from uavseg.occupancy.map_file import stretch_of
    from uavseg.raster.grid.geobox import GeoBox
    from uavseg.raster.read.dataset import Dataset

    dataset = Dataset.of_values(values, GeoBox(values.shape, Affine.scale(0.05, -0.05), None), "drawn")
    return dataset, stretch_of(dataset)


def _kept(title: str, source: Any, truth: Any, runs: int) -> Kept:
    import numpy as np
    from scipy import ndimage

    eight = np.ones((3, 3))
    labels, count = ndimage.label(truth == 3, eight)
    lost, cells, noise, free = [], [], [], []
    dataset, stretch = source
    for method in ("paper", "adaptive"):
        states = classified(dataset, stretch, method, "scan").image.read()
        kept = np.unique(labels[(states == 3) & (truth == 3)])
        lost.append(count - len(kept))
        cells.append(float((states[truth == 3] == 3).mean()))
        parts, number = ndimage.label(states == 3, eight)
        near = ndimage.binary_dilation(truth == 3, eight)
        noise.append(number - len(np.setdiff1d(np.unique(parts[near]), [0])))
        free.append(overlaps(states, truth)[0])
    pairs: dict[str, Any] = {"lost": lost, "cells": cells, "noise": noise, "free": free}
    found = {name: tuple(pair) for name, pair in pairs.items()}
    return Kept(map=title, obstacles=count, **found, cpu_ms=_cpu_ms(source, runs))


def _cpu_ms(source: Any, runs: int) -> tuple[float, float]:
    """Processor time with both methods, in turn."""
    dataset, stretch = source
    least = [float("inf")] * 2
    for _ in range(runs):
        for k, method in enumerate(("paper", "adaptive")):
            begun = time.process_time()
            classified(dataset, stretch, method, "scan")
            least[k] = min(least[k], 1e3 * (time.process_time() - begun))
    return least[0], least[1]


def walls(width: int) -> Any:
    """Walls of a width at twelve angles, in free space with unknown around it."""
    import numpy as np

    truth = _hall()
    row, col = np.indices(truth.shape)
    for k in range(12):
        middle = 80 + 160 * (k % 3), 75 + 110 * (k // 3)
        angle = np.pi * (k + 0.3) / 12
        across = (row - middle[1]) * np.cos(angle) + (col - middle[0]) * np.sin(angle)
        along = (col - middle[0]) * np.cos(angle) - (row - middle[1]) * np.sin(angle)
        truth[(across >= -width / 2) & (across < width / 2) & (np.abs(along) < 45)] = 3
    return truth


def poles() -> Any:
    """Square poles and discs of 2 to 6 cells, everywhere on the grid of blocks."""
    import numpy as np

    truth = _hall()
    row, col = np.indices(truth.shape)
    for k in range(100):
        y, x, size = 45 + 43 * (k // 10), 45 + 43 * (k % 10), 2 + k % 5
        round_one = (row - y) ** 2 + (col - x) ** 2 <= (size / 2) ** 2 + 0.5
        square = (row >= y) & (row < y + size) & (col >= x) & (col < x + size)
        truth[round_one if k % 2 else square] = 3
    return truth


def grid() -> Any:
    """A grid of lines of one cell, and racks of two."""
    truth = _hall()
    for k in range(40, 230, 27):
        truth[k, 40:240] = truth[40:240, k] = 3
    for k in range(260, 440, 20):
        truth[k : k + 2, 60:420] = 3
    return truth


def furniture() -> Any:
    """Tables as four legs of two cells, hollow boxes, chairs of three cells, shelves along walls."""
    import numpy as np

    truth = _hall()
    rng = np.random.default_rng(1)
    for k in range(64):
        y, x = 45 + 52 * (k // 8), 45 + 52 * (k % 8)
        height, width = rng.integers(8, 26, 2)
        if k % 3 == 0:
            for i in (0, height):
                for j in (0, width):
                    truth[y + i : y + i + 2, x + j : x + j + 2] = 3
        elif k % 3 == 1:
            truth[y : y + height, x : x + width] = 3
            truth[y + 1 : y + height - 1, x + 1 : x + width - 1] = 2
        else:
            truth[y, x : x + 3] = truth[y + 6 : y + 9, x] = 3
    truth[40:440, 36:39] = 3
    return truth


def rooms() -> Any:
    """Rooms with walls of one and two cells and doors of 18 cells, with a tilted one among them."""
    import numpy as np

    truth = _hall()
    for k in range(1, 5):
        at, width = 30 + 84 * k, 1 + k % 2
        truth[at : at + width, 30:450] = truth[30:450, at : at + width] = 3
        for m in range(5):
            door = 60 + 84 * m
            truth[at : at + width, door : door + 18] = truth[door : door + 18, at : at + width] = 1
    row, col = np.indices(truth.shape)
    across = np.abs(0.9 * row - 0.44 * col - 130)
    truth[(across < 0.5) & (truth == 1) & (col > 60) & (col < 400) & (col % 60 > 12)] = 3
    return truth


def arcs() -> Any:
    """Rings of one cell, and arcs of two."""
    import numpy as np

    truth = _hall()
    row, col = np.indices(truth.shape)
    for k in range(16):
        y, x, radius = 85 + 103 * (k // 4), 85 + 103 * (k % 4), 12 + 2.2 * k
        distance = np.hypot(row - y, col - x)
        part = np.ones(truth.shape, bool) if k % 2 else np.arctan2(row - y, col - x) > -1
        truth[(np.abs(distance - radius) < (0.5, 1.0)[k % 2]) & part] = 3
    return truth


def _hall() -> Any:
    """Free space, unknown outside."""
    import numpy as np

    truth = np.full((SIDE, SIDE), 2)
    truth[30:450, 30:450] = 1
    return truth


DRAWINGS: dict[str, Callable[[], Any]] = {
    "walls of one cell": lambda: walls(1),
    "walls of two cells": lambda: walls(2),
    "walls of three cells": lambda: walls(3),
    "poles": poles,
    "grid and racks": grid,
    "furniture": furniture,
    "rooms with doors": rooms,
    "rings and arcs": arcs,
}


if __name__ == "__main__":
    print(json.dumps([astuple(row) for row in measured()]))
