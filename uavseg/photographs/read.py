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
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from uavseg.arrays import Path_
from uavseg.dataclass import dataclass
from uavseg.errors import PhotographError
from uavseg.execution.executors import Progress
from uavseg.flight.camera.camera import Camera, cameras
from uavseg.inputs import regular_file
from uavseg.photographs.photograph import Photograph
from uavseg.plain_text import cause_of, one_line, shown
from uavseg.warning_filters import changing_filters

SUFFIXES = (".jpg", ".jpeg", ".tif", ".tiff", ".dng")
_FIRST = 3  # names of a note
_MAX_BYTES = 32 << 20  # of a header; those of thermal images hold temperatures
_LEAST_READ = 256  # bytes that each call counts for
_MAX_XMP = 1 << 18
_HIGHEST_M = 20_000.0  # altitudes, above and below the sea
_FAR_M = 100.0  # by which two positions of one photograph may differ
_NEAR_M = 1.0  # to the next photograph, whose direction is that of a track
_FILM_MM = 43.27  # diagonal of 36 x 24 mm
_FOCAL = (0.1, 300.0)  # focal lengths in diagonals of the image
_UNITS_MM: dict[float, float] = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}  # of FocalPlaneResolutionUnit
_SPEEDS = {"K": 1 / 3.6, "M": 0.44704, "N": 1852 / 3600}
_RDF = "{http://www.w3.org/1999/02/22-rdf-syntax-ns#}"
# Names of yaw, pitch and roll of the line of sight: of DJI and Autel, of Parrot, of Skydio.
_POSES = ("drone:Gimbal{}Degree", "drone:Camera{}Degree", "drone:CameraOrientationNED/{}")
_POSITIONS = ("drone:Gps{}", "drone:GPS{}", "drone:{}")


@dataclass(frozen=True)
class Taken:
    """Photographs in the order of their times, and what was assumed or left out."""

    photographs: tuple[Photograph, ...]
    notes: tuple[str, ...] = ()


def read_photographs(
    sources: Sequence[Path_], progress: Progress | None = None, camera: Camera | None = None
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
        raise PhotographError(one_line("; ".join(["no photograph can be placed", *left_out])))
    assumed = [(one.path, note) for one in found for note in one.notes]
    return Taken(tuple(found), (*notes, *left_out, *grouped("", assumed)))


def grouped(start: str, reasons: Iterable[tuple[str, str]]) -> list[str]:
    """Return a line for each reason, with the first names of the files that have it."""
    groups: dict[str, list[tuple[str, str]]] = {}
    for path, reason in reasons:
        groups.setdefault(re.sub(r"\d+(\.\d+)?", "0", reason), []).append((Path(path).name, reason))
    lines = []
    for group in groups.values():
        names = ", ".join(shown(name, quoted=False) for name, _ in group[:_FIRST])
        more = f" and {len(group) - _FIRST} more" if len(group) > _FIRST else ""
        lines.append(f"{names}{more}: {start}{group[0][1]}")
    return lines


def _files(sources: Sequence[Path_]) -> tuple[list[str], int]:
    """Return the names of files, each once, and how many files of folders are no photographs."""
    names: dict[str, None] = {}
    ignored = 0

    def refuse(error: OSError) -> None:
        raise PhotographError(f"{error.filename} cannot be listed ({cause_of(error)})") from error

    for source in sources:
        if not os.path.isdir(source):  # noqa: PTH112 - false for a name that is too long
            names[os.fspath(regular_file(source, PhotographError))] = None
            continue
        before = len(names)
        for folder, folders, files in os.walk(source, onerror=refuse):
            folders[:] = sorted(name for name in folders if not name.startswith("."))
            for name in sorted(files):
                path = Path(folder, name)
                if path.suffix.lower() in SUFFIXES and not name.startswith(".") and path.is_file():
                    names[os.fspath(path)] = None
                else:
                    ignored += 1
        if len(names) == before:
            raise PhotographError(f"{os.fspath(source)} has no photographs ({', '.join(SUFFIXES)})")
    if not names:
        raise PhotographError("there are no photographs to read; name files or folders")
    return list(names), ignored


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
    """Tags of a photograph: EXIF by number (those of the image, of the exposure and of GPS), XMP by name."""

    size: tuple[int, int]
    exif: Mapping[int, Any]
    gps: Mapping[int, Any]
    xmp: Mapping[str, str]
    is_damaged: bool  # whether some tags are cut short

    def number(self, *names: str | int, gps: bool = False, limit: float | None = None) -> float | None:
        """Return the first of these tags that is a finite number, None where there is none.

        With a limit of its magnitude, a tag that is none or beyond it is a PhotographError.
        """
        for name in names:
            tags: Mapping[Any, Any] = self.xmp if isinstance(name, str) else self.gps if gps else self.exif
            value = tags.get(name)
            if value is None:
                continue
            number = math.nan
            with suppress(ValueError, TypeError, ZeroDivisionError, OverflowError):
                above, slash, below = value.partition("/") if isinstance(value, str) else (value, "", "")
                number = float(above) / float(below) if slash else float(above)
            if limit is not None and not abs(number) <= limit:
                raise PhotographError(f"its {'GPS ' * gps}tag {name} is {shown(value)}")
            if math.isfinite(number):
                return number
        return None

    def text(self, name: int, gps: bool = False) -> str:
        value = (self.gps if gps else self.exif).get(name, "")
        return one_line(value.strip(" \0\n"), 80) if isinstance(value, str) else ""


def _tags(path: str) -> _Tags:
    from PIL import Image

    try:
        with changing_filters(record=True) as caught, _Header(path) as file:
            warnings.simplefilter("always")
            with Image.open(file, formats=("JPEG", "TIFF")) as image:
                exif = image.getexif()
                shot = {**exif, **exif.get_ifd(0x8769)}
                gps = dict(exif.get_ifd(0x8825))
                size: Any = image.size
                packet = image.info.get("xmp") or b""
    except PhotographError:
        raise
    except Exception as error:  # Pillow raises errors of many types where a file is damaged
        cause = f" ({cause_of(error)})" if isinstance(error, OSError) and error.errno else ""
        raise PhotographError(f"it cannot be read as a JPEG or TIFF image{cause}") from error
    if shot.get(0x00FE) == 1:  # the first image of a .dng is a preview
        size = shot.get(0xA002), shot.get(0xA003)
    if not all(isinstance(side, int) and side > 0 for side in size):
        raise PhotographError("it does not say how large its image is")
    is_damaged = any(one.category is not Image.DecompressionBombWarning for one in caught)
    return _Tags(
        size, shot, gps, _xmp(packet if isinstance(packet, bytes) else str(packet).encode()), is_damaged
    )


def _xmp(packet: bytes) -> dict[str, str]:
    """Return tags as "namespace:Name", those in a structure as "namespace:Structure/Name"."""
    from defusedxml.ElementTree import fromstring

    found: dict[str, str] = {}
    if not packet.strip(b" \0\r\n\t"):
        return found
    try:
        if len(packet) > _MAX_XMP:
            raise ValueError
        root = fromstring(packet.strip(b" \0\r\n\t"), forbid_dtd=True)
    except Exception as error:  # expat's, of encodings, and of what is forbidden
        raise PhotographError("its XMP tags cannot be read") from error
    for description in root.iterfind(f".//{_RDF}RDF/{_RDF}Description"):
        _add(found, description.attrib)
        for child in description:
            owner = _named(child.tag)
            for part in child.iter():
                if part is not child and not part.tag.startswith(_RDF):
                    _add(found, {part.tag: part.text}, f"{owner}/")
                _add(found, part.attrib, f"{owner}/")
            _add(found, {child.tag: child.text})
    return found


def _add(found: dict[str, str], tags: Mapping[str, str | None], owner: str = "") -> None:
    for tag, text in tags.items():
        if text and text.strip():
            name = _named(tag)
            found.setdefault(owner + name.partition(":")[2] if owner else name, text.strip())


def _named(tag: str) -> str:
    """Return the name of a tag after "drone:" or "camera:", by its namespace; after ":" in all others."""
    space, _, name = tag.rpartition("}")
    space = f"{space.lower()}/"
    is_drone = re.search("drone|dji|autel|parrot|skydio", space) is not None
    return f"{'camera' if '/camera/' in space else 'drone' * is_drone}:{name}"


def _read(path: str, camera: Camera | None) -> Photograph:
    tags = _tags(path)
    notes = ["some tags are cut short, and not read"] if tags.is_damaged else []
    lat, lon = _position(tags, notes)
    altitude, is_ellipsoidal = _altitude(tags)
    yaw, pitch, roll = _pose(tags, notes)
    return Photograph(
        path=path,
        lon=lon,
        lat=lat,
        relative_m=_relative(tags, notes),
        altitude_m=altitude,
        is_ellipsoidal=is_ellipsoidal,
        yaw_deg=yaw,
        pitch_deg=pitch,
        roll_deg=roll + _turn(tags),
        image_px=tags.size,
        focal_px=_focal_px(tags, camera),
        camera=_camera_name(tags),
        taken_s=_taken_s(tags),
        exposure_s=tags.number(0x829A),
        speed_m_s=_speed(tags),
        position_error_m=_error_m(tags),
        notes=tuple(notes),
    )


def _position(tags: _Tags, notes: list[str]) -> tuple[float, float]:
    """Return latitude and longitude: those of XMP, which are finer, else those of EXIF."""
    places = [place for place in (_xmp_position(tags), _exif_position(tags)) if place and any(place)]
    if not places:
        raise PhotographError("it has no position")
    (lat, lon), others = places[0], places[1:]
    for other in others:
        if _distance_m((lat, lon), other) <= _FAR_M:
            continue
        if _distance_m((abs(lat), abs(lon)), (abs(other[0]), abs(other[1]))) <= _FAR_M:
            raise PhotographError(
                "its positions in XMP and EXIF are on different hemispheres; correct the signs or references"
            )
        notes.append("positions in XMP and EXIF are more than 100 m apart; that of XMP is taken")
    return lat, lon


def _distance_m(place: tuple[float, float], other: tuple[float, float]) -> float:
    east = math.remainder(place[1] - other[1], 360) * math.cos(math.radians(place[0]))
    return math.hypot(east, place[0] - other[0]) * 111_195


def _xmp_position(tags: _Tags) -> tuple[float, float] | None:
    for name in _POSITIONS:
        lat = tags.number(name.format("Latitude"), limit=90)
        # The second spelling is that of DJI and Autel.
        lon = tags.number(name.format("Longitude"), name.format("Longtitude"), limit=180)
        if lat is not None and lon is not None:
            return lat, lon
    return None


def _exif_position(tags: _Tags) -> tuple[float, float] | None:
    found = []
    for tag, signs, limit in ((2, "NS", 90), (4, "EW", 180)):
        parts = tags.gps.get(tag)
        if parts is None:
            return None
        ref = tags.text(tag - 1, gps=True).upper()[:1]
        try:
            degrees = sum(float(part) / 60**power for power, part in enumerate(parts))
        except (TypeError, ValueError, ZeroDivisionError, OverflowError):
            degrees = math.nan
        if not 0 <= degrees <= limit:
            raise PhotographError("its position in EXIF is not one on Earth")
        if not ref or ref not in signs:
            if _xmp_position(tags):
                return None
            raise PhotographError("its position in EXIF lacks the references: north or south, east or west")
        found.append(-degrees if ref == signs[1] else degrees)
    return found[0], found[1]


def _altitude(tags: _Tags) -> tuple[float | None, bool]:
    """Return the altitude, and whether it is above the ellipsoid."""
    reference = tags.gps.get(5, b"\0")
    ref = reference[0] if isinstance(reference, bytes) and reference else reference
    altitude = tags.number("drone:AbsoluteAltitude", limit=_HIGHEST_M)
    if altitude is None:
        altitude = tags.number(6, gps=True, limit=_HIGHEST_M)
        altitude = -altitude if altitude is not None and ref in (1, 3) else altitude
    zero = tags.xmp.get("camera:VertCS", "").lower()
    kind = tags.xmp.get("drone:AltitudeType", "").lower()
    if zero:
        return altitude, "ellips" in zero or "4979" in zero
    corrected = kind == "rtkalt" or (not kind and tags.number("drone:RtkFlag") in (34, 50))  # float, fixed
    is_x10 = re.match(r"skydio vt?\d{3}", _camera_name(tags).lower()) is not None
    return altitude, corrected or is_x10 or ref in (2, 3)


def _relative(tags: _Tags, notes: list[str]) -> float | None:
    relative = tags.number("drone:RelativeAltitude", limit=_HIGHEST_M)
    if relative is None:
        relative = tags.number("camera:AboveGroundAltitude", limit=_HIGHEST_M)
        if relative is not None:
            notes.append("heights above the ground are taken for heights above takeoff")
    return relative


def _pose(tags: _Tags, notes: list[str]) -> tuple[float, float, float]:
    """Return yaw, pitch and roll of the line of sight; yaw is NaN where nothing says it."""
    for pose in _POSES:
        yaw, pitch, roll = (tags.number(pose.format(name), limit=360) for name in ("Yaw", "Pitch", "Roll"))
        if pitch is not None:
            return _yaw(tags, notes) if yaw is None else yaw, pitch, roll or 0.0
    yaw, pitch, roll = (tags.number(f"camera:{name}", limit=360) for name in ("Yaw", "Pitch", "Roll"))
    if pitch is not None:
        roll = (roll or 0.0) * (-1 if tags.text(0x010F).lower() == "sensefly" else 1)
        return _line_of_sight(_yaw(tags, notes) if yaw is None else yaw, pitch, roll)
    if tags.is_damaged:
        raise PhotographError("some of its tags are cut short, and it has no angles of the camera")
    notes.append("no angles of the camera: it is taken to look straight down")
    return _yaw(tags, notes) if yaw is None else yaw, -90.0, 0.0


def _yaw(tags: _Tags, notes: list[str]) -> float:
    direction = tags.number("drone:FlightYawDegree", limit=360)
    if direction is not None:
        notes.append("no yaw of the camera: that of the vehicle is taken")
        return direction
    direction = tags.number(17, gps=True, limit=360)
    if direction is None:
        return math.nan
    magnetic = tags.text(16, gps=True) == "M"
    notes.append(f"yaw is {'the magnetic' if magnetic else 'that of the'} direction of the image in EXIF")
    return direction


def _line_of_sight(yaw_deg: float, pitch_deg: float, roll_deg: float) -> tuple[float, float, float]:
    """Return the angles of the line of sight from those of the top of the image."""
    yaw, pitch, roll = np.radians([yaw_deg, pitch_deg, roll_deg])
    (sy, sp, sr), (cy, cp, cr) = np.sin([yaw, pitch, roll]), np.cos([yaw, pitch, roll])
    right = np.array([cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr])  # north, east, down
    sight = np.array([cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr])
    level = math.hypot(sight[0], sight[1])
    if level < 1e-9:  # straight down: yaw is that of the top of the image
        return math.degrees(math.atan2(-right[0], right[1])), -90.0 if sight[2] > 0 else 90.0, 0.0
    down = np.cross(sight, right)
    return (
        math.degrees(math.atan2(sight[1], sight[0])),
        math.degrees(math.atan2(-sight[2], level)),
        math.degrees(math.atan2(right[2], down[2])),
    )


def _turn(tags: _Tags) -> float:
    """Return by how many degrees the stored image is turned against the upright one."""
    orientation = tags.exif.get(0x0112, 1)
    if orientation not in (0, 1, 3):
        raise PhotographError(
            f"its orientation tag is {shown(orientation)}, neither 1 nor 3: it was turned or mirrored, and "
            "its angles may be those before"
        )
    return 180.0 if orientation == 3 else 0.0


def _camera_name(tags: _Tags) -> str:
    make, model = tags.text(0x010F), tags.text(0x0110)
    return model if model.lower().startswith(make.lower()) else f"{make} {model}".strip()


def _focal_px(tags: _Tags, camera: Camera | None) -> float:
    """Return the focal length in pixels, of the first source that is plausible."""
    side, diagonal = max(tags.size), math.hypot(*tags.size)
    full = max(tags.number(0xA002) or 0.0, tags.number(0xA003) or 0.0)  # before the image was reduced
    scale = side / full if full > 0 else 1.0
    calibrated = tags.number("drone:CalibratedFocalLength", "drone:CalibratedFocalLength/X") or 0.0
    per_mm = (tags.number(0xA20E) or 0.0) / _UNITS_MM.get(tags.number(0xA210) or 2, math.inf)
    focal_mm, film_mm = (tags.number(tag) or 0.0 for tag in (0x920A, 0xA405))
    known = camera or _camera_of(tags, focal_mm)
    if known is not None and not _fits(known, tags):
        raise PhotographError(
            f"its image of {tags.size[0]} x {tags.size[1]} pixels has another shape than the "
            f"{known.image_px[0]} x {known.image_px[1]} of the camera {known.name}"
        )
    known_px = 0.0 if known is None else known.focal_mm / max(known.sensor_mm) * side
    sources = (calibrated * scale, known_px, focal_mm * per_mm * scale, film_mm * diagonal / _FILM_MM)
    zoom = tags.number(0xA404) or 1.0
    for focal_px in sources if camera is None else (known_px,):
        if _FOCAL[0] * diagonal <= focal_px * zoom <= _FOCAL[1] * diagonal:
            return focal_px * zoom
    raise PhotographError("no focal length in pixels follows from its tags: name its camera with --camera")


def _fits(camera: Camera, tags: _Tags) -> bool:
    shapes = [max(size) / min(size) for size in (camera.image_px, tags.size)]
    return abs(shapes[0] / shapes[1] - 1) < 0.02


def _camera_of(tags: _Tags, focal_mm: float) -> Camera | None:
    """Return the one camera of the catalogue with the name, the shape of image and the lens of the tags."""
    name = _camera_name(tags).lower()
    named = [one for one in cameras() if name and f"{one.name.lower()} ".startswith(f"{name} ")]
    lens = [one for one in named if not focal_mm or abs(focal_mm / one.focal_mm - 1) < 0.03]
    fits = [one for one in lens if _fits(one, tags)]
    fits = [one for one in fits if one.name.lower() == name] or fits
    return fits[0] if len(fits) == 1 else None


def _taken_s(tags: _Tags) -> float | None:
    """Return the time of the camera's clock, in seconds since 1970."""
    for tag, fraction in ((0x9003, 0x9291), (0x9004, 0x9292), (0x0132, 0x9290)):
        with suppress(ValueError, OverflowError):
            taken = datetime.strptime(tags.text(tag), "%Y:%m:%d %H:%M:%S").replace(tzinfo=UTC)
            digits = tags.text(fraction)
            return taken.timestamp() + (float(f"0.{digits}") if re.fullmatch(r"[0-9]{1,9}", digits) else 0.0)
    return None


def _speed(tags: _Tags) -> float | None:
    east, north, up = (tags.number(f"drone:Flight{axis}Speed") for axis in "YXZ")
    if east is not None and north is not None:
        return math.hypot(east, north, up or 0.0)
    speed, unit = tags.number(13, gps=True), _SPEEDS.get(tags.text(12, gps=True) or "K")
    return None if speed is None or unit is None else speed * unit


def _error_m(tags: _Tags) -> float | None:
    """Return the standard deviation of the horizontal position."""
    lon, lat = tags.number("drone:RtkStdLon"), tags.number("drone:RtkStdLat")
    if lon is not None and lat is not None:
        return math.hypot(lon, lat)
    accuracy = tags.number("camera:GPSXYAccuracy", "drone:GpsHorizontalAccuracy")
    return accuracy if accuracy is not None else tags.number(31, gps=True)


def _along_track(found: list[Photograph]) -> list[Photograph]:
    """Return photographs with the direction to the next one as yaw where that is not known.

    Of the last ones it is the direction before. It stays NaN where all were taken at one place.
    """
    yaws = [math.nan] * len(found)
    for index in range(len(found) - 2, -1, -1):
        one, then = found[index : index + 2]
        east = math.remainder(then.lon - one.lon, 360) * math.cos(math.radians(one.lat))
        near = _distance_m((one.lat, one.lon), (then.lat, then.lon)) < _NEAR_M
        yaws[index] = yaws[index + 1] if near else math.degrees(math.atan2(east, then.lat - one.lat))
    for index in range(1, len(found)):
        yaws[index] = yaws[index - 1] if math.isnan(yaws[index]) else yaws[index]
    note = "no yaw: the direction to the next photograph is taken"
    return [
        replace(one, yaw_deg=yaw, notes=(*one.notes, note)) if math.isnan(one.yaw_deg) else one
        for one, yaw in zip(found, yaws, strict=True)
    ]
