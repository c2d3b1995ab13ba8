"""Orthorectification: photographs are drawn on the ground by their pose, as one mosaic without blending."""

import math
import threading
from collections import OrderedDict
from collections.abc import Iterator, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from uavseg.arrays import Bools, Floats
from uavseg.dataclass import dataclass
from uavseg.errors import PhotographError
from uavseg.execution.executors import Map, Progress, serial, split_progress
from uavseg.flight.mission.track import Plane
from uavseg.photographs.ground import Ground
from uavseg.photographs.likely_error import likely_error_m
from uavseg.photographs.photograph import HORIZON_DEG, Photograph
from uavseg.photographs.read import grouped
from uavseg.raster.geodesy.globe import WGS84, Transform, transform_between, utm_crs, wrap_lon
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.inspect_file import inspect_file

TILE = 256  # pixels; within a tile, places on the planes of the cameras are linear to 1e-4 of a pixel
COARSEST = 4.0  # times the pixel on the ground in the middle of a photograph, which is drawn at most
MAX_PIXELS = 4_000_000_000  # of a mosaic
MAX_IMAGE_PIXELS = 178_956_970  # of a photograph, as Pillow reads at most
STRIP_BYTES, CACHE_BYTES = 64 << 20, 192 << 20  # of rows that are drawn at once, of decoded photographs
_NODES = 17  # places along each side of an image that are looked at beforehand
_AZIMUTHS, _RINGS = 720, 128  # of the heights around a camera that may hide others: 0.4 MB
_SUNK = 1e-3  # of the height of the camera: so far below a line of sight, ground is hidden


@dataclass(frozen=True, eq=False)
class View:
    """A photograph and the ground that is drawn of it."""

    photograph: Photograph
    plane: Plane
    height_m: float  # of the camera, as the heights of the ground
    gsd_m: float  # ground sampling distance across the line of sight, in the middle of the image
    coarsest_m: float  # side of a pixel on the ground, beyond which nothing is drawn
    bounds: Floats  # (4,), left, bottom, right and top on the map
    errors_m: tuple[float, float]  # likely error in the middle of the image, and where it is largest
    lean: float  # metres by which a place is off at the edge, for each metre that its height is
    drawn: float  # share of the image that is drawn
    reach_m: float  # how far away the ground is
    # (azimuths, rings), steepest slope to the ground up to each ring; None if nothing is hidden
    horizon: NDArray[np.float32] | None

    @classmethod
    def of(cls, photograph: Photograph, ground: Ground, to_xy: Transform) -> "View":
        """Look at the ground of a photograph; PhotographError if its middle shows none."""
        plane, height_m = Plane(photograph.lat, photograph.lon), ground.camera_height_m(photograph)
        along = np.linspace(0, 1, _NODES)
        pixels = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2) * photograph.image_px
        seen = ground.seen(photograph, pixels)
        offsets = seen - (0, 0, height_m)
        with np.errstate(invalid="ignore"):
            sides_m = _sides_m(offsets @ photograph.axes[0], -offsets[:, 2], photograph.focal_px)
            middle = len(sides_m) // 2
            drawn = sides_m <= COARSEST * sides_m[middle]
        if not drawn[middle]:
            where = "" if ground.dem is None else ", or beyond the elevation model"
            raise PhotographError(f"its middle looks to the horizon{where}")
        square = np.pad(drawn.reshape(_NODES, _NODES), 1)  # with neighbours, between which the edge lies
        near = np.lib.stride_tricks.sliding_window_view(square, (3, 3)).any(axis=(2, 3)).ravel()
        around = seen[near & np.isfinite(sides_m)]
        x, y = to_xy(*plane.lonlat_from_xy(around[:, 0], around[:, 1]))
        # Between the nodes, the outline of an image over hills may bulge.
        margin = 0.0 if ground.dem is None else max(np.ptp(x), np.ptp(y)) / (_NODES - 1)
        errors = likely_error_m(photograph, pixels[drawn], -offsets[drawn, 2])
        flat = np.hypot(offsets[:, 0], offsets[:, 1])
        reach_m = float(np.hypot(around[:, 0], around[:, 1]).max() + 2 * margin)
        return cls(
            photograph=photograph,
            plane=plane,
            height_m=height_m,
            gsd_m=float(np.linalg.norm(offsets[middle]) / photograph.focal_px),
            coarsest_m=float(COARSEST * sides_m[middle]),
            bounds=np.array([x.min() - margin, y.min() - margin, x.max() + margin, y.max() + margin]),
            errors_m=(float(errors[drawn[:middle].sum()]), float(np.nanmax(errors))),
            lean=float((flat[drawn] / -offsets[drawn, 2]).max()),
            drawn=float(drawn.mean()),
            reach_m=reach_m,
            horizon=None if ground.dem is None else _horizon(ground, plane, height_m, reach_m),
        )

    def places(self, east: Floats, north: Floats, up: Floats) -> tuple[Floats, Floats, Bools]:
        """Return columns and rows of ground (n,), in metres from the camera, and where it is drawn."""
        one = self.photograph
        ahead, right, below = (a[0] * east + a[1] * north + a[2] * up for a in one.axes)
        with np.errstate(divide="ignore", invalid="ignore"):
            col = one.focal_px * right / ahead + one.image_px[0] / 2
            row = one.focal_px * below / ahead + one.image_px[1] / 2
            drawn = (
                (ahead > 0) & (col >= 0) & (col <= one.image_px[0]) & (row >= 0) & (row <= one.image_px[1])
            )
            drawn &= -up > math.cos(math.radians(HORIZON_DEG)) * np.sqrt(east**2 + north**2 + up**2)
            drawn &= _sides_m(ahead, -up, one.focal_px) <= self.coarsest_m
        if self.horizon is not None:
            far = np.hypot(east, north)
            azimuth = np.rint(np.arctan2(east, north) * (_AZIMUTHS / math.tau)).astype(np.int64) % _AZIMUTHS
            # The ring before the last one, so that ground never hides itself.
            ring = np.minimum((far * (_RINGS / self.reach_m)).astype(np.int64), _RINGS) - 2
            slope = self.horizon[azimuth, np.maximum(ring, 0)]
            drawn &= (ring < 0) | (up > slope * far + _SUNK * up)
        return col, row, drawn


def _sides_m(ahead: Floats, below: Floats, focal_px: float) -> Floats:
    """Return the root of the area of a pixel on level ground, so far along the line of sight and below."""
    return np.sqrt(ahead**3 / below) / focal_px


def _horizon(ground: Ground, plane: Plane, height_m: float, reach_m: float) -> NDArray[np.float32] | None:
    """Return the steepest slope to the ground up to each ring, by azimuth; None if no ground is hidden."""
    azimuth = np.arange(_AZIMUTHS)[:, None] * (math.tau / _AZIMUTHS)
    far = np.arange(1, _RINGS + 1) * (reach_m / _RINGS)
    lon, lat = plane.lonlat_from_xy((np.sin(azimuth) * far).ravel(), (np.cos(azimuth) * far).ravel())
    slope = (ground.heights_m(lon, lat).reshape(_AZIMUTHS, _RINGS) - height_m) / far
    slope[np.isnan(slope)] = -np.inf
    highest = np.maximum.accumulate(slope, axis=1)
    hidden = slope[:, 1:] <= highest[:, :-1] + _SUNK * slope[:, 1:]
    return highest.astype(np.float32) if hidden.any() else None


@dataclass(frozen=True, eq=False)
class Mosaic:
    """Photographs, the ground that they show, and the grid on which they are drawn."""

    views: tuple[View, ...]
    ground: Ground
    geobox: GeoBox
    bands: int  # without alpha
    dtype: np.dtype[Any]
    warnings: tuple[str, ...]
    _to_lonlat: Transform = field(repr=False)
    _images: OrderedDict[int, NDArray[Any]] = field(default_factory=OrderedDict, repr=False)
    _lock: Any = field(default_factory=threading.Lock, repr=False)  # of PROJ, the model and the images

    @property
    def errors_m(self) -> tuple[float, float]:
        """Likely error in the middle of a photograph (the median), and where it is largest."""
        middle, edge = zip(*(view.errors_m for view in self.views), strict=True)
        return float(np.median(middle)), max(edge)

    def strips(
        self, map: Map = serial, progress: Progress | None = None
    ) -> Iterator[tuple[int, NDArray[Any]]]:
        """Yield strips from the top: first row, and pixels (bands and alpha, rows, cols).

        Executors, which must be threads, change nothing. A RasterReadError says that a photograph is damaged.
        """
        rows, cols = self.geobox.shape
        row_bytes = cols * (self.bands + 1) * self.dtype.itemsize
        tops = range(0, rows, max(STRIP_BYTES // row_bytes // TILE, 1) * TILE)
        reports = split_progress(progress, len(tops)) if progress else [None] * len(tops)
        for top, report in zip(tops, reports, strict=True):
            height = min(tops.step, rows - top)
            strip = np.zeros((self.bands + 1, height, cols), self.dtype)
            windows = [  # column by column, because strips are wide, and few photographs are kept
                Window(top + row, col, TILE, TILE).clipped((top + height, cols))
                for col in range(0, cols, TILE)
                for row in range(0, height, TILE)
            ]
            for window, pixels in zip(windows, map(self.tile, windows, report), strict=True):
                strip[(slice(None), *window.relative_to(Window(top, 0, height, cols)).slices)] = pixels
            yield top, strip

    def tile(self, window: Window) -> NDArray[Any]:
        """Draw a window of at most 256 x 256 pixels: (bands and alpha, rows, cols).

        Each pixel is of the photograph whose camera is nearest, in units of its focal length in pixels; of
        several, of the first. It is interpolated between four pixels, and alpha is 0 where none shows it.
        """
        shape = window.rows, window.cols
        size = window.rows * window.cols
        row, col = np.array([[0, 0, 1, 1], [0, 1, 0, 1]]) * np.array([shape]).T + [[window.row], [window.col]]
        x, y = self.geobox.xy_from_pixel(row, col)
        with self._lock:
            lon, lat = self._to_lonlat(x, y)
            heights = self._heights_m(lon, lat, shape)
            highest = heights.max(where=np.isfinite(heights), initial=-np.inf)
            near = []
            for k, view in enumerate(self.views):
                left, bottom, right, top = view.bounds
                if left < x[1] and right > x[0] and bottom < y[0] and top > y[2]:
                    xy = np.array(view.plane.xy_from_lonlat(lon, lat))
                    apart = np.maximum(np.maximum(xy.min(axis=1), -xy.max(axis=1)), 0)
                    above = max(view.height_m - highest, 0)
                    near.append((math.hypot(*apart, above) / view.photograph.focal_px, k, xy))
        best, chosen, place = np.full(size, np.inf), np.full(size, len(self.views)), np.zeros((2, size))
        for least, k, xy in sorted(near, key=lambda one: one[:2]):
            if least**2 > best.max():
                break
            view = self.views[k]
            ground = *(_between(corners, shape) for corners in xy), heights - view.height_m
            distance2 = (ground[0] ** 2 + ground[1] ** 2 + ground[2] ** 2) / view.photograph.focal_px**2
            closer = np.flatnonzero((distance2 < best) | ((distance2 == best) & (k < chosen)))
            *found, drawn = view.places(*(values[closer] for values in ground))
            closer = closer[drawn]
            best[closer], chosen[closer] = distance2[closer], k
            place[:, closer] = [values[drawn] for values in found]
        pixels = np.zeros((size, self.bands + 1), self.dtype)
        for k in np.unique(chosen[chosen < len(self.views)]).tolist():
            at = np.flatnonzero(chosen == k)
            pixels[at, :-1] = _bilinear(self._image(k), *place[:, at] / self._factor(k))
            pixels[at, -1] = np.iinfo(self.dtype).max
        return pixels.T.reshape(-1, *shape)

    def _heights_m(self, lon: Floats, lat: Floats, shape: tuple[int, int]) -> Floats:
        """Heights of the ground at the pixels of a tile with these corners."""
        dem = self.ground.dem
        if dem is None:
            return np.zeros(shape[0] * shape[1])
        corners = *dem.pixels(lon, lat), wrap_lon(lon, around=float(lon[0])), lat
        return dem.heights_at(*(_between(values, shape) for values in corners))

    def _factor(self, k: int) -> int:
        """Return how many pixels of a photograph are averaged to one, across and down."""
        return max(int(self.geobox.transform.a / self.views[k].gsd_m), 1)

    def _image(self, k: int) -> NDArray[Any]:
        """Return a photograph, (rows, cols, bands), decoded now if it is not among those that are kept."""
        with self._lock:
            if k not in self._images:
                while self._images and sum(one.nbytes for one in self._images.values()) > CACHE_BYTES:
                    self._images.popitem(last=False)
                image = inspect_file(self.views[k].photograph.path).read_whole()
                side = self._factor(k)
                if side > 1:
                    rows, cols = (max(length // side, 1) for length in image.shape[1:])
                    blocks = image[:, : rows * side, : cols * side].reshape(self.bands, rows, side, cols, -1)
                    image = np.rint(blocks.mean(axis=(2, 4), dtype=np.float32)).astype(self.dtype)
                self._images[k] = np.ascontiguousarray(np.moveaxis(image, 0, -1))
            self._images.move_to_end(k)
            return self._images[k]


def _between(corners: Floats, shape: tuple[int, int]) -> Floats:
    """Interpolate from the corners of a tile (upper left and right, lower left and right) to its pixels."""
    down, across = ((np.arange(length) + 0.5) / length for length in shape)
    left = corners[0] + (corners[2] - corners[0]) * down
    right = corners[1] + (corners[3] - corners[1]) * down
    values: Floats = left[:, None] + (right - left)[:, None] * across
    return values.ravel()


def _bilinear(image: NDArray[Any], col: Floats, row: Floats) -> NDArray[Any]:
    """Interpolate an image (rows, cols, bands) at places from its corner; (n, bands) of its type."""
    rows, cols, bands = image.shape
    row, col = np.clip(row - 0.5, 0, rows - 1), np.clip(col - 0.5, 0, cols - 1)
    top, left = row.astype(np.int64), col.astype(np.int64)
    down, across = ((row - top)[:, None].astype(np.float32), (col - left)[:, None].astype(np.float32))
    below, beside = (np.minimum(top + 1, rows - 1) - top) * cols, np.minimum(left + 1, cols - 1) - left
    flat, at = image.reshape(-1, bands), top * cols + left
    upper = flat[at] * (1 - across) + flat[at + beside] * across
    lower = flat[at + below] * (1 - across) + flat[at + below + beside] * across
    values: NDArray[Any] = np.rint(upper * (1 - down) + lower * down)
    return values.astype(image.dtype)


def mosaic_of(
    photographs: Sequence[Photograph],
    ground: Ground,
    pixel_m: float | None = None,
    progress: Progress | None = None,
) -> Mosaic:
    """Lay photographs on the ground, and a grid over them: in the UTM zone of their middle, north up.

    Pixels are squares of `pixel_m` metres, by default as large as those in the middle of the photographs (the
    median), and their edges are at multiples of that. A photograph that shows no ground is left out, with a
    warning. No pixels are decoded.

    A PhotographError says that none is left, that they differ in bands or type of their pixels, or that the
    mosaic would be too large; a RasterReadError that a file cannot be opened.
    """
    lons, lats = (np.array([getattr(one, name) for one in photographs]) for name in ("lon", "lat"))
    crs = utm_crs(float(lats.mean()), float(lons[0] + wrap_lon(lons - lons[0]).mean()))
    to_xy = transform_between(WGS84, crs.to_wkt())
    views, left = [], []
    for done, photograph in enumerate(photographs, start=1):
        try:
            views.append(View.of(photograph, ground, to_xy))
        except PhotographError as error:
            left.append((photograph.path, str(error)))
        if progress is not None:
            progress(done, len(photographs))
    left_out = grouped("left out, as ", left)
    if not views:
        raise PhotographError("; ".join(["no photograph shows ground that is known", *left_out]))
    bands, dtype = _pixels_of(views)
    side = pixel_m or float(f"{np.median([view.gsd_m for view in views]):.3g}")
    bounds = np.array([view.bounds for view in views])
    least, most = np.floor(bounds[:, :2].min(axis=0) / side), np.ceil(bounds[:, 2:].max(axis=0) / side)
    cols, rows = most - least
    if not rows * cols <= MAX_PIXELS:
        raise PhotographError(
            f"the photographs would be a mosaic of {cols:,.0f} x {rows:,.0f} pixels of {100 * side:g} cm, "
            f"and at most {MAX_PIXELS:,} are drawn: do all show one place? Give fewer, or a larger "
            "--resolution"
        )
    transform = Affine(side, 0.0, least[0] * side, 0.0, -side, most[1] * side)
    return Mosaic(
        views=tuple(views),
        ground=ground,
        geobox=GeoBox((int(rows), int(cols)), transform, crs),
        bands=bands,
        dtype=dtype,
        warnings=(*left_out, *_notes(views, ground)),
        _to_lonlat=transform_between(crs.to_wkt(), WGS84),
    )


def _pixels_of(views: Sequence[View]) -> tuple[int, np.dtype[Any]]:
    """Return number of bands and type of the photographs, which are all of one kind (PhotographError)."""
    kinds: dict[tuple[int, str], str] = {}
    for photograph in (view.photograph for view in views):
        path = photograph.path
        file = inspect_file(path)
        types = {
            one for one, role in zip(file.layout.dtypes, file.layout.roles, strict=True) if role != "alpha"
        }
        kind = sum(role != "alpha" for role in file.layout.roles), " and ".join(sorted(types))
        if file.shape != photograph.image_px[::-1]:
            raise PhotographError(
                f"{path} holds {file.shape[1]} x {file.shape[0]} pixels, and its tags say "
                f"{photograph.image_px[0]} x {photograph.image_px[1]}: give the photograph as it was taken, "
                "or a raw one as .tif"
            )
        if file.shape[0] * file.shape[1] > MAX_IMAGE_PIXELS:
            raise PhotographError(f"{path} has more than {MAX_IMAGE_PIXELS:,} pixels, which are not decoded")
        if kind[1] not in ("uint8", "uint16"):
            raise PhotographError(f"{path} has pixels of {kind[1]}; photographs have uint8 or uint16")
        kinds.setdefault(kind, path)
        if len(kinds) > 1:
            (one, first), (other, second) = kinds.items()
            raise PhotographError(
                f"{first} has bands and type {one[0]} x {one[1]}, {second} {other[0]} x {other[1]}: a mosaic "
                "is of photographs of one kind; make one of each"
            )
    (count, name), _ = kinds.popitem()
    return count, np.dtype(name)


def _notes(views: Sequence[View], ground: Ground) -> list[str]:
    """Return which heights are doubtful, what is not drawn, and how far off places may be."""
    doubts = [(one.path, note) for one in (view.photograph for view in views) for note in ground.notes(one)]
    notes = grouped("", doubts)
    least = min(views, key=lambda view: view.drawn)
    if least.drawn < 1:
        beyond = "" if ground.dem is None else ", or lies beyond the elevation model"
        notes.append(
            f"up to {100 * (1 - least.drawn):.0f} % of a photograph ({Path(least.photograph.path).name}) is "
            f"not drawn: it is near the horizon, {COARSEST:g} times as coarse as the middle{beyond}"
        )
    if ground.dem is None:
        lean = max(view.lean for view in views)
        notes.append(
            "the ground is taken to be as high as the place of takeoff; what is 1 m higher or lower lies up "
            f"to {lean:.2g} m off its place: give an elevation model with --dem"
        )
    return notes
