"""Which cells of a map are free: in a region, and their own value in range.

Where walls are a cell or two thin the mean of a block hides them, so a region alone is no place to drive in.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import PathError
from uavseg.execution.executors import Map, serial
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import ground_steps
from uavseg.raster.grid.tiling import Window
from uavseg.regions.outline.rasterise import Rasteriser
from uavseg.regions.outline.rings import Rings
from uavseg.segmentation.params.segment import IntensityRange
from uavseg.segmentation.source import GreySource
from uavseg.units import GREY_MAX

_STRIPE = 1 << 22  # cells that are looked at together


@dataclass(frozen=True, slots=True)
class MapPosition:
    """A place on the map that somebody named.

    Parameters
    ----------
    name : str
        "start" or "goal".
    cell : (int, int)
        Row and column.
    region : int
        0 where it lies in none.
    value : float or None
        v of its cell; None where it is not valid.
    is_free : bool
    """

    name: str
    cell: tuple[int, int]
    region: int
    value: float | None
    is_free: bool

    @property
    def where(self) -> str:
        """In words: "region 2", or why it is not free."""
        own = "no valid value" if self.value is None else f"v = {self.value:.3f}"
        if not self.region:
            return f"no region (its cell has {own})"
        return f"region {self.region}" + ("" if self.is_free else f", on a cell out of the range ({own})")


@dataclass(frozen=True, slots=True)
class NearestCell:
    """A free cell: its region, its centre on the map, and how far it is from some place in metres."""

    metres: float
    region: int
    x: float
    y: float


@dataclass(frozen=True)
class FreeCells:
    """The free cells of a map whose regions are known.

    Parameters
    ----------
    source : GreySource
        The map.
    rings : Rings
        Outlines of its regions.
    interval : IntensityRange
        The range of v that is passable.
    warnings : tuple of str
        What is to be told of the map.
    """

    source: GreySource
    rings: Rings
    interval: IntensityRange
    warnings: tuple[str, ...] = ()

    @property
    def geobox(self) -> GeoBox:
        """Where the cells lie."""
        return self.source.dataset.geobox

    def place(self, name: str, xy: tuple[float, float]) -> MapPosition:
        """What there is at a place.

        Raises
        ------
        PathError
            If it does not lie on the map.
        """
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
        region = int(self._painter(here)[0, 0])
        low, high = self.interval.greys
        free = region > 0 and value is not None and bool(low <= tile.grey[0, 0] <= high)
        return MapPosition(name, (here.row, here.col), region, value, free)

    def of_regions(
        self, regions: Collection[int], map: Map = serial
    ) -> tuple[Window, NDArray[np.bool_], int]:
        """The free cells of some regions, and how many of their cells are not.

        Returns
        -------
        window : Window
            The least that holds the regions.
        mask : (rows, cols) bool array
        walls : int
            Cells of the regions whose own value is out of the range.
        """
        rings = self.rings.select(np.isin(self.rings.labels, list(regions)))
        top, left = rings.vertices.min(axis=0).tolist()
        bottom, right = rings.vertices.max(axis=0).tolist()
        window = Window(top, left, bottom - top, right - left)
        mask = np.zeros((window.rows, window.cols), np.bool_)
        walls = 0
        stripes = list(_stripes(window))
        for stripe, (labels, free) in zip(
            stripes, map(partial(self._look, Rasteriser(rings)), stripes), strict=True
        ):
            mask[stripe.row - top : stripe.row - top + stripe.rows] = free
            walls += int((labels > 0).sum() - free.sum())
        return window, mask, walls

    def nearest(self, place: MapPosition, region: int | None = None, map: Map = serial) -> NearestCell | None:
        """The free cell nearest to a place, of one region or of any; None if there is none."""
        rings = self.rings if region is None else self.rings.select(self.rings.labels == region)
        row, col = place.cell
        width, height = ground_steps(self.geobox, row + 0.5, col + 0.5)
        stripes = list(_stripes(Window(0, 0, *self.geobox.shape)))
        best: tuple[float, int, int, int] | None = None
        for stripe, (labels, free) in zip(
            stripes, map(partial(self._look, Rasteriser(rings)), stripes), strict=True
        ):
            rows, cols = np.nonzero(free)
            if len(rows):
                away = np.hypot((rows + stripe.row - row) * height, (cols + stripe.col - col) * width)
                k = int(np.argmin(away))
                found = (float(away[k]), int(rows[k]) + stripe.row, int(cols[k]) + stripe.col)
                if best is None or found < best[:3]:
                    best = (*found, int(labels[rows[k], cols[k]]))
        if best is None:
            return None
        x, y = self.geobox.xy_from_pixel(best[1] + 0.5, best[2] + 0.5)
        return NearestCell(best[0], best[3], float(x), float(y))

    def grey_span(self, cells: NDArray[np.int64]) -> tuple[int, int] | None:
        """The lowest and the highest grey of cells, (n, 2) rows and columns; None where one is not valid."""
        (top, left), (bottom, right) = cells.min(axis=0).tolist(), cells.max(axis=0).tolist()
        tile = self.source.read(Window(top, left, bottom - top + 1, right - left + 1), 0)
        rows, cols = (cells - (top, left)).T
        if not tile.valid[rows, cols].all():
            return None
        grey = tile.grey[rows, cols]
        return int(grey.min()), int(grey.max())

    @cached_property
    def _painter(self) -> Rasteriser:
        return Rasteriser(self.rings)

    def _look(self, painter: Rasteriser, window: Window) -> tuple[NDArray[np.uint32], NDArray[np.bool_]]:
        """Labels of a window, and which of its cells are free."""
        labels = painter(window)
        low, high = self.interval.greys
        if not labels.any():
            return labels, np.zeros(labels.shape, np.bool_)
        tile = self.source.read(window, 0)
        here = slice(window.rows), slice(window.cols)
        grey, valid = tile.grey[here], tile.valid[here] > 0
        return labels, np.asarray((labels > 0) & valid & (grey >= low) & (grey <= high))


def _stripes(window: Window) -> Iterator[Window]:
    rows = max(_STRIPE // max(window.cols, 1), 1)
    for row in range(0, window.rows, rows):
        yield Window(window.row + row, window.col, min(rows, window.rows - row), window.cols)


def _pair(x: float, y: float) -> str:
    return f"{x:.12g},{y:.12g}"


def _extent(box: GeoBox) -> str:
    rows, cols = box.shape
    x, y = box.xy_from_pixel([0, 0, rows, rows], [0, cols, 0, cols])
    return f"x {x.min():.12g}..{x.max():.12g} and y {y.min():.12g}..{y.max():.12g}"
