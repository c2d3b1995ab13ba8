"""The ground that photographs show: flat, or an elevation model."""

import math
from collections.abc import Callable, Sequence
from dataclasses import field
from typing import TypeVar

import numpy as np
import shapely

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, PhotographError
from uavseg.execution.executors import Progress
from uavseg.flight.mission.items import HomePosition
from uavseg.flight.mission.track import Plane
from uavseg.photographs.read import HORIZON_DEG, Photograph, grouped
from uavseg.plain_text import shown
from uavseg.raster.elevation.dem import Dem, SeaHeights, sea_from_ellipsoid

Result = TypeVar("Result")
BORDER_STEPS = 16  # places per side of an image whose ground is computed over an elevation model
DOUBT = 0.2  # share by which two heights above the ground may differ
_STEPS = 128  # along a ray, down to the height of the ground below the camera
_FARTHEST = 8  # times that length, after which a ray is taken to reach no ground
_HALVINGS = 18  # of a step, to where a ray meets the ground


@dataclass(frozen=True)
class Ground:
    """What cameras look at, and what heights are measured from.

    Without `dem` the ground is flat, at the height of the place of takeoff, and heights are above it. With it
    they are those of the model. `home` is the place of takeoff: latitude and longitude in degrees, and its
    height above the sea in metres where that is given: a ParameterError or a MissionError says that it is not
    on Earth.
    """

    dem: Dem | None = None
    home: tuple[float, ...] | None = None
    to_sea: SeaHeights | None = field(default_factory=sea_from_ellipsoid, repr=False)

    def __post_init__(self) -> None:
        if self.home is not None:
            if len(self.home) not in (2, 3):
                raise ParameterError(f"home is (lat, lon) or (lat, lon, altitude_m), not {shown(self.home)}")
            HomePosition(*self.home)

    def camera_height_m(self, photograph: Photograph) -> float:
        """Return the height of a camera: above the flat ground, or as the elevation model has heights.

        It is the height above takeoff where the height of that place is known, else the altitude. A
        PhotographError says that neither gives a height, or that the camera is not above the ground.
        """
        relative, home = photograph.relative_m, self.home
        below = self._ground_m(photograph.lon, photograph.lat)
        if relative is not None and self.dem is None:
            height = relative
        elif relative is not None and home is not None:
            start = home[2:] or (self._ground_m(home[1], home[0], "the place of takeoff of --home"),)
            height = relative + start[0]
        elif self.dem is None and (home is None or len(home) == 2):
            raise PhotographError(
                "it has no height above takeoff: give the height of the ground above the sea with --home "
                "LAT,LON,M, or an elevation model with --dem"
            )
        else:
            height = self._altitude_m(photograph) - (home[2] if self.dem is None and home else 0.0)
        if height <= below:
            raise PhotographError(
                f"its height is {below - height:.1f} m below the ground; is it above the ellipsoid, or the "
                "place of takeoff another one? Give that with --home LAT,LON,M"
            )
        return height

    def _ground_m(self, lon: float, lat: float, place: str = "the place where it was taken") -> float:
        height = float(self.heights_m(np.array([lon]), np.array([lat]))[0])
        if math.isnan(height):
            raise PhotographError(f"the elevation model does not cover {place}")
        return height

    def _altitude_m(self, photograph: Photograph) -> float:
        altitude = photograph.altitude_m
        if altitude is None:
            raise PhotographError(
                "it has no height above the sea, nor one above takeoff with its place (--home LAT,LON)"
            )
        if not photograph.is_ellipsoidal or (self.dem is not None and not self.dem.is_above_sea):
            return altitude
        if self.to_sea is None:
            raise PhotographError(
                "its altitude is above the ellipsoid, and PROJ has no geoid here to convert it: give the "
                "place of takeoff with --home"
            )
        lon, lat = np.array([photograph.lon]), np.array([photograph.lat])
        return float(self.to_sea(lon, lat, np.array([altitude]))[0])

    def notes(self, photograph: Photograph) -> tuple[str, ...]:
        """Return what makes the height of a camera above an elevation model doubtful.

        Height above takeoff and altitude are compared where both are known; without the place of takeoff, as
        if it were as high as the ground below.
        """
        relative = photograph.relative_m
        if self.dem is None or relative is None or photograph.altitude_m is None:
            return ()
        below = self._ground_m(photograph.lon, photograph.lat)
        above = self.camera_height_m(photograph) - below
        try:
            other = relative if self.home is None else self._altitude_m(photograph) - below
        except PhotographError:  # above the ellipsoid, and there is no geoid
            return ()
        if abs(other - above) <= DOUBT * max(above, other):
            return ()
        if self.home is not None:
            return (f"{above:.0f} m above the ground by takeoff, but {other:.0f} m by altitude",)
        return (
            f"{above:.0f} m above the ground by altitude, but {relative:.0f} m above takeoff: if takeoff was "
            "as high as the ground below, give its place with --home",
        )

    def each(
        self,
        photographs: Sequence[Photograph],
        make: Callable[[Photograph], Result],
        progress: Progress | None = None,
    ) -> tuple[list[Result], list[str]]:
        """Return what is made of each photograph, and notes: what is left out, doubtful or assumed.

        One of which `make` raises a PhotographError is left out; a PhotographError says that none is left.
        """
        made: list[Result] = []
        left: list[tuple[str, str]] = []
        doubts: list[tuple[str, str]] = []
        for done, one in enumerate(photographs, start=1):
            try:
                made.append(make(one))
                doubts += [(one.path, note) for note in self.notes(one)]
            except PhotographError as error:
                left.append((one.path, str(error)))
            if progress is not None:
                progress(done, len(photographs))
        left_out = grouped("left out, as ", left)
        if not made:
            raise PhotographError("; ".join(["no photograph shows ground that is known", *left_out]))
        return made, [*left_out, *grouped("", doubts), *([] if self.dem is None else self.dem.notes())]

    def heights_m(self, lon: Floats, lat: Floats) -> Floats:
        """Return heights of the ground at places in degrees, (n,); NaN where the model has none."""
        return np.zeros(len(lon)) if self.dem is None else self.dem.heights_m(lon, lat)

    def seen(self, photograph: Photograph, pixels: Floats) -> Floats:
        """Return the ground (n, 3) that places of an image (n, 2) show: metres east, north and up.

        East and north are on the plane around the camera, up is the height of the ground. NaN where a ray
        meets no ground, or comes near the horizon. A PhotographError as of `camera_height_m`.
        """
        height_m = self.camera_height_m(photograph)
        rays = photograph.rays(pixels)
        down = -rays[:, 2]
        steep = down > np.linalg.norm(rays, axis=1) * math.cos(math.radians(HORIZON_DEG))
        below = self._ground_m(photograph.lon, photograph.lat)
        lengths = np.divide(height_m - below, down, out=np.full_like(down, np.nan), where=steep)
        if self.dem is not None:
            lengths = self._met(Plane(photograph.lat, photograph.lon), rays, height_m, lengths)
        seen: Floats = rays * lengths[:, None]
        seen[:, 2] += height_m
        return seen

    def _met(self, plane: Plane, rays: Floats, height_m: float, level: Floats) -> Floats:
        """Return where rays first meet the elevation model, in lengths of the rays; NaN where nowhere."""

        def above(rays: Floats, lengths: Floats) -> Floats:
            """Return heights above the ground, at lengths (n, k) along rays (n, 3)."""
            places = rays[:, None] * lengths[..., None]
            lon, lat = plane.lonlat_from_xy(places[..., 0].ravel(), places[..., 1].ravel())
            clear: Floats = height_m + places[..., 2] - self.heights_m(lon, lat).reshape(lengths.shape)
            return clear

        far = np.full(len(rays), np.nan)
        left = np.flatnonzero(np.isfinite(level))
        for turn in range(_FARTHEST if len(left) else 0):
            lengths = level[left, None] * (turn + np.arange(1, _STEPS + 1) / _STEPS)
            clear = above(rays[left], lengths)
            stops = ~(clear > 0)  # at the ground, or where it is not known
            rows, first = np.arange(len(left)), stops.argmax(axis=1)
            met = clear[rows, first] <= 0
            far[left[met]] = lengths[rows, first][met]
            left = left[~stops.any(axis=1)]
            if not len(left):
                break
        met = np.isfinite(far)
        low, high = (far - level / _STEPS)[met], far[met]
        for _ in range(_HALVINGS if met.any() else 0):
            middle = (low + high) / 2
            is_clear = above(rays[met], middle[:, None])[:, 0] > 0
            low, high = np.where(is_clear, middle, low), np.where(is_clear, high, middle)
        far[met] = high
        return far

    def footprint(self, photograph: Photograph) -> shapely.Polygon:
        """Return the outline of the ground that a photograph shows, in degrees (lon, lat; WGS 84).

        Longitudes go on beyond 180 degrees where it lies across the antimeridian. Over an elevation model
        the outline has `BORDER_STEPS` corners per side. A PhotographError as of `camera_height_m`, or says
        that part of the image is near the horizon, beyond the elevation model, or that there is none.
        """
        seen = self.seen(photograph, photograph.border(1 if self.dem is None else BORDER_STEPS))
        if not np.isfinite(seen).all():
            where = "" if self.dem is None else ", or beyond the elevation model"
            raise PhotographError(f"a part of it looks to the horizon{where}")
        lon, lat = Plane(photograph.lat, photograph.lon).lonlat_from_xy(seen[:, 0], seen[:, 1])
        lon = photograph.lon + (lon - photograph.lon + 180) % 360 - 180
        outline = shapely.Polygon(np.column_stack([lon, lat]))
        if not outline.is_valid:
            outline = shapely.make_valid(outline, method="structure", keep_collapsed=False)
        if outline.is_empty:
            raise PhotographError("the ground that it shows has no area")
        return outline
