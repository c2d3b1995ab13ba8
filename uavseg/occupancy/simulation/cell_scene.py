"""Ray casting in a scene whose solid parts are cells, such as the occupied ones of a map."""

from math import inf

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavseg._jit import kernel
from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.raster.grid.geobox import GeoBox


@dataclass(frozen=True, eq=False)
class CellScene:
    """Solid cells; nothing is solid outside of the map.

    Examples
    --------
    >>> from uavseg.raster.grid.geobox import local_geobox
    >>> scene = CellScene(np.array([[0, 0, 1]], bool), local_geobox((1, 3), 2.0, (0.0, 0.0)))
    >>> scene.cast(1.0, 1.0, np.array([0.0, np.pi]))
    array([ 3., inf])
    """

    solid: NDArray[np.bool_]  # (rows, cols)
    geobox: GeoBox

    def cast(self, x: float, y: float, angles: ArrayLike) -> Floats:
        """Cast rays from (x, y), as `Scene.cast`: metres to the first solid cell, infinite without one."""
        radians = np.asarray(angles, np.float64)
        a, b, c, d, e, f = tuple(~self.geobox.transform)[:6]
        along_x, along_y = np.cos(radians), np.sin(radians)
        steps = np.column_stack([d * along_x + e * along_y, a * along_x + b * along_y])
        distances = np.empty(len(radians))
        solid = np.ascontiguousarray(self.solid).view(np.uint8)
        _cast(solid, d * x + e * y + f, a * x + b * y + c, steps, distances)
        return distances

    def contains(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.bool_]:
        """Return whether points lie in a solid cell; `x`, `y` and the result have one shape."""
        a, b, c, d, e, f = tuple(~self.geobox.transform)[:6]
        xs, ys = np.asarray(x, np.float64), np.asarray(y, np.float64)
        row, col = np.floor(d * xs + e * ys + f), np.floor(a * xs + b * ys + c)
        rows, cols = self.solid.shape
        inside = (row >= 0) & (row < rows) & (col >= 0) & (col < cols)
        r, k = (np.clip(axis, 0, size - 1).astype(np.int64) for axis, size in ((row, rows), (col, cols)))
        return np.asarray(inside & self.solid[r, k])


@kernel("void(u1[:,::1], f8, f8, f8[:,::1], f8[::1])")
def _cast(solid, row, col, steps, distances):  # type: ignore[no-untyped-def]
    # `steps` (n, 2) are rows and columns of a metre along each ray (Amanatides and Woo, 1987).
    rows, cols = solid.shape
    for k in range(steps.shape[0]):
        down, right = steps[k, 0], steps[k, 1]
        r, c = np.int64(np.floor(row)), np.int64(np.floor(col))
        per_row = 1.0 / abs(down) if abs(down) > 1e-12 else inf
        per_col = 1.0 / abs(right) if abs(right) > 1e-12 else inf
        to_row = per_row * (r + 1 - row if down > 0.0 else row - r) if per_row < inf else inf
        to_col = per_col * (c + 1 - col if right > 0.0 else col - c) if per_col < inf else inf
        length = 0.0
        distances[k] = inf
        while 0 <= r < rows and 0 <= c < cols:
            if solid[r, c] != 0:
                distances[k] = length
                break
            if to_row < to_col:
                length, to_row, r = to_row, to_row + per_row, r + (1 if down > 0.0 else -1)
            else:
                length, to_col, c = to_col, to_col + per_col, c + (1 if right > 0.0 else -1)
