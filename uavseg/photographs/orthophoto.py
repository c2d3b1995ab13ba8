"""Orthorectification: photographs are drawn on the ground by their pose, as one mosaic without blending."""

import math
import threading
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, map_coordinates

from uavseg.arrays import Bools, Floats
from uavseg.errors import PhotographError
from uavseg.execution.executors import Map, Progress, serial, split_progress
from uavseg.flight.mission.track import Plane
from uavseg.photographs.ground import Ground
from uavseg.photographs.read import HORIZON_DEG, Photograph, grouped
from uavseg.raster.geodesy.globe import WGS84, Transform, transform_between, utm_crs, wrap_lon
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window, tiles
from uavseg.raster.read.inspect_file import inspect_file

TILE = 256  # pixels; within a tile, places on the planes of the cameras are linear to 1e-4 of a pixel
COARSEST = 4.0  # times the pixel on the ground in the middle of a photograph, which is drawn at most
MAX_PIXELS = 4_000_000_000  # of a mosaic
MAX_IMAGE_PIXELS = 178_956_970  # of a photograph, as Pillow reads at most
STRIP_BYTES, CACHE_BYTES = 64 << 20, 192 << 20  # of rows that are drawn at once, of decoded photographs
POSITION_M = 3.0  # horizontal, of a satellite receiver without corrections
HEIGHT_M, HEIGHT_SHARE = 2.0, 0.02  # of a height above the ground, whichever is more
YAW_DEG, TILT_DEG = 1.5, 0.5  # of gimbals: about the vertical, and about each of two level axes
_NODES = 17  # places along each side of an image that are looked at beforehand
_AZIMUTHS, _RINGS = 720, 128  # of the heights around a camera that may hide others: 0.7 MB
HORIZONS = 128  # of cameras, that are kept
_SUNK = 1e-3  # of the height of the camera: so far below a line of sight, ground is hidden
_TYPES = ({"uint8"}, {"uint16"})


def likely_error_m(photograph: Photograph, away_m: Floats, below_m: Floats) -> Floats:
    """Return the standard deviation of where ground is drawn, in metres: horizontal, (n,).

    The ground lies `away_m` from the point below the camera and `below_m` below it, (n,), and is level.
    Variances of position, height, yaw and tilt about two level axes add up, each by the first derivative of
    the place [1]_. Where the file says the error of the position, that of the height is at most twice it.

    References
    ----------
    .. [1] Wolf, P. R., Dewitt, B. A. and Wilkinson, B. E. (2014). Elements of Photogrammetry with
           Applications in GIS, 4th edition, McGraw-Hill, appendix A: propagation of random errors.
    """
    stated, slope = photograph.position_error_m, away_m / below_m
    height_m = np.maximum(HEIGHT_M, HEIGHT_SHARE * below_m)
    if stated is not None:
        height_m = np.minimum(height_m, 2 * stated)
    turned_m = math.radians(YAW_DEG) * away_m
    # A tilt moves ground by 1 + slope^2 times the height along the line from the camera, by 1 across it.
    tilted_m = math.radians(TILT_DEG) * below_m * np.hypot(1 + slope**2, 1)
    position_m = POSITION_M if stated is None else stated
    errors: Floats = np.sqrt(position_m**2 + (slope * height_m) ** 2 + turned_m**2 + tilted_m**2)
    return errors


class View:
    """A photograph and the ground that is drawn of it; PhotographError if its middle shows none."""

    def __init__(self, photograph: Photograph, ground: Ground, to_xy: Transform) -> None:
        self.photograph = photograph
        self.plane = plane = Plane(photograph.lat, photograph.lon)
        self.height_m = ground.camera_height_m(photograph)  # as the heights of the ground
        along, middle = np.linspace(0, 1, _NODES), _NODES**2 // 2
        pixels = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2) * photograph.image_px
        offsets = ground.seen(photograph, pixels) - (0, 0, self.height_m)
        away, below = np.hypot(offsets[:, 0], offsets[:, 1]), -offsets[:, 2]
        sides_m = _sides_m(offsets @ photograph.axes[0], below, photograph.focal_px)
        self.coarsest_m = COARSEST * sides_m[middle]  # side of a pixel, beyond which nothing is drawn
        drawn = sides_m <= self.coarsest_m
        if not drawn[middle]:
            raise PhotographError("its middle looks to the horizon, or beyond the elevation model")
        self.drawn = float(drawn.mean())  # share of the image
        # Ground sampling distance across the line of sight, in the middle of the image.
        self.gsd_m = float(np.linalg.norm(offsets[middle]) / photograph.focal_px)
        self.lean = float((away / below)[drawn].max())  # metres off at the edge, for each of height
        errors = likely_error_m(photograph, away, below)
        self.errors_m = float(errors[middle]), float(errors[drawn].max())  # in the middle, and the largest
        near = binary_dilation(drawn.reshape(_NODES, _NODES), np.ones((3, 3)))  # between them the edge lies
        around = near.ravel() & np.isfinite(sides_m)
        xy = np.array(to_xy(*plane.lonlat_from_xy(*offsets[around, :2].T)))
        # Between the nodes, the outline of an image over hills may bulge.
        margin = 0.0 if ground.dem is None else np.ptp(xy, axis=1).max() / (_NODES - 1)
        # Left, bottom, right and top on the map.
        self.bounds = np.concatenate([xy.min(axis=1) - margin, xy.max(axis=1) + margin])
        self.reach_m = away[around].max() + 2 * margin

    def horizon(self, ground: Ground) -> Floats:
        """Return the steepest slope from the camera to the ground up to each ring: (azimuths, rings)."""
        azimuth = np.arange(_AZIMUTHS)[:, None] * (math.tau / _AZIMUTHS)
        far = np.arange(1, _RINGS + 1) * (self.reach_m / _RINGS)
        places = self.plane.lonlat_from_xy((np.sin(azimuth) * far).ravel(), (np.cos(azimuth) * far).ravel())
        slope = (ground.heights_m(*places).reshape(_AZIMUTHS, _RINGS) - self.height_m) / far
        steepest: Floats = np.fmax.accumulate(slope, axis=1)
        return steepest

    def places(self, offsets: Floats, horizon: Floats | None) -> tuple[Floats, Bools]:
        """Return where ground (3, n), metres from the camera, is in the image (2, n), and what is drawn."""
        one, (east, north, up), far = self.photograph, offsets, np.hypot(*offsets[:2])
        col, row = found = one.pixels(offsets)
        drawn: Bools = (col >= 0) & (col <= one.image_px[0]) & (row >= 0) & (row <= one.image_px[1])
        drawn &= -up > math.cos(math.radians(HORIZON_DEG)) * np.hypot(far, up)
        sight = one.axes[0]
        ahead = sight[0] * east + sight[1] * north + sight[2] * up
        drawn &= _sides_m(ahead, -up, one.focal_px) <= self.coarsest_m
        if horizon is not None:
            azimuth = np.rint(np.arctan2(east, north) * (_AZIMUTHS / math.tau)).astype(np.int64) % _AZIMUTHS
            # The ring before the last one, so that ground never hides itself.
            ring = np.minimum((far * (_RINGS / self.reach_m)).astype(np.int64), _RINGS) - 2
            slope = horizon[azimuth, np.maximum(ring, 0)]
            drawn &= (ring < 0) | ~(up <= slope * far + _SUNK * up)
        return found, drawn


def _sides_m(ahead: Floats, below: Floats, focal_px: float) -> Floats:
    """Return the root of the area of a pixel on level ground; NaN behind the camera or above it."""
    with np.errstate(divide="ignore", invalid="ignore"):
        sides: Floats = np.sqrt(ahead**3 / below) / focal_px
    return sides


class Mosaic:
    """Photographs, and a grid over the ground that they show: in the UTM zone of their middle, north up.

    Pixels are squares of `pixel_m` metres, by default as large as those in the middle of the photographs (the
    median), and their edges are at multiples of that. No pixels are decoded to lay them.

    Errors are those of `Ground.each`; besides, a PhotographError says that photographs differ in bands or
    type of their pixels, or that the mosaic would be too large; a RasterReadError that a file cannot be
    opened.
    """

    def __init__(
        self,
        photographs: Sequence[Photograph],
        ground: Ground,
        pixel_m: float | None = None,
        progress: Progress | None = None,
    ) -> None:
        lons, lats = (np.array([getattr(one, name) for one in photographs]) for name in ("lon", "lat"))
        crs = utm_crs(float(lats.mean()), float(lons[0] + wrap_lon(lons - lons[0]).mean()))
        to_xy = transform_between(WGS84, crs.to_wkt())
        views, notes = ground.each(photographs, lambda one: View(one, ground, to_xy), progress)
        types = _types_of([view.photograph for view in views])
        side = pixel_m or float(f"{np.median([view.gsd_m for view in views]):.3g}")
        bounds = np.array([view.bounds for view in views])
        with np.errstate(all="ignore"):  # a side may be so small that the mosaic is infinite
            left, top = np.floor(bounds[:, 0].min() / side), np.ceil(bounds[:, 3].max() / side)
            cols, rows = np.ceil(bounds[:, 2].max() / side) - left, top - np.floor(bounds[:, 1].min() / side)
            too_large = not rows * cols <= MAX_PIXELS
        if too_large:
            raise PhotographError(
                f"the photographs would be a mosaic of {cols:,.0f} x {rows:,.0f} pixels of {100 * side:g} "
                f"cm, and at most {MAX_PIXELS:,} are drawn: do all show one place? Give fewer, or a larger "
                "--resolution"
            )
        cut = sorted((view.drawn, view.photograph.path) for view in views if view.drawn < 1)
        why = (
            f"is not drawn: near the horizon, {COARSEST:g} times as coarse as the middle, or no known ground"
        )
        notes += grouped("up to ", ((path, f"{100 * (1 - drawn):.0f} % {why}") for drawn, path in cut))
        if ground.dem is None:
            notes.append(
                "the ground is taken to be as high as the place of takeoff; what is 1 m higher or lower lies "
                f"up to {max(view.lean for view in views):.2g} m off: give an elevation model with --dem"
            )
        self.views, self.ground, self.warnings = views, ground, notes
        self.geobox = GeoBox((int(rows), int(cols)), Affine(side, 0, left * side, 0, -side, top * side), crs)
        self.types, self.dtype = types, np.dtype(types[0])  # of the bands without alpha
        self._to_lonlat = transform_between(crs.to_wkt(), WGS84)
        self._images: dict[int, NDArray[Any]] = {}  # the last used last
        self._horizon = lru_cache(HORIZONS)(lambda view: view.horizon(ground))
        self._lock = threading.Lock()  # of PROJ, the elevation model and the images

    def strips(
        self, map: Map = serial, progress: Progress | None = None
    ) -> Iterator[tuple[int, NDArray[Any]]]:
        """Yield strips from the top: first row, and pixels (bands and alpha, rows, cols).

        Executors, which must be threads, change nothing. A RasterReadError says that a photograph is damaged.
        """
        rows, cols = self.geobox.shape
        row_bytes = cols * (len(self.types) + 1) * self.dtype.itemsize
        parts = tiles((rows, cols), (max(STRIP_BYTES // row_bytes // TILE, 1) * TILE, -(-cols // 64) * 64))
        reports = split_progress(progress, len(parts)) if progress else [None] * len(parts)
        for part, report in zip(parts, reports, strict=True):
            strip = np.zeros((len(self.types) + 1, part.rows, cols), self.dtype)
            # Column by column, because strips are wide, and few photographs are kept.
            windows = sorted(tiles((part.rows, cols), TILE), key=lambda window: window.col)
            below = [window.relative_to(Window(-part.row, 0, 0, 0)) for window in windows]
            for window, pixels in zip(windows, map(self.tile, below, report), strict=True):
                strip[(slice(None), *window.slices)] = pixels
            yield part.row, strip

    def tile(self, window: Window) -> NDArray[Any]:
        """Draw a window of at most 256 x 256 pixels: (bands and alpha, rows, cols).

        Each pixel is of the photograph whose camera is nearest, in units of its focal length in pixels; of
        several, of the first. It is interpolated between four pixels, and alpha is 0 where none shows it.
        """
        shape, size = (window.rows, window.cols), window.rows * window.cols
        row, col = np.array([[0, 0, 1, 1], [0, 1, 0, 1]]) * np.array([shape]).T + [[window.row], [window.col]]
        x, y = self.geobox.xy_from_pixel(row, col)
        dem, heights = self.ground.dem, np.zeros(size)
        with self._lock:
            lon, lat = self._to_lonlat(x, y)
            if dem is not None:
                corners = *dem.pixels(lon, lat), wrap_lon(lon, around=float(lon[0])), lat
                heights = dem.heights_at(*(_between(values, shape) for values in corners))
            near = [
                (k, view, view.plane.xy_from_lonlat(lon, lat), None if dem is None else self._horizon(view))
                for k, view in enumerate(self.views)
                if (view.bounds[:2] < (x[1], y[0])).all() and (view.bounds[2:] > (x[0], y[2])).all()
            ]
        best, chosen, place = np.full(size, np.inf), np.full(size, -1), np.zeros((2, size))
        for k, view, xy, horizon in near:
            offsets = np.stack([*(_between(corners, shape) for corners in xy), heights - view.height_m])
            distance2 = (offsets**2).sum(axis=0) / view.photograph.focal_px**2
            closer = np.flatnonzero(distance2 < best)
            found, drawn = view.places(offsets[:, closer], horizon)
            closer = closer[drawn]
            best[closer], chosen[closer], place[:, closer] = distance2[closer], k, found[:, drawn]
        pixels = np.zeros((len(self.types) + 1, size), self.dtype)
        for k in np.unique(chosen[chosen >= 0]).tolist():
            at, image = np.flatnonzero(chosen == k), self._image(k)
            centred = place[::-1, at] / self._factor(k) - 0.5
            for band, values in zip(pixels, image, strict=False):
                band[at] = map_coordinates(values, centred, self.dtype, order=1, mode="nearest")
            pixels[-1, at] = np.iinfo(self.dtype).max
        return pixels.reshape(-1, *shape)

    def _factor(self, k: int) -> int:
        """Return how many pixels of a photograph are averaged to one, across and down."""
        view = self.views[k]
        return max(min(int(self.geobox.transform.a / view.gsd_m), *view.photograph.image_px), 1)

    def _image(self, k: int) -> NDArray[Any]:
        """Return a photograph, (bands, rows, cols), decoded now if it is not among those that are kept."""
        with self._lock:
            image = self._images.pop(k, None)
            if image is None:
                while self._images and sum(one.nbytes for one in self._images.values()) > CACHE_BYTES:
                    del self._images[next(iter(self._images))]
                image, side = inspect_file(self.views[k].photograph.path).read_whole(), self._factor(k)
                if side > 1:
                    rows, cols = (length // side for length in image.shape[1:])
                    blocks = image[:, : rows * side, : cols * side].reshape(-1, rows, side, cols, side)
                    image = np.rint(blocks.mean(axis=(2, 4), dtype=np.float32)).astype(self.dtype)
            self._images[k] = image
            return image


def _between(corners: Floats, shape: tuple[int, int]) -> Floats:
    """Interpolate from the corners of a tile (upper left and right, lower left and right) to its pixels."""
    down, across = ((np.arange(length) + 0.5) / length for length in shape)
    left = corners[0] + (corners[2] - corners[0]) * down
    right = corners[1] + (corners[3] - corners[1]) * down
    values: Floats = left[:, None] + (right - left)[:, None] * across
    return values.ravel()


def _types_of(photographs: Sequence[Photograph]) -> tuple[str, ...]:
    """Return the type of each band of photographs, which are all of one kind (PhotographError)."""
    kinds: dict[tuple[str, ...], str] = {}
    for one in photographs:
        file, (cols, rows) = inspect_file(one.path), one.image_px
        bands = zip(file.layout.dtypes, file.layout.roles, strict=True)
        types = tuple(dtype for dtype, role in bands if role != "alpha")
        if file.shape != (rows, cols) or rows * cols > MAX_IMAGE_PIXELS or set(types) not in _TYPES:
            raise PhotographError(
                f"{one.path} holds {file.shape[1]} x {file.shape[0]} pixels of {' and '.join(types)}; give "
                f"the photograph as it was taken, {cols} x {rows} by its tags, or a raw one as .tif, of "
                f"uint8 or uint16 and at most {MAX_IMAGE_PIXELS:,} pixels"
            )
        kinds.setdefault(types, one.path)
    if len(kinds) > 1:
        listed = "; ".join(f"{path} has bands of {', '.join(types)}" for types, path in kinds.items())
        raise PhotographError(f"{listed}: a mosaic is of photographs of one kind; make one of each")
    return next(iter(kinds))
