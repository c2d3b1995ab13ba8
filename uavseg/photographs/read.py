"""Photographs read from files: position, height, pose and focal length of EXIF and XMP tags.

Only headers are read. The tags are those of DJI, Autel, Parrot and Skydio; of Pix4D's namespace "Camera",
which senseFly, MicaSense, Parrot and older cameras of Autel use; and of EXIF alone, as the geotags of
ArduPilot are. "Camera" has yaw, pitch and roll of the top of the image (a pitch of 0 is straight down), the
others those of the line of sight.
"""

import io
import math
import os
import re
import warnings
from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from uavseg.arrays import Floats, Path_
from uavseg.dataclass import dataclass
from uavseg.errors import PhotographError, caused_errors
from uavseg.execution.executors import Progress
from uavseg.flight.camera.camera import Camera, cameras
from uavseg.inputs import regular_file
from uavseg.plain_text import cause_of, first_of, one_line, shown
from uavseg.warning_filters import changing_filters

HORIZON_DEG = 88.0  # rays that are farther from straight down are taken to reach no ground
SUFFIXES = (".jpg", ".jpeg", ".tif", ".tiff")
_FIRST = 3  # names of a note
_MAX_BYTES = 32 << 20  # of a header; those of thermal images hold temperatures
_LEAST_READ = 256  # bytes that each call counts for
_MAX_XMP = 1 << 18
_FAR_M = 100.0  # by which two positions of one photograph may differ
_NEAR_M = 1.0  # to the next photograph, whose direction is that of a track
_FILM_MM = 43.27  # diagonal of 36 x 24 mm
_FOCAL = (0.1, 300.0)  # focal lengths in diagonals of the image
_UNITS_MM: dict[float | None, float] = {None: 25.4, 2: 25.4, 3: 10.0, 4: 1.0}  # FocalPlaneResolutionUnit
_DAMAGED = "some tags are cut short, and not read"
_RDF = "{http://www.w3.org/1999/02/22-rdf-syntax-ns#}"
# Largest magnitude of quantities, and their tags in the order of preference: XMP by name, EXIF by number.
# A value that is not a number, or larger, is refused where there is a largest one; else it is passed over.
_TAGS: dict[str | int, tuple[float | None, tuple[str | int, ...]]] = {
    "latitude": (90, ("drone:GpsLatitude", "drone:GPSLatitude", "drone:Latitude")),
    # The second spelling is that of DJI and Autel.
    "longitude": (
        180,
        ("drone:GpsLongitude", "drone:GpsLongtitude", "drone:GPSLongitude", "drone:Longitude"),
    ),
    2: (90, (2,)),  # latitude and longitude of EXIF, without their signs
    4: (180, (4,)),
    "altitude": (20_000, ("drone:AbsoluteAltitude", 6)),
    "relative altitude": (20_000, ("drone:RelativeAltitude", "camera:AboveGroundAltitude")),
    # Of the line of sight: DJI and Autel, Parrot, Skydio.
    "yaw": (360, ("drone:GimbalYawDegree", "drone:CameraYawDegree", "drone:CameraOrientationNED/Yaw")),
    "pitch": (
        360,
        ("drone:GimbalPitchDegree", "drone:CameraPitchDegree", "drone:CameraOrientationNED/Pitch"),
    ),
    "roll": (360, ("drone:GimbalRollDegree", "drone:CameraRollDegree", "drone:CameraOrientationNED/Roll")),
    "top yaw": (360, ("camera:Yaw",)),
    "top pitch": (360, ("camera:Pitch",)),
    "top roll": (360, ("camera:Roll",)),
    "other yaw": (360, ("drone:FlightYawDegree", 17)),
    "accuracy": (None, ("camera:GPSXYAccuracy", "drone:GpsHorizontalAccuracy", 31)),
    "calibrated": (None, ("drone:CalibratedFocalLength", "drone:CalibratedFocalLength/X")),
}
_ASSUMED = {  # where these tags are taken
    "camera:AboveGroundAltitude": "heights above the ground are taken for heights above takeoff",
    "drone:FlightYawDegree": "no yaw of the camera: that of the vehicle is taken",
    17: "yaw is that of the direction of the image in EXIF",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Photograph:
    """A photograph: where it was taken, where the camera looked, and its lens (pinhole model).

    Heights are metres, and `relative_m` or `altitude_m` is known. Angles are those of gimbals: yaw is the
    azimuth in which the camera looks, clockwise from north, pitch -90 straight down and 0 to the horizon,
    roll clockwise as seen from behind the camera; they turn about the vertical, the right and the line of
    sight, in that order. Straight down, the top of the image lies in the direction of yaw.
    """

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


@dataclass(frozen=True)
class Taken:
    """Photographs in the order of their times, and what was assumed or left out."""

    photographs: tuple[Photograph, ...]
    notes: tuple[str, ...] = ()


def read_photographs(
    sources: Path_ | Sequence[Path_], progress: Progress | None = None, camera: Camera | None = None
) -> Taken:
    """Read the poses of photographs from files, and from folders and their subfolders.

    They are ordered by time, then by name. Those that cannot be placed are left out and named in the notes.
    `camera` is that of all photographs, instead of the focal length of the tags. A PhotographError says that
    a file or a folder cannot be read, there is none, or none can be placed.
    """
    paths, ignored = _files(sources)
    notes = [f"{ignored} other files in folders are not photographs"] if ignored else []
    found: list[Photograph] = []
    left: list[tuple[str, str]] = []
    for done, path in enumerate(paths, start=1):
        try:
            found.append(_read(path, camera))
        except PhotographError as error:
            left.append((path, str(error)))
        if progress is not None:
            progress(done, len(paths))
    found.sort(key=lambda one: (one.taken_s is None, one.taken_s or 0.0, one.path))
    found = _along_track(found)
    left += [(one.path, "nothing says where its top is") for one in found if math.isnan(one.yaw_deg)]
    found = [one for one in found if not math.isnan(one.yaw_deg)]
    left_out = grouped("left out, as ", left)
    if not found:
        raise PhotographError("; ".join(["no photograph can be placed", *left_out]))
    assumed = [(one.path, note) for one in found for note in one.notes]
    return Taken(tuple(found), (*notes, *left_out, *grouped("", assumed)))


def grouped(start: str, reasons: Iterable[tuple[str, str]]) -> list[str]:
    """Return a line for each reason, with the first names of the files that have it."""
    groups: dict[str, list[tuple[str, str]]] = {}
    for path, reason in reasons:
        groups.setdefault(re.sub(r"\d+(\.\d+)?", "0", reason), []).append((Path(path).name, reason))
    lines = []
    for group in groups.values():
        names = first_of([shown(name, quoted=False) for name, _ in group], _FIRST)
        lines.append(f"{names}: {start}{group[0][1]}")
    return lines


def _files(sources: Path_ | Sequence[Path_]) -> tuple[list[str], int]:
    """Return the names of files, each once, and how many files of folders are no photographs."""
    names: list[str] = []
    ignored = 0

    def refuse(error: OSError) -> None:
        raise PhotographError(f"{error.filename} cannot be listed ({cause_of(error)})") from error

    for source in [sources] if isinstance(sources, str | os.PathLike) else sources:
        if not os.path.isdir(source):  # noqa: PTH112 - false for a name that is too long
            names.append(os.fspath(regular_file(source, PhotographError)))
            continue
        inside: list[Path] = []
        for folder, folders, files in os.walk(source, onerror=refuse):
            folders[:] = sorted(name for name in folders if not name.startswith("."))
            inside += [Path(folder, name) for name in sorted(files)]
        good = [
            one for one in inside if one.suffix.lower() in SUFFIXES and one.name[0] != "." and one.is_file()
        ]
        if not good:
            raise PhotographError(f"{os.fspath(source)} has no photographs ({', '.join(SUFFIXES)})")
        names += map(os.fspath, good)
        ignored += len(inside) - len(good)
    if not names:
        raise PhotographError("there are no photographs to read; name files or folders")
    return list(dict.fromkeys(names)), ignored


class _Header(io.FileIO):
    """A file of which a limited number of bytes is read."""

    left = _MAX_BYTES

    def read(self, size: int | None = -1, /) -> bytes:
        self.left -= max(size if size is not None and size >= 0 else _MAX_BYTES, _LEAST_READ)
        if self.left < 0:
            raise PhotographError("its header is longer than that of any camera")
        return super().read(size) or b""


@dataclass(frozen=True, slots=True)
class _Tags:
    """Tags of a photograph, XMP by name and EXIF by number, and notes on what was assumed."""

    size: tuple[int, int]
    values: Mapping[str | int, Any]
    notes: list[str]

    def number(self, quantity: str | int) -> float | None:
        """Return a quantity of `_TAGS`, or another tag; None where there is none."""
        limit, names = _TAGS.get(quantity, (None, (quantity,)))
        for name in names:
            value = self.values.get(name)
            if value is None:
                continue
            number = math.nan
            with suppress(ValueError, TypeError, ZeroDivisionError, OverflowError):
                if name in (2, 4):  # degrees, minutes and seconds
                    number = sum(float(part) / 60**power for power, part in enumerate(value))
                else:
                    above, slash, below = value.partition("/") if isinstance(value, str) else (value, "", "")
                    number = float(above) / float(below) if slash else float(above)
            if limit is not None and not abs(number) <= limit:
                gps = "GPS " if isinstance(name, int) else ""
                raise PhotographError(f"its {gps}tag {name} is {shown(value)}")
            if math.isfinite(number):
                self.notes.extend(note for tag, note in _ASSUMED.items() if tag == name)
                return number
        return None

    def length(self, one: str, other: str) -> float | None:
        """Return the length of a vector of two tags."""
        x, y = self.number(one), self.number(other)
        return None if x is None or y is None else math.hypot(x, y)

    def text(self, name: str | int) -> str:
        value = self.values.get(name)
        return one_line(value.strip(" \0\n"), 80) if isinstance(value, str) else ""


def _tags(path: str) -> _Tags:
    from PIL import Image

    try:
        with changing_filters(record=True) as caught, _Header(path) as file:
            warnings.simplefilter("always")
            with Image.open(file, formats=("JPEG", "TIFF")) as image:
                exif, size = image.getexif(), image.size
                values: dict[Any, Any] = {**exif, **exif.get_ifd(0x8769), **exif.get_ifd(0x8825)}
                if values.get(16) == "M":
                    values.pop(17, None)  # a magnetic direction is not taken
                packet = image.info.get("xmp") or b""
    except PhotographError:
        raise
    except Exception as error:  # Pillow raises errors of many types where a file is damaged
        cause = f" ({cause_of(error)})" if isinstance(error, OSError) and error.errno else ""
        raise PhotographError(f"it cannot be read as a JPEG or TIFF image{cause}") from error
    if min(size) < 1 or values.get(0x00FE) == 1:
        raise PhotographError("its image is empty, or the preview of a raw one: name the JPEG of the camera")
    is_damaged = any(one.category is not Image.DecompressionBombWarning for one in caught)
    values |= _xmp(packet if isinstance(packet, bytes) else str(packet).encode())
    return _Tags(size, values, [_DAMAGED] if is_damaged else [])


def _xmp(packet: bytes) -> dict[str, str]:
    """Return tags as "namespace:Name", those in a structure as "namespace:Structure/Name"."""
    from defusedxml.ElementTree import fromstring

    # Errors are expat's, of encodings, and of what is forbidden.
    with caused_errors("its XMP tags cannot be read", PhotographError, Exception, form="{}"):
        root = fromstring(packet.strip(b" \0\r\n\t")[:_MAX_XMP] or b"<none/>", forbid_dtd=True)
    texts: list[tuple[str, str | None]] = []
    for description in root.iterfind(f".//{_RDF}RDF/{_RDF}Description"):
        texts += [(_named(tag), text) for tag, text in description.attrib.items()]
        for child in description:
            name = _named(child.tag)
            texts.append((name, child.text))
            for part in child.iter():
                inner = [(part.tag, part.text), *part.attrib.items()]
                texts += [(f"{name}/{_named(tag).partition(':')[2]}", text) for tag, text in inner]
    return {name: text.strip() for name, text in reversed(texts) if text and text.strip()}


def _named(tag: str) -> str:
    """Return the name of a tag after "drone:" or "camera:", by its namespace; after ":" in all others."""
    space, _, name = tag.rpartition("}")
    space = f"{space.lower()}/"
    is_drone = re.search("drone|dji|autel|parrot|skydio", space) is not None
    return f"{'camera' if '/camera/' in space else 'drone' * is_drone}:{name}"


def _read(path: str, camera: Camera | None) -> Photograph:
    tags = _tags(path)
    orientation = tags.values.get(0x0112, 1)
    if orientation not in (0, 1, 3):
        raise PhotographError(
            f"its orientation tag is {shown(orientation)}, neither 1 nor 3: it was turned or mirrored, and "
            "its angles may be those before"
        )
    lat, lon = _position(tags)
    altitude, is_ellipsoidal = _altitude(tags)
    yaw, pitch, roll = _pose(tags)
    error = tags.length("drone:RtkStdLon", "drone:RtkStdLat")
    speed, km_h = tags.length("drone:FlightXSpeed", "drone:FlightYSpeed"), tags.number(13)
    if speed is None and km_h is not None and tags.text(12) == "K":
        speed = km_h / 3.6
    return Photograph(
        path=path,
        lon=lon,
        lat=lat,
        relative_m=tags.number("relative altitude"),
        altitude_m=altitude,
        is_ellipsoidal=is_ellipsoidal,
        yaw_deg=yaw,
        pitch_deg=pitch,
        roll_deg=roll + (180.0 if orientation == 3 else 0.0),
        image_px=tags.size,
        focal_px=_focal_px(tags, camera),
        camera=_camera_name(tags),
        taken_s=_taken_s(tags),
        exposure_s=tags.number(0x829A),
        speed_m_s=speed,
        position_error_m=tags.number("accuracy") if error is None else error,
        notes=tuple(tags.notes),
    )


def _position(tags: _Tags) -> tuple[float, float]:
    """Return latitude and longitude: those of XMP, which are finer, else those of EXIF."""
    places: list[tuple[float, float]] = []
    signs = {"N": 1, "S": -1}.get(tags.text(1)), {"E": 1, "W": -1}.get(tags.text(3))
    for names, (north, east) in ((("latitude", "longitude"), (1, 1)), ((2, 4), signs)):
        lat, lon = tags.number(names[0]), tags.number(names[1])
        if lat is None or lon is None:
            continue
        if north is None or east is None or (names == (2, 4) and min(lat, lon) < 0):
            raise PhotographError("its position in EXIF lacks the references: north or south, east or west")
        if lat or lon:
            places.append((north * lat, east * lon))
    if not places:
        raise PhotographError("it has no position")
    if math.hypot(*_east_north_m(places[0], places[-1])) > _FAR_M:
        raise PhotographError("its positions in XMP and EXIF are more than 100 m apart: correct one")
    return places[0]


def _east_north_m(place: tuple[float, float], other: tuple[float, float]) -> tuple[float, float]:
    east = math.remainder(other[1] - place[1], 360) * math.cos(math.radians(place[0]))
    return east * 111_195, (other[0] - place[0]) * 111_195


def _altitude(tags: _Tags) -> tuple[float | None, bool]:
    """Return the altitude, and whether it is above the ellipsoid."""
    reference = tags.values.get(5)
    ref = reference[0] if isinstance(reference, bytes) and reference else reference
    altitude = tags.number("altitude")
    if altitude is not None and ref in (1, 3) and "drone:AbsoluteAltitude" not in tags.values:
        altitude = -altitude
    zero, kind = tags.text("camera:VertCS").lower(), tags.text("drone:AltitudeType").lower()
    if zero:
        return altitude, "ellips" in zero or "4979" in zero
    corrected = kind == "rtkalt" or (not kind and tags.number("drone:RtkFlag") in (34, 50))  # float, fixed
    is_x10 = re.match(r"skydio vt?\d{3}", _camera_name(tags).lower()) is not None
    return altitude, corrected or is_x10 or ref in (2, 3)


def _pose(tags: _Tags) -> tuple[float, float, float]:
    """Return yaw, pitch and roll of the line of sight; yaw is NaN where nothing says it."""
    of = "" if tags.number("pitch") is not None else "top "
    yaw, pitch, roll = (tags.number(f"{of}{name}") for name in ("yaw", "pitch", "roll"))
    if pitch is None:
        if _DAMAGED in tags.notes:
            raise PhotographError("some of its tags are cut short, and it has no angles of the camera")
        tags.notes.append("no angles of the camera: it is taken to look straight down")
    yaw = tags.number("other yaw") if yaw is None else yaw
    if pitch is None:
        return math.nan if yaw is None else yaw, -90.0, 0.0
    if yaw is None:
        raise PhotographError("it has a pitch of the camera, but no yaw")
    if not of:
        return yaw, pitch, roll or 0.0
    pitch, roll = math.radians(pitch), math.radians(roll or 0.0)
    if tags.text(0x010F).lower() == "sensefly":
        roll = -roll
    across, ahead = math.sin(roll), math.sin(pitch) * math.cos(roll) + 0.0  # -0.0 is not backwards
    down = math.cos(pitch) * math.cos(roll)
    return (
        yaw + math.degrees(math.atan2(-across, ahead)),
        math.degrees(math.atan2(-down, math.hypot(across, ahead))),
        math.degrees(math.atan2(math.cos(pitch) * across, math.sin(pitch) + 0.0)),
    )


def _camera_name(tags: _Tags) -> str:
    make, model = tags.text(0x010F), tags.text(0x0110)
    return model if model.lower().startswith(make.lower()) else f"{make} {model}".strip()


def _focal_px(tags: _Tags, camera: Camera | None) -> float:
    """Return the focal length in pixels, of the first source that is plausible."""
    side, diagonal, name = max(tags.size), math.hypot(*tags.size), _camera_name(tags).lower()
    calibrated, focal_mm, film_mm, per_unit, *full = (
        tags.number(one) or 0.0 for one in ("calibrated", 0x920A, 0xA405, 0xA20E, 0xA002, 0xA003)
    )
    known = [camera] if camera else [one for one in cameras() if one.name.lower() == name]
    sources = [
        one.focal_mm / max(one.sensor_mm) * side
        for one in known
        if abs(max(one.image_px) * min(tags.size) / (min(one.image_px) * side) - 1) < 0.02
        and (camera or not focal_mm or abs(focal_mm / one.focal_mm - 1) < 0.03)
    ]
    if camera is None:
        scale = side / (max(full) or side)  # of an image that was reduced
        plane_px = focal_mm * per_unit / _UNITS_MM.get(tags.number(0xA210), math.inf) * scale
        sources = [calibrated * scale, *sources, plane_px, film_mm * diagonal / _FILM_MM]
    elif not sources:
        raise PhotographError(
            f"its image of {tags.size[0]} x {tags.size[1]} pixels has another shape than the "
            f"{camera.image_px[0]} x {camera.image_px[1]} of the camera {camera.name}"
        )
    for focal_px in (source * (tags.number(0xA404) or 1.0) for source in sources):  # digital zoom
        if _FOCAL[0] * diagonal <= focal_px <= _FOCAL[1] * diagonal:
            return focal_px
    raise PhotographError("no focal length in pixels follows from its tags: name its camera with --camera")


def _taken_s(tags: _Tags) -> float | None:
    """Return the time of the camera's clock, in seconds since 1970."""
    try:
        taken = datetime.strptime(tags.text(0x9003), "%Y:%m:%d %H:%M:%S").replace(tzinfo=UTC)
    except ValueError:
        return None
    digits = re.fullmatch("[0-9]{1,9}", tags.text(0x9291) or tags.text(0x9290))
    return taken.timestamp() + (float(f"0.{digits[0]}") if digits else 0.0)


def _along_track(found: list[Photograph]) -> list[Photograph]:
    """Return photographs with the direction to the next place, at the end to the last one, as missing yaw."""
    legs = [_east_north_m((one.lat, one.lon), (then.lat, then.lon)) for one, then in pairwise(found)]
    moved = [number for number, leg in enumerate(legs) if math.hypot(*leg) >= _NEAR_M]
    note = "no yaw: the direction to the next photograph is taken"
    for number, one in enumerate(found if moved else ()):
        if math.isnan(one.yaw_deg):
            leg = legs[moved[min(bisect_left(moved, number), len(moved) - 1)]]
            found[number] = replace(one, yaw_deg=math.degrees(math.atan2(*leg)), notes=(*one.notes, note))
    return found
