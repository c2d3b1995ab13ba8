"""A label image to polygons, beside rasterio and shapely.

    python -m benchmarks.vectors SIDE ROUNDS

Bent cells of 26 x 26 pixels, of which neighbours share their borders: 100 000 of them at a side of 8192.
"""

import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from benchmarks.competitors import with_project

SIDE = 8192
CELL = 25.92  # pixels; 316 cells across 8192


@dataclass(frozen=True, slots=True)
class Vectorised:
    """What was measured.

    Parameters
    ----------
    regions, pieces, vertices : int
        Of the label image; pieces are what rasterio makes a polygon of.
    ours_s, alone_s, theirs_s : float
        Medians: with all threads, with one, and of `rasterio.features.shapes` and `shapely.geometry.shape`.
    equal : int
        Pieces whose polygons have the same rings on both sides.
    """

    regions: int
    pieces: int
    vertices: int
    ours_s: float
    alone_s: float
    theirs_s: float
    equal: int


def vectorised(side: int = SIDE, rounds: int = 5) -> Vectorised:
    """Measure in a process of its own, so that the caller stays small."""
    command = [sys.executable, "-m", "benchmarks.vectors", str(side), str(rounds)]
    told = subprocess.run(
        command, env=with_project(os.environ), check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    return Vectorised(**json.loads(told))


def cells(side: int) -> Any:
    """The label image, a (side, side) uint32 array."""
    import numpy as np

    from benchmarks.data import TILE, Ground

    across = int(np.ceil(side / CELL)) + 4
    labels = np.empty((side, side), np.uint32)
    for row in range(0, side, TILE):
        for col in range(0, side, TILE):
            ground = Ground(row, col)
            rows = np.arange(row, row + TILE)[:, None] + 4 * ground.noise(24, 40) + 2 * ground.noise(5, 41)
            cols = np.arange(col, col + TILE)[None, :] + 4 * ground.noise(24, 42) + 2 * ground.noise(5, 43)
            # Cells at the edges of the picture swallow what is bent beyond them.
            down = np.clip(rows / CELL, 0, side / CELL - 0.5).astype(np.uint32)
            right = np.clip(cols / CELL, 0, side / CELL - 0.5).astype(np.uint32)
            names = down * np.uint32(across) + right + np.uint32(1)
            part = labels[row : row + TILE, col : col + TILE]
            part[:] = names[: part.shape[0], : part.shape[1]]
    return labels


def _measured(side: int, rounds: int) -> Vectorised:
    import numpy as np
    import rasterio.features
    import shapely
    import shapely.geometry
    from affine import Affine

    from uavseg.execution.executors import serial, threads
    from uavseg.regions.outline.trace import trace
    from uavseg.regions.shapes import LazyPolygons

    labels = np.unique(cells(side), return_inverse=True)[1].reshape(side, side).astype(np.uint32) + np.uint32(
        1
    )
    signed = labels.astype(np.int32)  # the widest that rasterio takes
    way = Affine(0.5, 0, 5e5, 0, -0.5, 5e6)

    def ours(map: Any) -> Any:
        return np.asarray(LazyPolygons(trace(labels, map), way))

    def theirs() -> Any:
        return [
            (value, shapely.geometry.shape(shape))
            for shape, value in rasterio.features.shapes(signed, transform=way)
        ]

    trace(labels[:64, :64])  # compiled, or loaded
    times: dict[str, list[float]] = {"ours": [], "alone": [], "theirs": []}
    for _ in range(rounds):
        mine = _timed(times["ours"], lambda: ours(threads()))
        _timed(times["alone"], lambda: ours(serial))
        found = _timed(times["theirs"], theirs)
    values = np.array([value for value, _ in found], np.int64)
    other = np.array([shape for _, shape in found], object)
    parts, owners = shapely.get_parts(mine, return_index=True)
    medians = {f"{name}_s": statistics.median(taken) for name, taken in times.items()}
    vertices = int(shapely.get_num_coordinates(parts).sum())
    equal = _equal(parts, owners + 1, other, values)
    return Vectorised(len(mine), len(other), vertices, equal=equal, **medians)


def _timed(times: list[float], call: Callable[[], Any]) -> Any:
    start = time.perf_counter()
    found = call()
    times.append(time.perf_counter() - start)
    return found


def _equal(parts: Any, labels: Any, other: Any, values: Any) -> int:
    """How many polygons of one side are on the other, with the same label and the same rings."""
    import shapely

    def named(shapes: Any, names: Any) -> set[tuple[int, bytes]]:
        plain = shapely.to_wkb(shapely.normalize(shapes))
        return set(zip(names.tolist(), plain.tolist(), strict=True))

    return len(named(parts, labels) & named(other, values))


if __name__ == "__main__":
    from dataclasses import asdict

    print(json.dumps(asdict(_measured(int(sys.argv[1]), int(sys.argv[2])))))
