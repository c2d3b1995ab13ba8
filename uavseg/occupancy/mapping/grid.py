"""OccupancyGrid: the probability that each cell of a map is occupied, and evidence merged into it."""

import math
from dataclasses import dataclass
from weakref import WeakSet

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavseg.errors import MapError
from uavseg.occupancy.mapping.apply_pending import take
from uavseg.occupancy.mapping.beams import REACH_SIGMAS, merge_beams
from uavseg.occupancy.mapping.grey_map import Ground
from uavseg.occupancy.mapping.live import LiveSegmentation
from uavseg.occupancy.mapping.log_odds import Singles, probabilities_of
from uavseg.occupancy.mapping.pending import MAX_LOG_ODDS, marks_of
from uavseg.occupancy.mapping.scan import Scan
from uavseg.raster.dataset import Dataset
from uavseg.raster.geobox import GeoBox, check_metres, local_geobox
from uavseg.raster.tiling import Window
from uavseg.segmentation.intervals import Intervals
from uavseg.segmentation.params import SegmentParams


@dataclass(frozen=True, slots=True, eq=False)
class Update:
    """What a scan changed.

    Parameters
    ----------
    window : Window
        The smallest one with every cell that the scan touched, empty if it touched none.
    blocks : (B, C) bool array
        The blocks of 64 x 64 cells that were measured or divided again: those with a cell whose grey has
        changed, and neighbours that look at such a cell.
    """

    window: Window
    blocks: NDArray[np.bool_]


class OccupancyGrid:
    """Probabilities of cells, which merge evidence by adding log-odds.

    A grid begins with 0.5 everywhere; a cell that was never seen stays at exactly 0.5. Every update of a cell
    adds to its log-odds, which are then clamped to -6..6, so that what stands still is never believed so
    firmly that a change goes unnoticed. Hence the order of scans matters only where a cell has reached the
    clamp.

    Parameters
    ----------
    geobox : GeoBox
        Where the cells lie, in metres.

    Attributes
    ----------
    geobox : GeoBox
    log_odds : (rows, cols) float32 array

    Raises
    ------
    MapError
        If the map's unit is not the metre.

    Examples
    --------
    >>> grid = OccupancyGrid.empty((2, 3), cell_m=0.1)
    >>> grid.probabilities
    array([[0.5, 0.5, 0.5],
           [0.5, 0.5, 0.5]], dtype=float32)
    """

    def __init__(self, geobox: GeoBox) -> None:
        check_metres(geobox)
        self.geobox = geobox
        self.log_odds = np.zeros(geobox.shape, np.float32)
        self._probabilities: Singles | None = None
        self._marks = marks_of(geobox.shape)
        self._ground = Ground.of(geobox.shape)
        self._lives: WeakSet[LiveSegmentation] = WeakSet()
        self._states: LiveSegmentation | None = None
        self._show_all()

    @classmethod
    def empty(
        cls, shape: tuple[int, int], cell_m: float, origin: tuple[float, float] = (0.0, 0.0)
    ) -> "OccupancyGrid":
        """A grid of square cells about which nothing is known.

        Parameters
        ----------
        shape : (int, int)
            Rows and columns.
        cell_m : float
            Side of a cell.
        origin : (float, float)
            x and y of the lower left corner in metres.
        """
        return cls(local_geobox(shape, cell_m, origin))

    @classmethod
    def from_probabilities(cls, probabilities: ArrayLike, geobox: GeoBox) -> "OccupancyGrid":
        """A grid that believes a map already made; beyond log-odds of 6 (0.0025 and 0.9975) it is clamped.

        Parameters
        ----------
        probabilities : (rows, cols) array

        Raises
        ------
        MapError
            If the shape is not that of the geobox, or a number is not a probability.
        """
        given = np.asarray(probabilities, np.float64)
        if given.shape != geobox.shape:
            raise MapError(f"probabilities of shape {given.shape} do not fit a grid of {geobox.shape}")
        if not ((given >= 0) & (given <= 1)).all():
            raise MapError("probabilities lie in 0..1; some of these do not")
        grid = cls(geobox)
        with np.errstate(divide="ignore"):
            odds = np.log(given) - np.log1p(-given)
        grid.log_odds[...] = np.clip(odds, -MAX_LOG_ODDS, MAX_LOG_ODDS)
        grid._show_all()
        return grid

    @property
    def probabilities(self) -> Singles:
        """1 / (1 + exp(-log_odds)) of each cell: a (rows, cols) float32 array, not to be written to.

        Once somebody has looked at it, it is kept in step with what is merged.
        """
        if self._probabilities is None:
            self._probabilities, _ = probabilities_of(self.log_odds)
        return self._probabilities

    def merge(self, scan: Scan) -> Window:
        """Take in what a scan says about the cells that its beams cross.

        Returns
        -------
        Window
            The smallest one with every cell that the scan touched, empty if it touched none: nothing
            outside it has changed.
        """
        heard = ~np.isnan(scan.ranges)
        ranges = scan.ranges[heard]
        reach = np.where(np.isinf(ranges), scan.max_range_m, ranges + REACH_SIGMAS * scan.sigma_m)
        angles = math.radians(scan.pose.heading_deg) + scan.angles[heard]
        along_x, along_y = np.cos(angles), np.sin(angles)
        a, b, c, d, e, f = tuple(~self.geobox.transform)[:6]  # from metres to cells
        beams = np.column_stack([a * along_x + b * along_y, d * along_x + e * along_y, ranges, reach])
        x, y = scan.pose.x, scan.pose.y
        origin = (a * x + b * y + c, d * x + e * y + f)
        window = merge_beams(self.log_odds, self._marks, origin, beams, scan.sigma_m)
        take(self._marks, self.log_odds, self._probabilities, self._ground, window)
        return window

    def segment(self, cut: Intervals | None = None, params: SegmentParams | None = None) -> LiveSegmentation:
        """Segment the map, and keep its segments in step with what is merged for as long as they are held.

        Parameters
        ----------
        cut : StateLimits, IntensityRange or Levels
            What is asked of the segments; the paper's states if left out.
        params : SegmentParams
            The paper's method if left out.

        Returns
        -------
        LiveSegmentation
            There may be several of one map, for the states and for a range, say.
        """
        live = LiveSegmentation(self._ground, cut, params)
        self._lives.add(live)
        return live

    @property
    def segmentation(self) -> LiveSegmentation:
        """The segmentation by the paper's states and method, made when it is first asked for."""
        if self._states is None:
            self._states = self.segment()
        return self._states

    def update(self, scan: Scan) -> Update:
        """Merge a scan and divide again those blocks of all segmentations that see a change, and no others.

        Without any, there is from now on that by states, `segmentation`.

        Returns
        -------
        Update
            The cells that the scan touched, and the blocks that were divided again.

        Examples
        --------
        >>> grid = OccupancyGrid.empty((64, 128), cell_m=0.1)
        >>> from uavseg.occupancy.simulation.range_finder import Pose
        >>> scan = Scan(Pose(0, 3.2), np.zeros(1), np.array([1.05]), max_range_m=5.0, sigma_m=0.05)
        >>> grid.update(scan).blocks
        array([[ True, False]])
        """
        lives = list(self._lives) or [self.segmentation]
        window = self.merge(scan)
        blocks = np.zeros(self._ground.changed.shape, bool)
        for live in lives:
            blocks |= live.settle()
        return Update(window, blocks)

    def refit(self) -> None:
        """Fit all contrast cuts to the map as it is now, and divide every block again."""
        for live in list(self._lives) or [self.segmentation]:
            live.refit()

    def reset(self) -> None:
        """Forget everything: all cells are at 0.5 again. Segmentations follow and keep their cuts."""
        self.log_odds[...] = 0
        self._show_all()

    def _show_all(self) -> None:
        """Probabilities and grey of all cells, from their log-odds."""
        p, grey = probabilities_of(self.log_odds)
        if self._probabilities is not None:
            self._probabilities[...] = p
        self._ground.show(grey)

    def dataset(self, name: str = "occupancy grid") -> Dataset:
        """The probabilities as a dataset that is read by window; later scans show in it."""
        return Dataset.of_values(self.probabilities, self.geobox, name)


def grey_picture(probabilities: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Probabilities as a picture, floor(255 p + 0.5): free black, unknown grey, occupied white."""
    return np.floor(255 * probabilities.astype(np.float64) + 0.5).astype(np.uint8)
