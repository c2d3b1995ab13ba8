"""Cameras (pinhole model): footprint on flat ground, a catalogue, and the photographs of a flight.

The formulas are those of vertical and low oblique photographs: P. R. Wolf, B. A. Dewitt and B. E. Wilkinson,
Elements of Photogrammetry with Applications in GIS, 4th edition (2014), chapters 6 (scale of a vertical
photograph, H f / H) and 18 (project planning: end lap and side lap).
"""

import csv
import math
from collections.abc import Mapping
from functools import cache
from importlib import resources
from pathlib import Path

import numpy as np

from uavseg.arrays import Floats, Path_
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.inputs import number_in, read_object, text_in
from uavseg.plain_text import shown

NADIR_DEG = -90.0
HIGHEST_PITCH_DEG = -30.0
"""The flattest gimbal pitch: above it the upper edge of most images comes near the horizon."""
_MAXIMUM = 1e7  # of any size, so that no product of them overflows
TRIGGERS = ("distance", "interval", "hover", "none")
SHUTTER_S = 1 / 1000  # exposure time in daylight, by which motion blur is estimated
LONGEST_SHUTTER_S, SHORTEST_SHUTTER_S = 1.0, 1e-6
BLUR_PX = 1.0  # pixels by which the ground may move during the exposure
LAST_PHOTO_M = 5.0
"""The last photograph of a line is planned so far before its end.

The vehicle leaves a line up to 2 m before its end (the radius of waypoints), its first photograph is taken up
to 2 m after the start, and each one some centimetres late: with less, simulated flights lost the last one.
"""
TURNED_M = 10.0  # after which a vehicle that turns around at the start of a line is taken to look along it
ONE_PHOTO_M = 5.0  # lines that are no longer have one photograph, at their start
INTERVAL_STEP_S = 0.01


@dataclass(frozen=True, slots=True)
class Camera:
    """A camera, mounted with the longer side of its image across the direction of flight.

    A ParameterError says that a number is not positive or above 1e7, or pixels are not square within 10 %.

    Examples
    --------
    >>> camera = Camera("DJI Phantom 4 Pro", (13.2, 8.8), (5472, 3648), 8.8, 2)
    >>> round(100 * camera.gsd_m(60), 2), [round(side, 1) for side in camera.footprint_m(60)]
    (1.64, [90.0, 60.0])
    """

    name: str
    sensor_mm: tuple[float, float]  # width and height of the image area, across and along the flight
    image_px: tuple[int, int]  # columns and rows
    focal_mm: float  # not the 35 mm equivalent
    min_interval_s: float = 0.0  # between two photographs; 0 if it is not known

    def __post_init__(self) -> None:
        sizes = (*self.sensor_mm, *self.image_px, self.focal_mm)
        if not all(0 < size <= _MAXIMUM for size in sizes):
            raise ParameterError(
                f"the sizes of the camera {self.name} must be numbers above 0, at most {_MAXIMUM:g}, not "
                f"{', '.join(map(shown, sizes))}"
            )
        if not 0 <= self.min_interval_s <= _MAXIMUM:
            raise ParameterError(
                f"the least interval of {self.name} is 0 to {_MAXIMUM:g} s, not {shown(self.min_interval_s)}"
            )
        across, along = (mm / px for mm, px in zip(self.sensor_mm, self.image_px, strict=True))
        if not 0.9 < across / along < 1.1:
            raise ParameterError(
                f"the camera {self.name} has pixels of {1000 * across:.2f} x {1000 * along:.2f} micrometres, "
                "which are not square; are width and height in the same order for sensor and image?"
            )

    def as_dict(self) -> dict[str, str | float]:
        """Return the contents of the JSON file of this camera; the inverse of `read_camera`."""
        sizes = dict(zip(_KEYS, (*self.sensor_mm, *self.image_px, self.focal_mm), strict=True))
        return {"name": self.name, **sizes, "min_interval_s": self.min_interval_s}

    @property
    def focal_px(self) -> float:
        """The focal length in pixels."""
        return self.focal_mm * self.image_px[0] / self.sensor_mm[0]

    def gsd_m(self, height_m: float, pitch_deg: float = NADIR_DEG) -> float:
        """Return the ground sampling distance (GSD) in metres, across the flight, in the image centre.

        Height above the ground times the pixel size over the focal length, H p / f; with a tilted camera the
        slant distance takes the place of the height.
        """
        check_pitch(pitch_deg)
        slant_m = height_m / math.sin(math.radians(-pitch_deg))
        return slant_m * self.sensor_mm[0] / (self.focal_mm * self.image_px[0])

    def height_m(self, gsd_m: float, pitch_deg: float = NADIR_DEG) -> float:
        """Return the height above the ground for a ground sampling distance; the inverse of `gsd_m`."""
        return gsd_m / self.gsd_m(1.0, pitch_deg)

    def footprint_m(self, height_m: float, pitch_deg: float = NADIR_DEG) -> tuple[float, float]:
        """Return the width across the direction of flight, and length along it, that one image surely shows.

        Flat ground. With a tilted camera the footprint is a trapezoid: its width is that of the near edge.
        """
        near, far = self.ground_reach_m(height_m, pitch_deg)
        corners = self.footprint_corners_m(height_m, pitch_deg)
        return float(corners[1, 0] - corners[0, 0]), far - near

    def ground_reach_m(self, height_m: float, pitch_deg: float = NADIR_DEG) -> tuple[float, float]:
        """Return the positions of the near and far edge of the footprint, in metres ahead of the camera."""
        corners = self.footprint_corners_m(height_m, pitch_deg)
        return float(corners[0, 1]), float(corners[2, 1])

    def footprint_corners_m(self, height_m: float, pitch_deg: float = NADIR_DEG) -> Floats:
        """Return the corners of the footprint on flat ground: near left, near right, far right, far left.

        They are (4, 2), metres to the right of the camera and ahead of it. A ParameterError says that the
        pitch is above -30 degrees, or the upper edge of the image above the horizon.
        """
        check_pitch(pitch_deg)
        half_across, half_along = (size / 2 / self.focal_mm for size in self.sensor_mm)
        tilt = math.radians(pitch_deg - NADIR_DEG)  # from straight down
        if tilt + math.atan(half_along) >= math.radians(88):
            raise ParameterError(
                f"with a gimbal pitch of {pitch_deg:g} degrees the camera {self.name} sees the horizon; "
                "give a steeper pitch, -90 is straight down"
            )
        along, across = half_along * np.array([-1, -1, 1, 1]), half_across * np.array([-1, 1, 1, -1])
        down = math.cos(tilt) - along * math.sin(tilt)
        ahead = math.sin(tilt) + along * math.cos(tilt)
        return np.column_stack([across / down * height_m, ahead / down * height_m])

    def max_speed_m_s(self, height_m: float, trigger_m: float, shutter_s: float, blur_px: float) -> float:
        """Return the maximum speed for sharp photographs a distance apart (m): v t <= blur_px GSD."""
        by_interval = trigger_m / self.min_interval_s if self.min_interval_s else math.inf
        return min(by_interval, blur_px * self.gsd_m(height_m) / shutter_s)


def check_pitch(pitch_deg: float) -> None:
    """Refuse a gimbal pitch outside of -90 (straight down) to -30 degrees (ParameterError)."""
    if not NADIR_DEG <= pitch_deg <= HIGHEST_PITCH_DEG:
        raise ParameterError(
            f"a gimbal pitch lies between -90 (straight down) and -30 degrees, not {pitch_deg:g}"
        )


@dataclass(frozen=True, slots=True)
class Overlap:
    """Shares in per cent that the next image along and beside shows too, 0 to below 100 (ParameterError)."""

    front: float
    side: float

    def __post_init__(self) -> None:
        if not (0 <= self.front < 100 and 0 <= self.side < 100):
            raise ParameterError(
                f"overlaps are per cent from 0 to below 100, such as 75,70, not {self.front:g},{self.side:g}"
            )

    def spacing_m(self, footprint_m: tuple[float, float]) -> tuple[float, float]:
        """Return the distance between lines, and between photographs along a line, in metres."""
        across, along = footprint_m
        return across * (1 - self.side / 100), along * (1 - self.front / 100)


_KEYS = ("sensor_width_mm", "sensor_height_mm", "image_width_px", "image_height_px", "focal_mm")


@cache
def cameras() -> tuple[Camera, ...]:
    """Read all cameras of the catalogue, sorted by name."""
    text = resources.files("uavseg.flight.camera").joinpath("cameras.csv").read_text(encoding="utf-8")
    rows = csv.DictReader(text.splitlines())
    return tuple(
        _camera({key: float(row[key]) for key in (*_KEYS, "min_interval_s")}, row["name"]) for row in rows
    )


def find_cameras(text: str) -> list[Camera]:
    """Find the cameras whose name has all words of a text, in any case and order.

    Examples
    --------
    >>> [camera.name for camera in find_cameras("mavic thermal")]
    ['DJI Mavic 3 Thermal', 'DJI Mavic 3 Thermal wide']
    """
    words = _plain(text).split()
    return [camera for camera in cameras() if all(word in _plain(camera.name) for word in words)]


def camera_named(name: Path_ | Camera) -> Camera:
    """Return a camera by its name in the catalogue, or from a JSON file; a camera as it is.

    `name` is a name in any case, a part of one that only one camera has, or a file that ends in .json. A
    ParameterError says that there is no such camera (with the nearest names), that several have the words, or
    that the file is not that of a camera.
    """
    if isinstance(name, Camera):
        return name
    if str(name).lower().endswith(".json"):
        return read_camera(name)
    plain = _plain(str(name))
    exact = [camera for camera in cameras() if _plain(camera.name) == plain]
    matches = exact or (find_cameras(plain) if plain else [])
    if len(matches) == 1:
        return matches[0]
    if matches:
        names = ", ".join(camera.name for camera in matches[:6])
        raise ParameterError(f"several cameras are called {name}: {names}; give the whole name")
    import difflib

    near = difflib.get_close_matches(plain, [_plain(camera.name) for camera in cameras()], 3, 0.4)
    names = ", ".join(camera.name for text in near for camera in cameras() if _plain(camera.name) == text)
    hint = f"the nearest names are {names}" if names else "uavseg cameras lists those that are known"
    raise ParameterError(f"there is no camera called {name}; {hint}")


def read_camera(path: Path_) -> Camera:
    """Read a camera from a JSON file.

    An object with ``sensor_width_mm, sensor_height_mm, image_width_px, image_height_px, focal_mm`` and, if
    they are known, ``name`` and ``min_interval_s``. A ParameterError says that the file cannot be read, a key
    is missing or unknown, or a value is not a number.
    """
    expected = f"{', '.join(_KEYS)} and, if they are known, name and min_interval_s"
    given = read_object(path, "camera", expected)
    if not set(_KEYS) <= set(given) <= {*_KEYS, "name", "min_interval_s"}:
        raise ParameterError(f"{path} is not a camera; expected a JSON object with {expected}")
    numbers = {key: number_in(given, key, path, "camera") for key in given if key != "name"}
    return _camera(numbers, text_in(given, "name", Path(path).stem, path, "camera"))


def _camera(numbers: Mapping[str, float], name: str) -> Camera:
    width, height, cols, rows, focal_mm = (numbers[key] for key in _KEYS)
    for side in (cols, rows):
        if not side.is_integer():
            raise ParameterError(f"an image of the camera {name} has a whole number of pixels, not {side:g}")
    interval_s = numbers.get("min_interval_s", 0.0)
    return Camera(
        name=name,
        sensor_mm=(width, height),
        image_px=(int(cols), int(rows)),
        focal_mm=focal_mm,
        min_interval_s=interval_s,
    )


def _plain(name: str) -> str:
    """Return a name in lower case with single spaces, without punctuation."""
    return " ".join("".join(c if c.isalnum() else " " for c in name.lower()).split())


@dataclass(frozen=True, slots=True)
class Photos:
    """Photographs of a flight: camera, overlap, gimbal pitch, trigger, exposure time.

    A ParameterError says that a pitch or the exposure time is out of bounds, a pitch is given twice, or the
    trigger is not known.

    With `trigger`, photographs are taken by metres, by seconds, in hover at a waypoint for each, or not by
    the mission.
    """

    camera: Camera
    overlap: Overlap = Overlap(75, 70)
    pitch_deg: float = NADIR_DEG  # gimbal pitch: -90 is straight down
    trigger: str = "distance"  # "distance", "interval", "hover" or "none"
    shutter_s: float = SHUTTER_S  # exposure time, by which motion blur is estimated
    flatter_deg: tuple[float, ...] = ()  # further pitches, ascending, each flown over the region again

    def __post_init__(self) -> None:
        pitches = (self.pitch_deg, *self.flatter_deg)
        for pitch in pitches:
            check_pitch(pitch)
        if list(pitches) != sorted(set(pitches)):
            given = ", ".join(map(shown, pitches))
            raise ParameterError(f"each gimbal pitch is given once, the steepest first, not {given}")
        if self.trigger not in TRIGGERS:
            raise ParameterError(f"a trigger is one of {', '.join(TRIGGERS)}, not {self.trigger!r}")
        if not SHORTEST_SHUTTER_S <= self.shutter_s <= LONGEST_SHUTTER_S:
            raise ParameterError(
                f"an exposure time is at most a second, such as 1/1000, not {self.shutter_s:g} s"
            )

    def spacing_m(self, height_m: float) -> float:
        """Return the distance between lines at a height above the ground."""
        return self.overlap.spacing_m(self.camera.footprint_m(height_m, self.pitch_deg))[0]

    def trigger_m(self, height_m: float) -> float:
        """Return the maximum distance between photographs along a line."""
        return self.overlap.spacing_m(self.camera.footprint_m(height_m, self.pitch_deg))[1]

    def reach_m(self, height_m: float) -> float:
        """Return the ground that a photograph shows past the end of a line, in either direction of flight."""
        near, far = self.camera.ground_reach_m(height_m, self.pitch_deg)
        return max(min(-near, far), 0.0)

    def line_reach_m(self, height_m: float) -> float:
        """Return the ground that photographs surely show past the ends of a line; 0 without a trigger.

        The last one may be taken before the end, by `LAST_PHOTO_M` or the distance of an interval.
        """
        if self.trigger == "none":
            return 0.0
        reach = self.reach_m(height_m)
        before_end = {"hover": 0.0, "distance": LAST_PHOTO_M, "interval": self.trigger_m(height_m)}
        return max(reach - before_end[self.trigger], 0.0)

    def side_reach_m(self, height_m: float) -> float:
        """Return by how much lines may be shorter than the ground that is seen along them from either end.

        Mostly it is negative: a tilted camera sees an edge from outside only. Lines begin a photograph
        earlier, for the first may be taken before the vehicle looks along them.
        """
        near, _ = self.camera.ground_reach_m(height_m, self.pitch_deg)
        return -near - max(self.trigger_m(height_m), TURNED_M)

    def min_line_m(self, height_m: float) -> float:
        """Return the length of the shortest line whose two photographs are not too close for a fair speed."""
        return max(min(self.trigger_m(height_m), self.reach_m(height_m)) / 2 + LAST_PHOTO_M, ONE_PHOTO_M)

    def max_speed_m_s(self, height_m: float, trigger_m: float) -> float:
        """Return the maximum speed for sharp photographs a distance apart; infinite in hover."""
        if self.trigger == "hover":
            return math.inf
        return self.camera.max_speed_m_s(height_m, trigger_m, self.shutter_s, BLUR_PX)

    def line_trigger_m(self, length_m: float, height_m: float) -> float:
        """Return the distance between photographs of a line: the first at its start, the last near its end.

        So both ends of a line are photographed whatever its length is, and the overlap is never less than
        requested. A line of 5 m or less has the first only. In hover the last photograph is taken at the end
        itself. By interval the place of the last one is not known: the distance is at most `reach_m`.
        """
        trigger, reach = self.trigger_m(height_m), self.reach_m(height_m)
        if self.trigger == "interval":
            return min(trigger, reach) if reach > 0 else trigger
        last_m = 0.0 if self.trigger == "hover" else LAST_PHOTO_M
        flown = max(length_m - last_m, length_m / 2)
        if length_m <= ONE_PHOTO_M + 1e-6:
            return trigger
        return flown / math.ceil(flown / trigger - 1e-9)

    def interval_s(self, trigger_m: float, speed_m_s: float) -> float:
        """Return the time between photographs a distance apart at a speed, at least that of the camera."""
        steps = math.floor(trigger_m / speed_m_s / INTERVAL_STEP_S + 1e-6)
        return max(steps * INTERVAL_STEP_S, self.camera.min_interval_s, INTERVAL_STEP_S)
