"""Occupancy grid: the probability that each cell is occupied, updated by range scans in log-odds."""

import math
from dataclasses import asdict
from typing import Any
from weakref import WeakSet

import numpy as np
from numpy.typing import ArrayLike

from uavseg.arguments import checked
from uavseg.arrays import Bools, Float32s, Path_, Uint8s
from uavseg.dataclass import dataclass
from uavseg.errors import MapError
from uavseg.occupancy.mapping import grid_io
from uavseg.occupancy.mapping.beams import REACH_SIGMAS, merge_beams
from uavseg.occupancy.mapping.live import LiveSegmentation
from uavseg.occupancy.mapping.log_odds import (
    MARGIN,
    MAX_LOG_ODDS,
    Contradictions,
    Fading,
    probabilities_and_grey,
)
from uavseg.occupancy.mapping.pending import GreyMap, apply_pending, empty_pending, mark_up_to_date
from uavseg.occupancy.mapping.scan import Scan
from uavseg.raster.grid.geobox import GeoBox, check_metres, local_geobox
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.dataset import Dataset
from uavseg.segmentation.params.segment import Intervals, SegmentParams


@dataclass(frozen=True, slots=True, eq=False)
class Update:
    """Changes that a scan made."""

    window: Window  # the smallest one with every cell that the scan updated, empty if it updated none
    # (B, C), the blocks of 64 x 64 cells that were measured or divided again: those with a cell whose grey
    # has changed, and those next to such a cell
    blocks: Bools


@checked
class OccupancyGrid:
    """Probabilities of cells, updated by adding log-odds.

    A grid begins with 0.5 everywhere; a cell without observations stays at exactly 0.5. Every update of a
    cell adds to its log-odds, which are then clamped to -6..6, so that a cell that was observed often can
    still change. Hence the order of scans matters only where a cell has reached the clamp.

    Parameters
    ----------
    geobox : GeoBox
        Position of the cells, in metres.
    clamp : float
        Largest log-odds that is left of a cell after a scan, above 0 and at most 6.
    half_life : float, optional
        Scans after which the log-odds of every cell are halved; for comparison. By default never.
    forget_after : int, optional
        An occupied cell loses evidence only after so many scans in a row that see through it, and then all of
        it; see `mapping.log_odds`. By default every observation counts for itself.

    Attributes
    ----------
    geobox : GeoBox
    fading : Fading
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

    def __init__(
        self,
        geobox: GeoBox,
        *,
        clamp: float = MAX_LOG_ODDS,
        half_life: float | None = None,
        forget_after: float | None = None,
    ) -> None:
        check_metres(geobox)
        self.geobox, self.fading = geobox, Fading(clamp, half_life, forget_after)
        self._forgetting = None
        if forget_after is not None:  # beside a grid of the last scan alone
            self._forgetting = Contradictions(geobox.shape, forget_after), OccupancyGrid(geobox)
        self.log_odds = np.zeros(geobox.shape, np.float32)
        self._probabilities: Float32s | None = None
        self._pending = empty_pending(geobox.shape)
        self._grey_map = GreyMap.empty(geobox.shape)
        self._segmentations: WeakSet[LiveSegmentation] = WeakSet()
        self._default_segmentation: LiveSegmentation | None = None
        self._recompute()

    @classmethod
    @checked
    def empty(
        cls,
        shape: tuple[int, int],
        cell_m: float,
        origin: tuple[float, float] = (0.0, 0.0),
        *,
        clamp: float = MAX_LOG_ODDS,
        half_life: float | None = None,
        forget_after: float | None = None,
    ) -> "OccupancyGrid":
        """Make a grid of square cells without observations, 0.5 everywhere.

        Parameters
        ----------
        shape : (int, int)
            Rows and columns.
        cell_m : float
            Side of a cell.
        origin : (float, float)
            x and y of the lower left corner in metres.
        clamp, half_life, forget_after
            As of the class.
        """
        box = local_geobox(shape, cell_m, origin)
        return cls(box, clamp=clamp, half_life=half_life, forget_after=forget_after)

    @classmethod
    @checked
    def from_probabilities(cls, probabilities: ArrayLike, geobox: GeoBox) -> "OccupancyGrid":
        """Make a grid that begins with a given map; log-odds are clamped to -6..6 (0.0025 and 0.9975).

        Parameters
        ----------
        probabilities : (rows, cols) array
            In 0..1.
        geobox : GeoBox

        Raises
        ------
        MapError
            If the shape is not that of the geobox, or a number lies outside 0..1.
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
        grid._recompute()
        return grid

    @classmethod
    @checked
    def from_message(cls, message: Any) -> "OccupancyGrid":
        """Make a grid that begins with a `nav_msgs/OccupancyGrid` message; -1 becomes exactly 0.5.

        It is of rclpy, rospy or rosbags, or any object with the same fields; its origin may be rotated.

        Raises
        ------
        MapError
            If a field is missing, cells are not -1 or 0..100, or the origin is tilted.
        """
        return cls.from_probabilities(*grid_io.read_grid_message(message))

    @checked
    def to_message(self, message: Any = None) -> Any:
        """Return the map as a `nav_msgs/OccupancyGrid` message: 0..100 per cent, -1 where v is exactly 0.5.

        Parameters
        ----------
        message : OccupancyGrid message, optional
            Its `info` and `data` are filled; header and `info.map_load_time` stay as they are. By default a
            plain object with the fields of the message, `data` as an array.array of int8. Returned; row 0 is
            the lowest, and the origin the lower left corner.

        Raises
        ------
        MapError
            If the cells of this grid are not square.
        """
        return grid_io.fill_grid_message(self.probabilities, self.geobox, message)

    @checked
    def save(self, path: Path_, overwrite: bool = False) -> None:
        """Save the log-odds of all cells as a GeoTIFF, so that merging can continue.

        Parameters
        ----------
        path : path
            Ends in .tif or .tiff.
        overwrite : bool
            Whether to replace an existing file, which is an OutputExistsError otherwise.
        """
        grid_io.write_grid_file(path, self.log_odds, self.geobox, overwrite, self.fading)

    @classmethod
    @checked
    def load(cls, path: Path_) -> "OccupancyGrid":
        """Load a grid that `save` saved; later scans continue from its log-odds.

        Raises MapError if the file is another raster or damaged, RasterReadError if it cannot be read.
        """
        log_odds, geobox, fading = grid_io.read_grid_file(path)
        grid = cls(geobox, **asdict(fading))
        grid.log_odds[...] = log_odds
        grid._recompute()
        return grid

    @property
    def probabilities(self) -> Float32s:
        """Return 1 / (1 + exp(-log_odds)) of each cell: a (rows, cols) float32 array; do not write to it.

        It is made on first use; from then on, later scans show in it.
        """
        if self._probabilities is None:
            self._probabilities, _ = probabilities_and_grey(self.log_odds)
        return self._probabilities

    @checked
    def merge(self, scan: Scan) -> Window:
        """Update the cells that the beams of a scan cross.

        Returns
        -------
        Window
            The smallest one with every cell that the scan updated, empty if it updated none.
        """
        known = ~np.isnan(scan.ranges)
        ranges = scan.ranges[known]
        reach = np.where(np.isinf(ranges), scan.max_range_m, ranges + REACH_SIGMAS * scan.sigma_m)
        x, y, angles = (numbers[known] for numbers in scan.beams)
        along_x, along_y = np.cos(angles), np.sin(angles)
        a, b, c, d, e, f = tuple(~self.geobox.transform)[:6]  # from metres to cells
        steps = a * along_x + b * along_y, d * along_x + e * along_y
        beams = np.column_stack([*steps, ranges, reach, a * x + b * y + c, d * x + e * y + f])
        if self.fading.half_life is not None:
            self.log_odds *= np.float32(0.5 ** (1 / self.fading.half_life))
            self._recompute()
        around, before = None, self.log_odds
        if self._forgetting is not None:
            around = self._forgetting[1].merge(scan).grown(MARGIN).clipped(self.geobox.shape)
            before = self.log_odds[around.slices].copy()
        window = merge_beams(self.log_odds, self._pending, beams, scan.sigma_m)
        apply_pending(self._pending, self.log_odds, self._probabilities, self._grey_map, window)
        if self._forgetting is not None and around is not None:
            contradictions, alone = self._forgetting
            odds, after = (one.log_odds[around.slices] for one in (alone, self))
            reach_cells = REACH_SIGMAS * scan.sigma_m * max(map(abs, (a, b, d, e)))
            beside = math.ceil(min(reach_cells, max(self.geobox.shape)))
            self._set(around, contradictions.revised(around, before, odds, after, beside))
            odds[...] = 0
        if self.fading.clamp < MAX_LOG_ODDS:
            self._set(window, np.clip(self.log_odds[window.slices], -self.fading.clamp, self.fading.clamp))
        return window

    @checked
    def segment(
        self, partition: Intervals | None = None, params: SegmentParams | None = None
    ) -> LiveSegmentation:
        """Segment the map; the segments follow later scans as long as the caller holds the result.

        Parameters
        ----------
        partition : StateLimits, IntensityRange or Levels, optional
            Intervals of v by which the segments are classified; by default the paper's states.
        params : SegmentParams, optional
            By default the paper's method.

        Returns
        -------
        LiveSegmentation
            A map may have several, for example one by states and one by a range.
        """
        live = LiveSegmentation(self._grey_map, partition, params)
        self._segmentations.add(live)
        return live

    @property
    def segmentation(self) -> LiveSegmentation:
        """Return the segmentation by the paper's states and method, made on first use."""
        if self._default_segmentation is None:
            self._default_segmentation = self.segment()
        return self._default_segmentation

    @checked
    def update(self, scan: Scan) -> Update:
        """Merge a scan and divide again only those blocks that the change affects, in all segmentations.

        If there is no segmentation yet, the one by states is made, see `segmentation`.

        Returns
        -------
        Update
            The cells that the scan updated, and the blocks that were divided again.

        Examples
        --------
        >>> grid = OccupancyGrid.empty((64, 128), cell_m=0.1)
        >>> from uavseg.occupancy.mapping.scan import Pose
        >>> scan = Scan(Pose(0, 3.2), np.zeros(1), np.array([1.05]), max_range_m=5.0, sigma_m=0.05)
        >>> grid.update(scan).blocks
        array([[ True, False]])
        """
        segmentations = list(self._segmentations) or [self.segmentation]
        window = self.merge(scan)
        blocks = np.zeros(self._grey_map.changed.shape, bool)
        for live in segmentations:
            blocks |= live.settle()
        return Update(window, blocks)

    def refit(self) -> None:
        """Fit the contrast bin edges of all segmentations to the map as it is now, and divide every block."""
        for live in list(self._segmentations) or [self.segmentation]:
            live.refit()

    def reset(self) -> None:
        """Set all cells to 0.5. Segmentations follow and keep their contrast bin edges."""
        self.log_odds[...] = 0
        self._recompute()

    def _set(self, window: Window, revised: Float32s) -> None:
        rows, cols = np.nonzero(revised != self.log_odds[window.slices])
        self.log_odds[window.slices] = revised
        mark_up_to_date(self._pending, rows + window.row, cols + window.col)
        apply_pending(self._pending, self.log_odds, self._probabilities, self._grey_map, window)

    def _recompute(self) -> None:
        p, grey = probabilities_and_grey(self.log_odds)
        if self._probabilities is not None:
            self._probabilities[...] = p
        self._grey_map.set_grey(grey)

    @checked
    def dataset(self, name: str = "occupancy grid") -> Dataset:
        """Return the probabilities as a dataset for windowed reads; later scans show in it."""
        return Dataset.of_values(self.probabilities, self.geobox, name)


def grey_picture(probabilities: Float32s) -> Uint8s:
    """Convert probabilities to 8-bit grey, floor(255 p + 0.5): free black, unknown grey, occupied white."""
    return np.floor(255 * probabilities.astype(np.float64) + 0.5).astype(np.uint8)
