"""Procedural aerial scene: fields, hedges, roads, forest with clearings, and water.

    python -m benchmarks.data SIDE KIND PATH

The scene is a function of row and column and has no bounds: a smaller raster is the corner of a larger one.
It is drawn and written tile by tile, so memory does not grow with its size.
"""

import os
import sys
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from numpy.typing import NDArray
from rasterio.transform import from_origin
from rasterio.windows import Window

from benchmarks.scenes import Scene

Plane = NDArray[np.float32]

TILE = 512
SEED = 1
PIXEL_M = 0.5
GRAIN = 0.04  # standard deviation of the sensor noise
FIELD = (112, 144)  # rows and columns of a field, before the distortion
HEDGE, ROAD = 6, 10  # widths in pixels
HEDGES_PER_ROAD = 4


def write(scene: Scene, path: Path) -> None:
    """Write a scene as a tiled, deflated GeoTIFF, 0.5 m, UTM 33N; atomic: the complete file or none."""
    profile = {
        "driver": "GTiff",
        "height": scene.side,
        "width": scene.side,
        "count": scene.bands,
        "dtype": scene.dtype,
        "crs": "EPSG:32633",
        "transform": from_origin(500_000, 5_000_000, PIXEL_M, PIXEL_M),
        "tiled": True,
        "blockxsize": TILE,
        "blockysize": TILE,
        "compress": "deflate",
        "num_threads": "all_cpus",
        "bigtiff": "if_safer",
    }
    if scene.bands == 3:
        profile["photometric"] = "rgb"
    part = path.with_name(f".{path.name}")
    corners = [(row, col) for row in range(0, scene.side, TILE) for col in range(0, scene.side, TILE)]
    with rasterio.Env(GDAL_CACHEMAX=64), rasterio.open(part, "w", **profile) as file:
        for (row, col), tile in zip(corners, _drawn(scene, corners), strict=True):
            height, width = min(TILE, scene.side - row), min(TILE, scene.side - col)
            file.write(tile[:, :height, :width], window=Window(col, row, width, height))
    part.replace(path)


def _drawn(scene: Scene, corners: list[tuple[int, int]]) -> Iterator[NDArray[Any]]:
    """The tiles in order, drawn by a few threads with a bounded queue."""
    workers = os.cpu_count() or 1
    with ThreadPoolExecutor(workers) as pool:
        pending: deque[Future[NDArray[Any]]] = deque()
        for corner in corners:
            pending.append(pool.submit(draw, scene, *corner))
            if len(pending) > 2 * workers:
                yield pending.popleft().result()
        while pending:
            yield pending.popleft().result()


def draw(scene: Scene, row: int, col: int) -> NDArray[Any]:
    """One tile.

    Parameters
    ----------
    scene : Scene
    row, col : int
        Its upper-left pixel; multiples of 512.

    Returns
    -------
    tile : (bands, 512, 512) array of the scene's type
    """
    terrain = Terrain(row, col)
    tone, tint = terrain.scenery()
    rng = np.random.default_rng((SEED, row // TILE, col // TILE))
    # Red rises and green falls with the tint, so that the luminance does not change.
    shifts = [0.0] if scene.bands == 1 else [0.06, -0.06 * 0.2126 / 0.7152, 0.0]
    bands = np.empty((scene.bands, TILE, TILE), scene.dtype)
    for band, shift in zip(bands, shifts, strict=True):
        seen = tone + np.float32(shift) * tint
        seen += np.float32(GRAIN) * rng.standard_normal(tone.shape, np.float32)
        np.clip(seen, 0, 1, out=seen)
        band[:] = seen if scene.dtype == "float32" else np.rint(seen * np.float32(scene.white))
    return bands


@dataclass(frozen=True, slots=True)
class Terrain:
    """The terrain of one tile."""

    row: int
    col: int

    def scenery(self) -> tuple[Plane, Plane]:
        """Brightness of each pixel before noise, 0 to 1, and tint, from -1 (green) to 1 (red)."""
        tone, tint = self.farmland()
        tone = np.where(self.noise(26, 14) > 0.78, np.float32(0.72), tone)  # bare patches and yards
        wooded = self.noise(384, 1) + np.float32(0.5) * self.noise(96, 2)
        clearing = self.noise(80, 3) > 0.55
        crowns = np.float32(0.33) + np.float32(0.08) * self.noise(7, 4) + np.float32(0.05) * self.noise(3, 5)
        forest = (wooded > 0.3) & ~clearing
        water = self.noise(900, 6) + np.float32(0.15) * self.noise(60, 7) < -0.5
        tone = np.where(water, np.float32(0.14), np.where(forest, crowns, tone))
        tint = np.where(water | forest, np.float32(-1), tint)
        tone += np.float32(0.02) * self.noise(2048, 8)
        return tone, tint

    def farmland(self) -> tuple[Plane, Plane]:
        """Brightness and tint of distorted fields, most of them striped, with hedges and a few roads."""
        rows = np.arange(self.row, self.row + TILE, dtype=np.float32)[:, None] + self.bend(20)
        cols = np.arange(self.col, self.col + TILE, dtype=np.float32)[None, :] + self.bend(30)
        field_row, field_col = np.floor(rows / FIELD[0]), np.floor(cols / FIELD[1])
        tones, stripes = self.fields(field_row, field_col)
        across = np.where(stripes > 0, rows, cols) % np.float32(7)
        tone = tones + np.abs(stripes) * (np.abs(across - np.float32(3.5)) - np.float32(1.75))
        tint = np.where(tones > 0.5, np.float32(1), np.float32(-0.5))
        to_edge = np.minimum(rows - field_row * FIELD[0], cols - field_col * FIELD[1])
        along_row = rows - np.floor(field_row / HEDGES_PER_ROAD) * HEDGES_PER_ROAD * FIELD[0]
        along_col = cols - np.floor(field_col / HEDGES_PER_ROAD) * HEDGES_PER_ROAD * FIELD[1]
        tone = np.where(to_edge < HEDGE, np.float32(0.36), tone)
        tone = np.where(np.minimum(along_row, along_col) < ROAD, np.float32(0.47), tone)
        return tone, tint

    def bend(self, salt: int) -> Plane:
        """Displacement of each pixel, in pixels: large at long wavelengths, small at short ones."""
        bent: Plane = 60 * self.noise(256, salt) + 6 * self.noise(24, salt + 1) + 3 * self.noise(7, salt + 2)
        return bent

    def fields(self, field_row: Plane, field_col: Plane) -> tuple[Plane, Plane]:
        """Brightness of each pixel's field, and the strength of its stripes (negative: along columns)."""
        first_row, first_col = int(field_row.min()), int(field_col.min())
        rows = np.arange(first_row, int(field_row.max()) + 1)
        cols = np.arange(first_col, int(field_col.max()) + 1)
        kind, shade = lattice_random(rows, cols, 11), lattice_random(rows, cols, 12)
        tones = np.where(kind < 0.5, 0.28 + 0.18 * shade, 0.62 + 0.18 * shade)  # crops; stubble and soil
        tones = np.where(kind > 0.93, 0.48 + 0.14 * shade, tones).astype(np.float32)  # neither
        stripes = (0.02 * (lattice_random(rows, cols, 13) - 0.5)).astype(np.float32)
        place = field_row.astype(np.int32) - first_row, field_col.astype(np.int32) - first_col
        return tones[place], stripes[place]

    def noise(self, step: int, salt: int) -> Plane:
        """Value noise: random numbers in -1..1 at lattice points `step` pixels apart, interpolated."""
        rows, above, down = _lattice(self.row, step)
        cols, before, along = _lattice(self.col, step)
        points = (2 * lattice_random(rows, cols, salt) - 1).astype(np.float32)
        lines = points[above] + down[:, None] * (points[above + 1] - points[above])
        left = lines.take(before, axis=1)
        return left + along * (lines.take(before + 1, axis=1) - left)


def lattice_random(rows: NDArray[np.int64], cols: NDArray[np.int64], salt: int) -> NDArray[np.float64]:
    """Reproducible pseudo-random number in 0..1 for each lattice point (an integer hash).

    Parameters
    ----------
    rows : (m,) int array
    cols : (n,) int array
    salt : int
        Selects the sequence.

    Returns
    -------
    numbers : (m, n) float64 array
    """
    word = rows.astype(np.uint64)[:, None] * np.uint64(0x9E3779B97F4A7C15)
    word = word + cols.astype(np.uint64)[None, :] * np.uint64(0xC2B2AE3D27D4EB4F)
    word = word + np.uint64((SEED * 1000 + salt) * 0x165667B19E3779F9 % (1 << 64))
    for shift in (31, 29):  # mix the bits
        word = (word ^ (word >> np.uint64(shift))) * np.uint64(0xBF58476D1CE4E5B9)
    return (word >> np.uint64(11)) / float(1 << 53)


def _lattice(first: int, step: int) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float32]]:
    """Lattice points around a line of pixels, the last one before each pixel, and interpolation weights."""
    position = np.arange(first, first + TILE) / step
    before = np.floor(position).astype(np.int64)
    points = np.arange(before[0], before[-1] + 2)
    fraction = position - before
    return points, before - before[0], (fraction * fraction * (3 - 2 * fraction)).astype(np.float32)


if __name__ == "__main__":
    write(Scene(int(sys.argv[1]), sys.argv[2]), Path(sys.argv[3]))
