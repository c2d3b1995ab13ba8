"""Cameras (pinhole model): ground sampling distance and footprint on flat ground from height and pitch.

The formulas are those of vertical and low oblique photographs: P. R. Wolf, B. A. Dewitt and B. E. Wilkinson,
Elements of Photogrammetry with Applications in GIS, 4th edition (2014), chapters 6 (scale of a vertical
photograph, H f / H) and 18 (project planning: end lap and side lap).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import ParameterError
from uavseg.plain_text import shown

NADIR_DEG = -90.0
HIGHEST_PITCH_DEG = -30.0
"""The flattest gimbal pitch: beyond it the upper edge of most images comes near the horizon."""
_GREATEST = 1e7  # of any size, so that no product of them overflows


@dataclass(frozen=True, slots=True)
class Camera:
    """A camera, mounted with the longer side of its image across the direction of flight.

    Parameters
    ----------
    name : str
    sensor_mm : (float, float)
        Width and height of the sensor's image area, across and along the direction of flight.
    image_px : (int, int)
        Columns and rows of an image.
    focal_mm : float
        Focal length of the lens, not its 35 mm equivalent.
    min_interval_s : float
        Shortest time between two photographs; 0 if it is not known.

    Raises
    ------
    ParameterError
        If a number is not positive or above 1e7, or pixels are not square within 10 %.

    Examples
    --------
    >>> camera = Camera("DJI Phantom 4 Pro", (13.2, 8.8), (5472, 3648), 8.8, 2)
    >>> round(100 * camera.gsd_m(60), 2), [round(side, 1) for side in camera.footprint_m(60)]
    (1.64, [90.0, 60.0])
    """

    name: str
    sensor_mm: tuple[float, float]
    image_px: tuple[int, int]
    focal_mm: float
    min_interval_s: float = 0.0

    def __post_init__(self) -> None:
        sizes = (*self.sensor_mm, *self.image_px, self.focal_mm)
        if not all(0 < size <= _GREATEST for size in sizes):
            raise ParameterError(
                f"the sizes of the camera {self.name} must be numbers above 0, at most {_GREATEST:g}, not "
                f"{', '.join(map(shown, sizes))}"
            )
        if not 0 <= self.min_interval_s <= _GREATEST:
            raise ParameterError(
                f"the least interval of {self.name} is 0 to {_GREATEST:g} s, not {shown(self.min_interval_s)}"
            )
        across, along = (mm / px for mm, px in zip(self.sensor_mm, self.image_px, strict=True))
        if not 0.9 < across / along < 1.1:
            raise ParameterError(
                f"the camera {self.name} has pixels of {1000 * across:.2f} x {1000 * along:.2f} micrometres, "
                "which are not square; are width and height in the same order for sensor and image?"
            )

    def gsd_m(self, height_m: float, pitch_deg: float = NADIR_DEG) -> float:
        """Ground sampling distance (GSD) in metres, across the flight direction in the middle of the image.

        Height above the ground times the pixel size over the focal length, H p / f; with a tilted camera the
        slant distance takes the place of the height.
        """
        return self._slant_m(height_m, pitch_deg) * self.sensor_mm[0] / (self.focal_mm * self.image_px[0])

    def height_m(self, gsd_m: float, pitch_deg: float = NADIR_DEG) -> float:
        """Height above the ground that gives this ground sampling distance; the inverse of `gsd_m`."""
        return gsd_m / self.gsd_m(1.0, pitch_deg)

    def footprint_m(self, height_m: float, pitch_deg: float = NADIR_DEG) -> tuple[float, float]:
        """Width across the direction of flight, and length along it, that one image surely shows.

        Flat ground. With a tilted camera the footprint is a trapezoid: its width is that of the near edge.
        """
        near, far = self.ground_reach_m(height_m, pitch_deg)
        corners = self.footprint_corners_m(height_m, pitch_deg)
        return float(corners[1, 0] - corners[0, 0]), far - near

    def ground_reach_m(self, height_m: float, pitch_deg: float = NADIR_DEG) -> tuple[float, float]:
        """Positions of the near and the far edge of the footprint, ahead of the camera, in metres."""
        corners = self.footprint_corners_m(height_m, pitch_deg)
        return float(corners[0, 1]), float(corners[2, 1])

    def footprint_corners_m(self, height_m: float, pitch_deg: float = NADIR_DEG) -> NDArray[np.float64]:
        """Corners of the footprint on flat ground: near left, near right, far right, far left.

        Returns
        -------
        corners : (4, 2) float64 array
            Metres to the right of the camera and ahead of it.

        Raises
        ------
        ParameterError
            If the camera looks higher than -30 degrees, or its upper edge above the horizon.
        """
        check_pitch(pitch_deg)
        half_across, half_along = (size / 2 / self.focal_mm for size in self.sensor_mm)
        tilt = math.radians(pitch_deg - NADIR_DEG)  # from straight down
        if tilt + math.atan(half_along) >= math.radians(88):
            raise ParameterError(
                f"with a gimbal pitch of {pitch_deg:g} degrees the camera {self.name} sees the horizon; "
                "give a steeper pitch, -90 is straight down"
            )
        corners = []
        for along, across in (
            (-half_along, -half_across),
            (-half_along, half_across),
            (half_along, half_across),
            (half_along, -half_across),
        ):
            down = math.cos(tilt) - along * math.sin(tilt)
            ahead = math.sin(tilt) + along * math.cos(tilt)
            corners.append((across / down * height_m, ahead / down * height_m))
        return np.array(corners)

    def max_speed_m_s(self, height_m: float, trigger_m: float, shutter_s: float, blur_px: float) -> float:
        """Highest speed at which the camera keeps up and photographs are sharp.

        Parameters
        ----------
        height_m : float
            Above the ground.
        trigger_m : float
            Distance between photographs; infinite if they are taken in hover.
        shutter_s : float
            Exposure time.
        blur_px : float
            Pixels by which the ground may move during the exposure: v t <= b GSD.
        """
        keeps_up = trigger_m / self.min_interval_s if self.min_interval_s else math.inf
        return min(keeps_up, blur_px * self.gsd_m(height_m) / shutter_s)

    def _slant_m(self, height_m: float, pitch_deg: float) -> float:
        check_pitch(pitch_deg)
        return height_m / math.sin(math.radians(-pitch_deg))


def check_pitch(pitch_deg: float) -> None:
    """Raise ParameterError unless a gimbal pitch lies in -90 (straight down) to -30 degrees."""
    if not NADIR_DEG <= pitch_deg <= HIGHEST_PITCH_DEG:
        raise ParameterError(
            f"a gimbal pitch lies between -90 (straight down) and -30 degrees, not {pitch_deg:g}"
        )


@dataclass(frozen=True, slots=True)
class Overlap:
    """Overlap of photographs: shares of the footprint that the next image along and beside shows again.

    Parameters
    ----------
    front, side : float
        Per cent, from 0 to below 100.

    Raises
    ------
    ParameterError
        If a number is out of bounds.
    """

    front: float
    side: float

    def __post_init__(self) -> None:
        if not (0 <= self.front < 100 and 0 <= self.side < 100):
            raise ParameterError(
                f"overlaps are per cent from 0 to below 100, such as 75,70, not {self.front:g},{self.side:g}"
            )

    def spacing_m(self, footprint_m: tuple[float, float]) -> tuple[float, float]:
        """Distance between lines, and between photographs along a line, in metres."""
        across, along = footprint_m
        return across * (1 - self.side / 100), along * (1 - self.front / 100)
