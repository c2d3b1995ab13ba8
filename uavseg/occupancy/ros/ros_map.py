"""ROS maps (a YAML file and an image), read and written by the rules of Nav2's map server.

The rules are those of ``nav2_map_server/src/map_io.cpp`` in ros-navigation/navigation2: the image becomes
8-bit grey x; occupancy is 1 - x/255, or x/255 if ``negate`` is set, in single precision; both thresholds are
inclusive, and where both hold, free wins. Most images are PGMs (http://netpbm.sourceforge.net/doc/pgm.html),
of which GDAL reads only raw ones, and ignores the maximum; so they are read here.
"""

import math
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from uavseg.access import current_policy
from uavseg.arrays import Bools, Float32s, Integers, Path_, Uint8s
from uavseg.dataclass import dataclass
from uavseg.errors import MapError, RasterError, RasterReadError, caused_errors, named_errors
from uavseg.inputs import parse_yaml, read_bytes, read_start
from uavseg.output.atomic import atomic_file, check_target
from uavseg.plain_text import shown
from uavseg.raster.formats.png import read_grey, to_8_bits, write_png
from uavseg.raster.grid.geobox import GeoBox, check_metres

RosCells = NDArray[np.int8]

MAX_YAML_BYTES = 1 << 16  # of a YAML file
UNKNOWN_CELL = -1
ROS_MODES = ("trinary", "scale", "raw")

_MAX_THRESHOLD = 1e6
_REQUIRED = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")


@dataclass(frozen=True, slots=True)
class CellRules:
    """The rules that turn the grey of an image into cells."""

    mode: str
    negate: bool  # white is occupied
    occupied: float  # thresholds of occupancy
    free: float

    def __post_init__(self) -> None:
        if self.mode not in ROS_MODES:
            raise MapError(f"mode is trinary, scale or raw, not {shown(self.mode)}")
        if not (abs(self.occupied) <= _MAX_THRESHOLD and abs(self.free) <= _MAX_THRESHOLD):
            given = f"{self.occupied:g} and {self.free:g}"
            raise MapError(f"thresholds are finite and at most {_MAX_THRESHOLD:g}, not {given}")
        if self.mode != "raw" and max(self.occupied, self.free) > 1:
            given = f"occupied_thresh {self.occupied:g} and free_thresh {self.free:g}"
            if 0 <= self.free <= 100 and self.occupied <= 100:
                given += f"; as per cent they are {self.occupied / 100:g} and {self.free / 100:g}"
            raise MapError(f"thresholds are fractions of at most 1, not {given}")
        if self.free >= self.occupied:
            raise MapError(
                f"free_thresh ({self.free:g}) lies below occupied_thresh ({self.occupied:g}), "
                "so that no cell is free and occupied at once"
            )

    def cells(self, grey: Uint8s, alpha: Uint8s | None = None) -> RosCells:
        """Convert 8-bit grey to cells; pixels that are not opaque are unknown, except in the mode raw."""
        cells = self.table()[grey]
        if alpha is not None and self.mode != "raw":
            cells[alpha < 255] = UNKNOWN_CELL
        return cells

    def cells_before_2025(self, grey: Uint8s, alpha: Uint8s) -> RosCells:
        """Convert a trinary map with alpha as Nav2 up to Jazzy does, which averages alpha into the grey."""
        brightness = (3 * grey.astype(np.float64) + alpha) / (4 * 255)
        occupancy = brightness if self.negate else 1 - brightness
        cells = np.where(occupancy > self.occupied, 100, np.where(occupancy < self.free, 0, UNKNOWN_CELL))
        return cells.astype(np.int8)

    def table(self) -> RosCells:
        """Return the lookup table from grey to cell, a (256,) int8 array."""
        grey = np.arange(256)
        if self.mode == "raw":
            return np.where(grey <= 100, grey, UNKNOWN_CELL).astype(np.int8)
        brightness = grey.astype(np.float32) / np.float32(255)
        occupancy = brightness if self.negate else np.float32(1) - brightness
        occupied, free = np.float32(self.occupied), np.float32(self.free)
        between = np.full(256, UNKNOWN_CELL)
        if self.mode == "scale":
            percent = (occupancy - free) / np.float32(self.occupied - self.free) * np.float32(100)
            between = np.floor(percent.astype(np.float64) + 0.5)  # halves up, exactly
        cells = np.where(occupancy <= free, 0, np.where(occupancy >= occupied, 100, between))
        return cells.astype(np.int8)


@dataclass(frozen=True, slots=True)
class MapDescription:
    """The contents of the YAML file of a ROS map."""

    image: Path  # path of the image; a relative one is relative to the YAML file
    resolution: float  # metres per cell
    origin: tuple[float, float, float]  # x and y of the lower left corner in metres, and the yaw in radians
    rules: CellRules


def read_ros_yaml(path: Path_) -> MapDescription:
    """Read and check the YAML file of a ROS map."""
    content = _read_yaml(path)
    with named_errors(os.fspath(path), MapError):
        value = content["negate"]
        if isinstance(value, str) and value.strip().lstrip("+-").isdigit():
            value = int(value)
        if not isinstance(value, int):
            raise MapError(f"negate is 0 or 1, not {shown(value)}")
        rules = CellRules(
            mode=str(content.get("mode", "trinary")).lower(),
            negate=bool(value),
            occupied=_number("occupied_thresh", content["occupied_thresh"]),
            free=_number("free_thresh", content["free_thresh"]),
        )
        image = content["image"]
        if not isinstance(image, str) or not image or not image.isprintable():
            raise MapError(f"image is the file name of an image, not {shown(image)}")
        resolution = _number("resolution", content["resolution"])
        if not (math.isfinite(resolution) and resolution > 0):
            raise MapError(f"resolution is metres per cell, a number above 0, not {resolution:g}")
        origin = _origin(content["origin"])
        return MapDescription(Path(path).parent / image, resolution, origin, rules)


def ros_yaml_text(content: Mapping[str, Any]) -> str:
    """Write the text of a YAML file, with lists on one line."""
    import yaml

    text: str = yaml.safe_dump(dict(content), sort_keys=False, default_flow_style=None)
    return text


def _read_yaml(path: Path_) -> Mapping[str, Any]:
    import yaml

    name = os.fspath(path)
    content = read_bytes(path, limit=MAX_YAML_BYTES)
    aliases = f"{name} holds YAML aliases (*name), which the file of a ROS map does not need"
    described = parse_yaml(content, MapError, aliases, f"{name} is not valid YAML")
    node = yaml.compose(content, Loader=yaml.SafeLoader)
    pairs = node.value if node is not None and node.id == "mapping" else []
    keys = [key.value for key, _ in pairs if key.id == "scalar"]
    twice = next((key for key in keys if keys.count(key) > 1), None)
    if twice is not None:  # readers differ in which one counts
        raise MapError(f"{name} gives {shown(twice)} {keys.count(twice)} times; leave one of them")
    if not isinstance(described, dict):
        raise MapError(f"{name} is not the YAML of a ROS map: it needs {', '.join(_REQUIRED)}")
    missing = [key for key in _REQUIRED if key not in described]
    if missing:
        raise MapError(f"{name}: a ROS map needs {', '.join(_REQUIRED)}; missing here: {', '.join(missing)}")
    return described


def _number(name: str, value: Any) -> float:
    """Convert a number as yaml-cpp does: quoted or not, and 5e-2 without a decimal point too."""
    wanted = f"{name} is a number, not {shown(value)}"
    with caused_errors(wanted, MapError, ValueError, OverflowError, form="{}"):
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise ValueError
        return float(value)


def _origin(value: Any) -> tuple[float, float, float]:
    if not isinstance(value, list) or len(value) != 3:
        raise MapError(f"origin is a list of three numbers, x, y and yaw, not {shown(value)}")
    x, y, yaw = (_number("origin", part) for part in value)
    if not all(math.isfinite(part) for part in (x, y, yaw)):
        raise MapError(f"origin is finite x, y and yaw, not {shown(value)}")
    return x, y, yaw


_WRITTEN_THRESHOLDS = {"occupied_thresh": 0.65, "free_thresh": 0.196}  # as Nav2 writes trinary maps
UNKNOWN_GREY = 205
GREY_OF_STATE = {  # no data, free, unknown, occupied: as Nav2's map saver writes them in each mode
    "trinary": np.array([205, 254, 205, 0], np.uint8),
    "scale": np.array([205, 255, 205, 0], np.uint8),  # unknown is also transparent
    "raw": np.array([255, 0, 255, 100], np.uint8),
}
MAX_BYTES = 1 << 30  # of a PGM, which is held in memory
_MAGIC = (b"P2", b"P5")
_HEADER = re.compile(rb"P[25]" + 3 * rb"(?:\s|#[^\r\n]*[\r\n])+(\d{1,20})" + rb"(?=\s|$)")


@dataclass(frozen=True, slots=True)
class RosMap:
    """A map of the ROS navigation stack."""

    # (rows, cols) int8; occupancy in percent, 0 free to 100 occupied; -1 unknown. The first row is the top of
    # the image.
    cells: RosCells
    geobox: GeoBox  # in the metres of the map's frame, rotated if the origin has a yaw
    # Signs of a mistake in the files, and differences from what other releases of Nav2 read.
    warnings: tuple[str, ...] = ()

    @property
    def probabilities(self) -> Float32s:
        """Return the cells as 0..1, exactly 0.5 where unknown: (rows, cols) float32."""
        table = np.full(256, 0.5, np.float32)
        table[:101] = np.arange(101).astype(np.float32) / np.float32(100)
        return table[self.cells.view(np.uint8)]


def is_ros_map(path: Path_) -> bool:
    """Return whether a path has the extension of a ROS map's YAML file: .yaml or .yml."""
    return Path(path).suffix.lower() in (".yaml", ".yml")


def read_ros_map(path: Path_) -> RosMap:
    """Read a map from its YAML file and the image that it names."""
    metadata = read_ros_yaml(path)
    current_policy().check_file(path, metadata.image)
    grey, alpha = read_picture(metadata.image)
    transform = transform_of(metadata.origin, metadata.resolution, grey.shape[0])
    with named_errors(os.fspath(path), RasterError, MapError):
        geobox = GeoBox(grey.shape, transform, None)
    cells = metadata.rules.cells(grey, alpha)
    return RosMap(cells, geobox, tuple(_map_warnings(metadata, grey, alpha, cells)))


def _map_warnings(
    metadata: MapDescription, grey: Uint8s, alpha: Uint8s | None, cells: RosCells
) -> Iterator[str]:
    rules, picture = metadata.rules, metadata.image.name
    scaled = rules.mode == "scale"
    is_free = rules.table()[UNKNOWN_GREY] == 0
    free = int(((grey == UNKNOWN_GREY) & (cells == 0)).sum()) if is_free else 0
    if free and (alpha is None or not scaled):
        kept = f"{_WRITTEN_THRESHOLDS['free_thresh']} keeps them unknown"
        yield (
            f"{_cells(free)} of grey {UNKNOWN_GREY}, which map savers write for unknown, count as free by "
            f"free_thresh: {rules.free:g}; {'in this mode unknown is transparent' if scaled else kept}"
        )
    if alpha is not None and rules.mode == "trinary":
        other = int((rules.cells_before_2025(grey, alpha) != cells).sum())
        if other:
            yield (
                f"{picture} has an alpha channel, which Nav2 up to Jazzy averages into the grey: it reads "
                f"{_cells(other)} otherwise; save the picture without alpha"
            )


def _cells(count: int) -> str:
    return "1 cell" if count == 1 else f"{count:,} cells"


def check_ros_map(path: Path_, geobox: GeoBox, overwrite: bool = False, mode: str = "trinary") -> None:
    """Check that a map may be written to a path, before the work; raises the errors of `write_ros_map`."""
    for target in (Path(path), image_path(path, mode)):
        check_target(target, overwrite)
    placement(geobox)


def write_ros_map(
    path: Path_,
    states: NDArray[np.integer[Any]],
    geobox: GeoBox,
    overwrite: bool = False,
    mode: str = "trinary",
) -> None:
    """Write states as a map, NAME.yaml and its image, which Nav2 reads back as the same states.

    `states` (rows, cols) are 1 free, 2 unknown, 3 occupied; 0, no data, becomes unknown. Cells are square, in
    metres. `mode` ("trinary", "scale" or "raw") is that in which Nav2 reads the image: NAME.pgm, and for
    "scale" NAME.png, where unknown cells are transparent.
    """
    check_target(image_path(path, mode), overwrite)
    grey = GREY_OF_STATE[mode][np.asarray(states)]
    opaque = np.asarray(states) % 2 == 1 if mode == "scale" else None
    _write(path, grey, opaque, geobox, overwrite, mode, _WRITTEN_THRESHOLDS)


def write_ros_probabilities(
    path: Path_, probabilities: Float32s, geobox: GeoBox, overwrite: bool = False, mode: str = "scale"
) -> None:
    """Write probabilities as a map that Nav2 reads back to the per cent.

    They are (rows, cols), unknown where exactly 0.5. The mode "scale" gives a PNG of 256 greys, between
    thresholds of 0 and 1, "raw" a PGM of per cent. The rest is as of `write_ros_map`.
    """
    check_target(image_path(path, mode), overwrite)
    unknown = probabilities == 0.5
    if mode == "raw":
        grey = np.where(unknown, 255, np.floor(100 * probabilities.astype(np.float64) + 0.5)).astype(np.uint8)
        _write(path, grey, None, geobox, overwrite, mode, _WRITTEN_THRESHOLDS)
        return
    grey = (255 - np.floor(255 * probabilities.astype(np.float64) + 0.5)).astype(np.uint8)
    _write(path, grey, ~unknown, geobox, overwrite, mode, {"occupied_thresh": 1.0, "free_thresh": 0.0})


def write_ros_percent(path: Path_, values: Uint8s, geobox: GeoBox, overwrite: bool = False) -> None:
    """Write values from 0 to 100, (rows, cols), as a map in the mode "raw", which Nav2 reads as they are."""
    check_target(image_path(path, "raw"), overwrite)
    _write(path, values, None, geobox, overwrite, "raw", _WRITTEN_THRESHOLDS)


def _write(
    path: Path_,
    grey: Uint8s,
    opaque: Bools | None,
    geobox: GeoBox,
    overwrite: bool,
    mode: str,
    thresholds: Mapping[str, float],
) -> None:
    image = image_path(path, mode)
    resolution, origin, mirrored = placement(geobox)
    down = slice(None, None, -1 if mirrored else 1)
    position = {"resolution": resolution, "origin": origin}
    metadata = {"image": image.name, "mode": mode, **position, "negate": 0, **thresholds}
    with atomic_file(path, overwrite) as target:
        picture = target.with_name(image.name)
        if mode == "scale":
            write_png(picture, grey[down], opaque=None if opaque is None else opaque[down])
        else:
            picture.write_bytes(pgm_bytes(grey[down]))
        target.write_text(ros_yaml_text(metadata), encoding="utf-8")


def image_path(path: Path_, mode: str) -> Path:
    """Return the path of the image beside a YAML file; `mode` is "trinary", "scale" or "raw"."""
    if mode not in ROS_MODES:
        raise MapError(f"mode is trinary, scale or raw, not {mode!r}")
    return Path(path).with_suffix(".png" if mode == "scale" else ".pgm")


def read_picture(image: Path_) -> tuple[Uint8s, Uint8s | None]:
    """Read the 8-bit grey of the image of a map, and its alpha; None where it has none."""
    if is_pgm(image):
        samples, maximum = read_pgm(image)
        return to_8_bits(samples, maximum), None
    return read_grey(image)


def transform_of(origin: tuple[float, float, float], resolution: float, rows: int) -> Affine:
    """Make the transform of a map whose lower left corner lies at `origin` (x, y, yaw), rotated around it.

    `resolution` is metres per cell.
    """
    x, y, yaw = origin
    along, up = resolution * math.cos(yaw), resolution * math.sin(yaw)
    return Affine(along, up, x - rows * up, up, -along, y + rows * along)


def placement(geobox: GeoBox) -> tuple[float, list[float], bool]:
    """Compute resolution, origin (x, y, yaw), and whether the rows run upwards, to be written in reverse."""
    check_metres(geobox)
    a, b, c, d, e, f = tuple(geobox.transform)[:6]
    mirrored = a * e - b * d > 0
    side = math.hypot(a, d)
    turn = -1.0 if mirrored else 1.0
    if math.hypot(b - turn * d, e + turn * a) > 1e-6 * side:
        raise MapError("a ROS map has square cells and these are not; warp it first (gdalwarp -tr)")
    rows = 0 if mirrored else geobox.shape[0]
    x, y = b * rows + c, e * rows + f
    return side, [x, y, math.atan2(d, a)], mirrored


def is_pgm(path: Path_) -> bool:
    """Return whether a file begins with the magic number of a PGM."""
    return read_start(path, 2) in _MAGIC


def read_pgm(path: Path_) -> tuple[NDArray[np.integer[Any]], int]:
    """Read the samples of a PGM, and the sample that stands for white.

    They are (rows, cols), not negative; those above the maximum are white too.
    """
    content = read_bytes(path, limit=MAX_BYTES)
    header = _HEADER.match(content)
    if header is None:
        raise RasterReadError(
            f"{os.fspath(path)} is not a PGM: expected width, height and maximum after P2 or P5"
        )
    cols, rows, maximum = (int(number) for number in header.groups())
    if not (cols and rows and 0 < maximum < 65536):
        raise RasterReadError(
            f"the header of {os.fspath(path)} is {cols} x {rows} pixels of up to {maximum}; "
            "expected at least one pixel, and a maximum of 1 to 65535"
        )
    body, count = content[header.end() :], rows * cols
    plain = content[:2] == b"P2"
    samples = _plain(body, count, os.fspath(path)) if plain else _raw(body, count, maximum)
    if len(samples) < count:
        raise RasterReadError(
            f"{os.fspath(path)} says {cols} x {rows} pixels and holds {len(samples)}; it is truncated"
        )
    return samples[:count].reshape(rows, cols), maximum


def _raw(body: bytes, count: int, maximum: int) -> NDArray[np.integer[Any]]:
    """Decode at most `count` samples after one byte of white space, most significant byte first."""
    dtype = np.dtype(">u2" if maximum > 255 else "u1")
    available = max(len(body) - 1, 0) // dtype.itemsize
    return np.frombuffer(body, dtype, min(available, count), offset=1 if body else 0)


def _plain(body: bytes, count: int, path: str) -> Integers:
    """Decode at most `count` samples, written as text."""
    tokens = re.sub(rb"#[^\r\n]*", b"", body).split()[:count]
    if not all(word.isdigit() and len(word) < 10 for word in tokens):
        raise RasterReadError(f"{path} is a plain PGM (P2) and holds something other than numbers")
    return np.array([int(word) for word in tokens], np.int64)


def pgm_bytes(grey: Uint8s) -> bytes:
    """Encode a (rows, cols) uint8 array as a raw 8-bit PGM."""
    rows, cols = grey.shape
    return b"P5\n%d %d\n255\n" % (cols, rows) + np.ascontiguousarray(grey).tobytes()
