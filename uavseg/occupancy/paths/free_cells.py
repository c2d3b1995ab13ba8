"""Free cells of a map: in a region, and their value in range.

The mean of a block hides walls that are a cell or two thin, so a region alone is not passable throughout.
"""

from collections.abc import Collection, Iterator
from functools import cached_property, partial
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.errors import PathError
from uavseg.execution.executors import Map, serial
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import ground_steps
from uavseg.raster.grid.tiling import Window
from uavseg.regions.outline.rings import Rasteriser, Rings
from uavseg.segmentation.params.segment import IntensityRange
from uavseg.segmentation.source import GreySource
from uavseg.units import GREY_MAX

_STRIPE = 1 << 22  # cells of a stripe, which are read together


@dataclass(frozen=True, slots=True)
class MapPosition:
    """The start or the goal, and what the map holds there."""

    name: str  # "start" or "goal"
    cell: tuple[int, int]  # row and column
    region: int  # 0 outside of all regions
    value: float | None  # v of its cell; None where it is not valid
    is_free: bool

    @property
    def where(self) -> str:
        """Return "region 2", or why the position is not free."""
        value = "no valid value" if self.value is None else f"v = {self.value:.3f}"
        if not self.region:
            return f"no region (its cell has {value})"
        return f"region {self.region}" + ("" if self.is_free else f", on a cell out of the range ({value})")


@dataclass(frozen=True, slots=True)
class NearestCell:
    """A free cell: its distance in metres from a position, its region, and its centre on the map."""

    metres: float
    region: int
    x: float
    y: float


@dataclass(frozen=True)
class FreeCells:
    """The free cells of a map whose regions are known."""

    source: GreySource  # the map
    rings: Rings  # outlines of its regions
    interval: IntensityRange  # the range of v that is passable
    warnings: tuple[str, ...] = ()

    @property
    def geobox(self) -> GeoBox:
        """Return the position of the cells."""
        return self.source.dataset.geobox

    def place(self, name: str, xy: tuple[float, float]) -> MapPosition:
        """Look up a position in map coordinates, named "start" or "goal"; refuse one outside of the map."""
        if not all(map(isfinite, xy)):
            raise PathError(f"the {name} is two finite numbers, x and y on the map, not {_pair(*xy)}")
        box = self.geobox
        t = ~box.transform
        col, row = t.a * xy[0] + t.b * xy[1] + t.c, t.d * xy[0] + t.e * xy[1] + t.f
        if not (0 <= row < box.shape[0] and 0 <= col < box.shape[1]):
            raise PathError(f"the {name} {_pair(*xy)} lies outside of the map, which has {_extent(box)}")
        here = Window(int(row), int(col), 1, 1)
        tile = self.source.read(here, 0)
        value = tile.grey[0, 0] / GREY_MAX if tile.valid[0, 0] else None
        region = int(self._rasteriser(here)[0, 0])
        low, high = self.interval.greys
        free = region > 0 and value is not None and bool(low <= tile.grey[0, 0] <= high)
        return MapPosition(name=name, cell=(here.row, here.col), region=region, value=value, is_free=free)

    def of_regions(
        self, regions: Collection[int], map: Map = serial
    ) -> tuple[Window, NDArray[np.bool_], int]:
        """Return the free cells of some regions.

        These are the smallest window that holds the regions, a mask (rows, cols), and the number of cells of
        the regions whose value is out of the range.
        """
        rings = self.rings.select(np.isin(self.rings.labels, list(regions)))
        top, left = rings.vertices.min(axis=0).tolist()
        bottom, right = rings.vertices.max(axis=0).tolist()
        window = Window(top, left, bottom - top, right - left)
        mask = np.zeros((window.rows, window.cols), np.bool_)
        walls = 0
        for stripe, labels, free in self._read_stripes(rings, window, map):
            mask[stripe.row - top : stripe.row - top + stripe.rows] = free
            walls += int((labels > 0).sum() - free.sum())
        return window, mask, walls

    def nearest(self, place: MapPosition, region: int | None = None, map: Map = serial) -> NearestCell | None:
        """Find the free cell nearest to a position, in one region or in any; None if there is none."""
        rings = self.rings if region is None else self.rings.select(self.rings.labels == region)
        row, col = place.cell
        width, height = ground_steps(self.geobox, row + 0.5, col + 0.5)
        best: tuple[float, int, int, int] | None = None
        for stripe, labels, free in self._read_stripes(rings, Window(0, 0, *self.geobox.shape), map):
            rows, cols = np.nonzero(free)
            if len(rows):
                away = np.hypot((rows + stripe.row - row) * height, (cols + stripe.col - col) * width)
                k = int(np.argmin(away))
                near = (float(away[k]), int(rows[k]) + stripe.row, int(cols[k]) + stripe.col)
                if best is None or near < best[:3]:
                    best = (*near, int(labels[rows[k], cols[k]]))
        if best is None:
            return None
        x, y = self.geobox.xy_from_pixel(best[1] + 0.5, best[2] + 0.5)
        return NearestCell(metres=best[0], region=best[3], x=float(x), y=float(y))

    def grey_span(self, cells: NDArray[np.int64]) -> tuple[int, int] | None:
        """Return the lowest and the highest grey of (n, 2) cells; None if one is invalid."""
        (top, left), (bottom, right) = cells.min(axis=0).tolist(), cells.max(axis=0).tolist()
        tile = self.source.read(Window(top, left, bottom - top + 1, right - left + 1), 0)
        rows, cols = (cells - (top, left)).T
        if not tile.valid[rows, cols].all():
            return None
        grey = tile.grey[rows, cols]
        return int(grey.min()), int(grey.max())

    @cached_property
    def _rasteriser(self) -> Rasteriser:
        return Rasteriser(self.rings)

    def _read_stripes(
        self, rings: Rings, window: Window, map: Map
    ) -> Iterator[tuple[Window, NDArray[np.uint32], NDArray[np.bool_]]]:
        """Read a window stripe by stripe: labels of some regions, and the free cells among them."""
        count = max(_STRIPE // max(window.cols, 1), 1)
        stripes = [
            Window(window.row + row, window.col, min(count, window.rows - row), window.cols)
            for row in range(0, window.rows, count)
        ]
        read = map(partial(self._read_window, Rasteriser(rings)), stripes)
        for stripe, (labels, free) in zip(stripes, read, strict=True):
            yield stripe, labels, free

    def _read_window(
        self, rasteriser: Rasteriser, window: Window
    ) -> tuple[NDArray[np.uint32], NDArray[np.bool_]]:
        labels = rasteriser(window)
        low, high = self.interval.greys
        if not labels.any():
            return labels, np.zeros(labels.shape, np.bool_)
        tile = self.source.read(window, 0)
        here = slice(window.rows), slice(window.cols)
        grey, valid = tile.grey[here], tile.valid[here] > 0
        return labels, np.asarray((labels > 0) & valid & (grey >= low) & (grey <= high))


def _pair(x: float, y: float) -> str:
    return f"{x:.12g},{y:.12g}"


def _extent(box: GeoBox) -> str:
    rows, cols = box.shape
    x, y = box.xy_from_pixel([0, 0, rows, rows], [0, cols, 0, cols])
    return f"x {x.min():.12g}..{x.max():.12g} and y {y.min():.12g}..{y.max():.12g}"
