"""Photographs drawn for known poses, with the tags of their makers; shares no code with the package."""

import math
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
import rasterio
from numpy.typing import NDArray
from PIL import Image
from PIL.TiffImagePlugin import IFDRational
from pyproj import Geod, Transformer
from scipy.ndimage import map_coordinates

Array = NDArray[np.float64]
GEOD = Geod(ellps="WGS84")
NAMESPACES = {
    "drone-dji": "http://www.dji.com/drone-dji/1.0/",
    "drone": "http://www.dji.com/drone-dji/1.0/",  # the prefix of Autel
    "drone-parrot": "http://www.parrot.com/drone-parrot/1.0/",
    "drone-skydio": "https://www.skydio.com/drone-skydio/1.0/",
    "Camera": "http://pix4d.com/camera/1.0/",
    "SenseFly": "http://ns.sensefly.com/Camera/1.0/",
}
MAKES = {
    "dji": ("DJI", "FC6310R"),
    "dji elements": ("DJI", "M3E"),
    "autel": ("Autel Robotics", "XT705"),
    "old autel": ("Autel Robotics", "XT701"),
    "parrot": ("Parrot", "Anafi"),
    "skydio": ("Skydio", "VT300-L_93"),
    "old skydio": ("Skydio", "2"),
    "sensefly": ("senseFly", "S.O.D.A."),
    "pix4d": ("Parrot", "Sequoia"),
    "ardupilot": ("SONY", "ILCE-6000"),  # with the direction of the image
    "geotag": ("SONY", "ILCE-6000"),  # position and altitude alone
}
MAKERS = tuple(MAKES)


def turns(photograph: Any) -> Array:
    """Rotation Rz(yaw) Ry(pitch) Rx(roll) from sight, right, down of the image to north, east, down."""
    yaw, pitch, roll = (math.radians(getattr(photograph, f"{name}_deg")) for name in ("yaw", "pitch", "roll"))
    about_down = [[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]]
    about_right = [[math.cos(pitch), 0, math.sin(pitch)], [0, 1, 0], [-math.sin(pitch), 0, math.cos(pitch)]]
    about_sight = [[1, 0, 0], [0, math.cos(roll), -math.sin(roll)], [0, math.sin(roll), math.cos(roll)]]
    turned: Array = np.array(about_down) @ np.array(about_right) @ np.array(about_sight)
    return turned


def pix4d_angles(photograph: Any) -> tuple[float, float, float]:
    """Yaw, pitch and roll as of Pix4D: those of the top of the image, so pitch 0 is straight down."""
    sight, right, down = turns(photograph).T
    body = np.column_stack([-down, right, sight])
    if math.hypot(body[0, 0], body[1, 0]) < 1e-7:  # to the horizon, only yaw and roll together are known
        turned = math.degrees(math.atan2(-body[0, 1], body[1, 1]))
        return turned, math.copysign(90.0, -body[2, 0]), 0.0
    yaw = math.degrees(math.atan2(body[1, 0], body[0, 0]))
    return (
        yaw,
        math.degrees(-math.asin(max(-1, min(1, body[2, 0])))),
        math.degrees(math.atan2(body[2, 1], body[2, 2])),
    )


def ground_lonlat(
    photograph: Any, pixels: Array, dem: Path | None = None, steps: int = 400
) -> tuple[Array, Array]:
    """Longitudes and latitudes of the ground that places of the image (n, 2) show, by marching along rays."""
    cols, rows = photograph.image_px
    focal = photograph.focal_px
    offsets = np.column_stack([np.full(len(pixels), focal), pixels - np.array([cols, rows]) / 2]) / focal
    north, east, down = turns(photograph) @ offsets.T
    if dem is None:
        length = photograph.relative_m / down
    else:
        height = photograph.altitude_m
        ends = 1.5 * (
            height - _sampled(dem, np.array([photograph.lon]), np.array([photograph.lat]))[0, 0] + 60
        )
        length = np.full(len(pixels), np.nan)
        before = np.zeros(len(pixels))
        for share in np.arange(1, steps + 1) / steps:
            now = ends * share / down
            clear = height - now * down - _sampled(dem, *_walked(photograph, now * east, now * north))[0]
            hit = np.isnan(length) & (clear <= 0)
            if hit.any():
                low, high = before[hit], now[hit]
                for _ in range(30):
                    middle = (low + high) / 2
                    place = _walked(photograph, middle * east[hit], middle * north[hit])
                    above = height - middle * down[hit] - _sampled(dem, *place)[0] > 0
                    low, high = np.where(above, middle, low), np.where(above, high, middle)
                length[hit] = high
            before = now
    return _walked(photograph, length * east, length * north)


def _walked(photograph: Any, east: Array, north: Array) -> tuple[Array, Array]:
    n = len(east)
    start = np.full(n, photograph.lon), np.full(n, photograph.lat)
    lon, lat, _ = GEOD.fwd(*start, np.degrees(np.arctan2(east, north)), np.hypot(east, north))
    return lon, lat


_rasters: dict[tuple[str, int], Any] = {}


def _sampled(path: Path, lon: Array, lat: Array) -> Array:
    """Values of all bands of a raster (bands, n), bilinear; the nearest at its edge."""
    key = str(path), Path(path).stat().st_mtime_ns
    if key not in _rasters:
        with rasterio.open(path) as source:
            to_xy = Transformer.from_crs("EPSG:4326", source.crs, always_xy=True)
            _rasters[key] = source.read().astype(float), ~source.transform, to_xy
    bands, inverse, to_xy = _rasters[key]
    col, row = inverse * to_xy.transform(lon, lat)
    return np.stack(
        [map_coordinates(band, [row - 0.5, col - 0.5], order=1, mode="nearest") for band in bands]
    )


def draw_photograph(
    path: str | Path,
    photograph: Any,
    raster: Path | None = None,
    dem: Path | None = None,
    maker: str = "dji",
    exif: dict[int, Any] | None = None,
    gps: dict[int, Any] | None = None,
    xmp: dict[str, str] | None = None,
) -> Path:
    """Write a JPEG (or .tif) of a `Photograph` with the tags of a maker, its pixels those of a raster.

    `exif`, `gps` and `xmp` ("prefix:Name") replace single tags, or leave them out where they are None.
    """
    path, (cols, rows) = Path(path), photograph.image_px
    if raster is None:
        pixels = np.full((rows, cols), 128, np.uint8)
    else:
        row, col = np.mgrid[:rows, :cols] + 0.5
        places = np.column_stack([col.ravel(), row.ravel()])
        values = _sampled(raster, *ground_lonlat(photograph, places, dem))
        values = values[:3] if len(values) >= 3 else values[:1]
        grey = values if values.max() <= 255 else 255 * values / values.max()
        pixels = np.moveaxis(grey.reshape(-1, rows, cols), 0, -1).round().astype(np.uint8).squeeze()
    image = Image.fromarray(pixels)
    tags = _exif(photograph, maker, exif or {}, gps or {})
    packet = _packet({**_xmp(photograph, maker), **(xmp or {})}, maker)
    if path.suffix.lower() in (".tif", ".tiff"):
        from PIL.TiffImagePlugin import ImageFileDirectory_v2

        directory = ImageFileDirectory_v2()
        for tag, value in tags.items():
            directory[tag] = value
        for tag in (0x8769, 0x8825):
            directory[tag] = tags.get_ifd(tag)
        if packet:
            directory.tagtype[700] = 7
            directory[700] = packet
        image.save(path, tiffinfo=directory)
        return path
    image.save(path, "JPEG", quality=95, exif=tags)
    return insert_xmp(path, packet) if packet else path


def insert_xmp(path: Path, packet: bytes) -> Path:
    """Insert a segment of XMP into a JPEG."""
    content, start = path.read_bytes(), b"http://ns.adobe.com/xap/1.0/\0"
    size = (len(start) + len(packet) + 2).to_bytes(2, "big")
    path.write_bytes(content[:2] + b"\xff\xe1" + size + start + packet + content[2:])
    return path


def _exif(photograph: Any, maker: str, exif: dict[int, Any], gps: dict[int, Any]) -> Any:
    make, model = MAKES[maker]
    tags = Image.Exif()
    image: dict[int, Any] = {0x010F: make, 0x0110: model}
    shot: dict[int, Any] = {
        0x920A: IFDRational(round(photograph.focal_px * 2e6 / 1000), 1_000_000),  # pixels of 2 micrometres
        0xA20E: IFDRational(500, 1),
        0xA20F: IFDRational(500, 1),
        0xA210: 4,  # per millimetre
        0xA002: photograph.image_px[0],
        0xA003: photograph.image_px[1],
    }
    if photograph.taken_s is not None:
        taken = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=photograph.taken_s)
        shot |= {0x9003: f"{taken:%Y:%m:%d %H:%M:%S}", 0x9291: f"{taken.microsecond // 1000:03d}"}
    if photograph.exposure_s is not None:
        shot[0x829A] = IFDRational(round(photograph.exposure_s * 1e6), 1_000_000)
    place: dict[int, Any] = {
        1: "N" if photograph.lat >= 0 else "S",
        2: _sexagesimal(photograph.lat),
        3: "E" if photograph.lon >= 0 else "W",
        4: _sexagesimal(photograph.lon),
    }
    if photograph.altitude_m is not None:
        ref = (2 if photograph.is_ellipsoidal else 0) + (photograph.altitude_m < 0)
        place |= {5: bytes([ref]), 6: IFDRational(round(abs(photograph.altitude_m) * 1000), 1000)}
    if maker == "ardupilot":
        place |= {16: "T", 17: IFDRational(round(photograph.yaw_deg % 360 * 100), 100)}
    for ifd, given in ((image, {}), (shot, {}), (place, gps)):
        ifd.update(given)
    for tag, value in exif.items():
        (image if tag < 0x8000 else shot)[tag] = value
    for tag, value in image.items():
        if value is not None:
            tags[tag] = value
    for number, ifd in ((0x8769, shot), (0x8825, place)):
        known = {tag: value for tag, value in ifd.items() if value is not None}
        tags.get_ifd(number).update(known)
        tags[number] = known  # Pillow 11.0 writes what is here alone
    return tags


def _sexagesimal(degrees: float) -> tuple[IFDRational, ...]:
    whole, seconds = divmod(abs(degrees) * 3600, 3600)
    minutes, seconds = divmod(seconds, 60)
    return (
        IFDRational(round(whole), 1),
        IFDRational(round(minutes), 1),
        IFDRational(round(seconds * 1e6), 1_000_000),
    )


def _xmp(photograph: Any, maker: str) -> dict[str, str]:
    angles = {name: getattr(photograph, f"{name.lower()}_deg") for name in ("Yaw", "Pitch", "Roll")}
    heights = {"RelativeAltitude": photograph.relative_m, "AbsoluteAltitude": photograph.altitude_m}
    known = {name: f"{height:+.3f}" for name, height in heights.items() if height is not None}
    place = {"Latitude": f"{photograph.lat:.9f}", "Longitude": f"{photograph.lon:.9f}"}
    if maker in ("dji", "dji elements", "autel"):
        prefix = "drone" if maker == "autel" else "drone-dji"
        longitude = "GpsLongtitude" if maker != "dji elements" else "GpsLongitude"
        found = {"GpsLatitude": place["Latitude"], longitude: place["Longitude"]} | known
        found |= {
            f"Gimbal{name}Degree": f"{(angle + 180) % 360 - 180:+.2f}" for name, angle in angles.items()
        }
        found |= {"FlightYawDegree": "+77.00", "CalibratedFocalLength": f"{photograph.focal_px:.6f}"}
        if photograph.speed_m_s is not None:
            found |= {"FlightXSpeed": f"{photograph.speed_m_s:+.2f}", "FlightYSpeed": "+0.00"}
        if photograph.position_error_m is not None:
            each = f"{photograph.position_error_m / math.sqrt(2):.5f}"
            found |= {
                "RtkFlag": "50" if photograph.is_ellipsoidal else "16",
                "RtkStdLon": each,
                "RtkStdLat": each,
            }
        if photograph.is_ellipsoidal:
            found["AltitudeType"] = "RtkAlt"
        return {f"{prefix}:{name}": text for name, text in found.items()}
    if maker in ("skydio", "old skydio"):
        found = place | known
        found |= {f"CameraOrientationNED/{name}": f"{angle:.6f}" for name, angle in angles.items()}
        found |= {f"CalibratedFocalLength/{axis}": f"{photograph.focal_px:.4f}" for axis in "XY"}
        return {f"drone-skydio:{name}": text for name, text in found.items()} | (
            {"Camera:VertCS": "ellipsoidal" if photograph.is_ellipsoidal else "EPSG:5773"}
        )
    if maker in ("ardupilot", "geotag"):
        return {}
    prefix = "SenseFly" if maker == "sensefly" else "Camera"
    pix4d = dict(zip(("Yaw", "Pitch", "Roll"), pix4d_angles(photograph), strict=True))
    if maker == "sensefly":
        pix4d["Roll"] *= -1
    found = {f"{prefix}:{name}": f"{angle:.6f}" for name, angle in pix4d.items()}
    if photograph.relative_m is not None:
        found["Camera:AboveGroundAltitude"] = f"{round(photograph.relative_m * 4096)}/4096"
    if maker == "parrot":
        found |= {f"drone-parrot:Camera{name}Degree": f"{angle:.6f}" for name, angle in angles.items()}
    if photograph.position_error_m is not None:
        found["Camera:GPSXYAccuracy"] = f"{photograph.position_error_m:.4f}"
    return dict(found)


def _packet(tags: dict[str, str | None], maker: str) -> bytes:
    """The XMP of tags: attributes, or elements for some makers; "A/B" is B in the structure A."""
    given = {name: text for name, text in tags.items() if text is not None}
    if not given:
        return b""
    elements = maker in ("dji elements", "parrot", "skydio", "pix4d")
    plain = {name: text for name, text in given.items() if "/" not in name}
    structures: dict[str, dict[str, str]] = {}
    for name, text in given.items():
        if "/" in name:
            owner, part = name.split("/")
            structures.setdefault(owner, {})[f"{owner.partition(':')[0]}:{part}"] = text
    inside = "".join(f"<{name}>{text}</{name}>" for name, text in plain.items()) if elements else ""
    for owner, parts in structures.items():
        if elements:
            fields = "".join(f"<{name}>{text}</{name}>" for name, text in parts.items())
            inside += f'<{owner} rdf:parseType="Resource">{fields}</{owner}>'
        else:
            inside += f"<{owner} {' '.join(f'{name}={quoteattr(text)}' for name, text in parts.items())}/>"
    attributes = "" if elements else " ".join(f"{name}={quoteattr(text)}" for name, text in plain.items())
    spaces = " ".join(f'xmlns:{prefix}="{address}"' for prefix, address in NAMESPACES.items())
    return (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta xmlns:x="adobe:ns:meta/">'
        '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        f'<rdf:Description rdf:about="" {spaces} {attributes}>{inside}</rdf:Description>'
        '</rdf:RDF></x:xmpmeta><?xpacket end="w"?>'
    ).encode()
