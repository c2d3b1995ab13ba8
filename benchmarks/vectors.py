"""Vectorisation of a label image, compared with rasterio and shapely.

    python -m benchmarks.vectors SIDE ROUNDS

Adjacent, distorted cells of 26 x 26 pixels: 100 000 of them at a side of 8192.
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
    """Result of the measurement.

    Parameters
    ----------
    regions, parts, vertices : int
        Counts for the label image; a part is a connected part of a region, one polygon of rasterio.
    uavseg_s, one_thread_s, rasterio_s : float
        Medians of uavseg with all threads, of uavseg with one, and of `rasterio.features.shapes` with
        `shapely.geometry.shape`.
    identical : int
        Number of parts that are equal in both results.
    """

    regions: int
    parts: int
    vertices: int
    uavseg_s: float
    one_thread_s: float
    rasterio_s: float
    identical: int


def vectorised(side: int = SIDE, rounds: int = 5) -> Vectorised:
    """Measure in a child process, so that the caller needs little memory."""
    command = [sys.executable, "-m", "benchmarks.vectors", str(side), str(rounds)]
    output = subprocess.run(
        command, env=with_project(os.environ), check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    return Vectorised(**json.loads(output))


def label_image(side: int) -> Any:
    """The label image, a (side, side) uint32 array."""
    import numpy as np

    from benchmarks.data import TILE, Terrain

    across = int(np.ceil(side / CELL)) + 4
    labels = np.empty((side, side), np.uint32)
    for row in range(0, side, TILE):
        for col in range(0, side, TILE):
            terrain = Terrain(row, col)
            rows = np.arange(row, row + TILE)[:, None] + 4 * terrain.noise(24, 40) + 2 * terrain.noise(5, 41)
            cols = np.arange(col, col + TILE)[None, :] + 4 * terrain.noise(24, 42) + 2 * terrain.noise(5, 43)
            # Displacements beyond the edges of the image are clipped into the outermost cells.
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

    labels = np.unique(label_image(side), return_inverse=True)[1].reshape(side, side).astype(
        np.uint32
    ) + np.uint32(1)
    signed = labels.astype(np.int32)  # the widest type that rasterio accepts
    transform = Affine(0.5, 0, 5e5, 0, -0.5, 5e6)

    def uavseg_result(map: Any) -> Any:
        return np.asarray(LazyPolygons(trace(labels, map), transform))

    def rasterio_result() -> Any:
        return [
            (value, shapely.geometry.shape(shape))
            for shape, value in rasterio.features.shapes(signed, transform=transform)
        ]

    trace(labels[:64, :64])  # compiles or loads the kernels
    times: dict[str, list[float]] = {"uavseg": [], "one_thread": [], "rasterio": []}
    for _ in range(rounds):
        mine = _timed(times["uavseg"], lambda: uavseg_result(threads()))
        _timed(times["one_thread"], lambda: uavseg_result(serial))
        found = _timed(times["rasterio"], rasterio_result)
    values = np.array([value for value, _ in found], np.int64)
    other = np.array([shape for _, shape in found], object)
    parts, owners = shapely.get_parts(mine, return_index=True)
    medians = {f"{name}_s": statistics.median(taken) for name, taken in times.items()}
    vertices = int(shapely.get_num_coordinates(parts).sum())
    identical = _count_identical(parts, owners + 1, other, values)
    return Vectorised(len(mine), len(other), vertices, identical=identical, **medians)


def _timed(times: list[float], call: Callable[[], Any]) -> Any:
    start = time.perf_counter()
    found = call()
    times.append(time.perf_counter() - start)
    return found


def _count_identical(parts: Any, labels: Any, other: Any, values: Any) -> int:
    """Number of polygons of one result that equal one of the other, with the same label.

    Ours have a vertex on a straight side too, where three labels meet.
    """
    import numpy as np
    import shapely

    def ordered(shapes: Any, names: Any) -> Any:
        return shapes[np.lexsort([*shapely.bounds(shapes).T, shapely.area(shapes), names])]

    if len(parts) != len(other) or sorted(labels.tolist()) != sorted(values.tolist()):
        return 0
    return int(shapely.equals(ordered(parts, labels), ordered(np.asarray(other), values)).sum())


if __name__ == "__main__":
    from dataclasses import asdict

    print(json.dumps(asdict(_measured(int(sys.argv[1]), int(sys.argv[2])))))
