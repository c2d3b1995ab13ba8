"""One photograph from the air: where it was taken, where the camera looked, and its lens (pinhole model).

Angles are those of gimbals: yaw is the azimuth in which the camera looks, clockwise from north, pitch -90
straight down and 0 to the horizon, roll clockwise as seen from behind the camera; they turn about the
vertical, the right and the line of sight, in that order. Straight down, the top of the image lies in the
direction of yaw.
"""

import math

import numpy as np

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass

HORIZON_DEG = 88.0  # rays that are farther from straight down are taken to reach no ground


@dataclass(frozen=True, slots=True, kw_only=True)
class Photograph:
    """A photograph with its pose; heights are metres, and `relative_m` or `altitude_m` is known."""

    path: str
    lon: float  # of the camera, degrees (WGS 84)
    lat: float
    relative_m: float | None = None  # height above the place of takeoff
    altitude_m: float | None = None  # height above the sea, or above the ellipsoid (WGS 84)
    is_ellipsoidal: bool = False  # whether `altitude_m` is above the ellipsoid
    yaw_deg: float
    pitch_deg: float = -90.0
    roll_deg: float = 0.0
    image_px: tuple[int, int]  # columns and rows as they are stored
    focal_px: float  # focal length in pixels
    camera: str = ""  # make and model
    taken_s: float | None = None  # time of the exposure, in seconds since some moment
    exposure_s: float | None = None
    speed_m_s: float | None = None  # of the vehicle
    position_error_m: float | None = None  # standard deviation, where the file says so
    notes: tuple[str, ...] = ()  # what the file does not say and was assumed

    @property
    def axes(self) -> Floats:
        """Unit vectors (3, 3) of sight, right and down of the image, each metres east, north and up."""
        yaw, pitch, roll = np.radians([self.yaw_deg, self.pitch_deg, self.roll_deg])
        sight = np.array([math.cos(pitch) * math.sin(yaw), math.cos(pitch) * math.cos(yaw), math.sin(pitch)])
        level = np.array([math.cos(yaw), -math.sin(yaw), 0.0])
        below = np.cross(sight, level)
        right = math.cos(roll) * level + math.sin(roll) * below
        return np.stack([sight, right, np.cross(sight, right)])

    def rays(self, pixels: Floats) -> Floats:
        """Return the directions (n, 3) in which places of the image (n, 2) are seen: metres east, north, up.

        Places are columns and rows from the upper left corner of the image, whose middle is the principal
        point; directions are one focal length long along the line of sight.
        """
        offsets = np.asarray(pixels, float) - np.array(self.image_px) / 2
        seen: Floats = np.column_stack([np.full(len(offsets), self.focal_px), offsets]) @ self.axes
        return seen / self.focal_px

    def pixels(self, offsets_m: Floats) -> Floats:
        """Return pixels (2, n) of places (3, n), metres east, north, up; NaN behind. Inverse of `rays`."""
        east, north, up = offsets_m  # products one by one: those of matrices depend on their size
        ahead, right, below = (axis[0] * east + axis[1] * north + axis[2] * up for axis in self.axes)
        scale = np.divide(self.focal_px, ahead, out=np.full_like(ahead, np.nan), where=ahead > 0)
        return np.stack([right * scale + self.image_px[0] / 2, below * scale + self.image_px[1] / 2])

    def border(self, steps: int = 1) -> Floats:
        """Return places along the border of the image (4 steps, 2), clockwise from its upper left corner."""
        cols, rows = self.image_px
        corners = np.array([[0, 0], [cols, 0], [cols, rows], [0, rows]], float)
        along = np.roll(corners, -1, axis=0) - corners
        sides: Floats = corners[:, None] + np.arange(steps)[:, None] / steps * along[:, None]
        return sides.reshape(-1, 2)
