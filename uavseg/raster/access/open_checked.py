"""Checked opening of a raster: named files, driver, sizes. Every raster of a user is opened here first.

GDAL opens the files that a VRT names, and those beside a raster (.ovr, .msk), by any driver that recognises
them. So each of them has to lie where the access policy allows it, to be a regular file, and to be what its
extension promises.

A block is decoded whole, so a header with a damaged block size asks for gigabytes. What a block can hold is
bounded by the size of the file: no compression in use makes more than about 1000 bytes of one.
"""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from rasterio.errors import RasterioIOError
from rasterio.io import DatasetReader

from uavseg.access import current_policy, is_address
from uavseg.dataclass import dataclass
from uavseg.errors import AccessError, RasterError, RasterReadError, caused_errors
from uavseg.inputs import read_bytes, read_start, regular_file
from uavseg.raster.access import opening, untrusted
from uavseg.raster.grid.tiling import Window
from uavseg.raster.tiff.directories import is_by_pixel, stored_blocks

MAX_BANDS = 4096  # satellite images with most bands have a few hundred
MAX_RATIO = 2000  # bytes of pixels for each byte of a compressed file
FREE_BYTES = 64 << 20  # blocks up to this size are decoded whatever the size of the file
MAX_WHOLE_PIXELS = 1 << 28  # of an image that is read whole
_FILES = {"sourcefilename", "sourcedataset", "dempath", "grids", "indexdataset"}
_FILE_KEYS = {"x_dataset", "y_dataset", "overview_file", "rpc_dem"}
_CRS = {"srs", "sourcesrs", "targetsrs", "projection", "gcpprojection"}
_PLAIN_CRS = re.compile(r"[A-Za-z][\w+.-]*(?::[\w+.-]*)*")
_PAGE = re.compile(r"GTIFF_DIR:\d+:", re.IGNORECASE)
MAX_NESTING = 4  # VRTs in each other
MAX_READS = 1_000_000  # reads of sources that one VRT may cost
MAX_NESTED_READS = 100_000  # the same for VRTs of VRTs, in which a small file can name many
_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_HDF5 = b"\x89HDF\r\n\x1a\n"
_IMAGES_BESIDE = (".ovr", ".OVR", ".msk", ".MSK")
_TEXTS_BESIDE = (".aux.xml", ".aux", ".hdr", ".HDR")
_TEXTS_OF_STEM = (
    *(".aux", ".hdr", ".tfw", ".tifw", ".jgw", ".pgw", ".wld", ".prj"),
    *(".imd", ".rpb", ".ige", ".rrd"),
)
_DATABASES = (("GPKG",), ("MBTiles",))


@dataclass(frozen=True, slots=True)
class NamedSource:
    """A source as a VRT names it."""

    name: str  # a path, or an address
    folder: Path  # base of a relative path
    is_raw: bool  # whether the bytes of the file are read as pixels, whatever it holds


def is_vrt(start: bytes) -> bool:
    """Return whether the first bytes of a file are those of a VRT, as GDAL recognises it.

    Examples
    --------
    >>> is_vrt(b' <VRTDataset rasterXSize="1" rasterYSize="1">'), is_vrt(b"II*\\0 <VRTDataset>")
    (True, False)
    """
    return b"<vrtdataset" in start.split(b"\0", 1)[0].lower()


def sources_of(path: str, content: bytes) -> Iterator[NamedSource]:
    """Yield the sources that the XML of a VRT names, each as often as it is named.

    `path` is that of the VRT, for its folder and for messages. A RasterReadError says that it is not valid
    XML, an AccessError that it contains something that may open files and cannot be checked.
    """
    from xml.etree import ElementTree  # rasters other than VRTs need none

    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        raise AccessError(f"{path} declares XML entities, which a VRT does not need; remove them")
    try:
        root = ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise RasterReadError(f"{path} is not a valid VRT ({error})") from error
    pending = [(root, False)]
    while pending:
        element, is_raw = pending.pop()
        attributes = {_plain(name): value for name, value in element.attrib.items()}
        is_raw = is_raw or attributes.get("subclass", "").lower() == "vrtrawrasterband"
        relative = attributes.get("relativetovrt", "0").strip() not in ("", "0")
        folder = Path(path).parent if relative else Path()
        key = attributes.get("key", attributes.get("name", "")).lower()
        for name, value in ((_plain(element.tag), element.text or ""), *attributes.items()):
            text = value.strip()
            if name == "pixelfunctionlanguage" and text.lower() == "python":
                raise AccessError(f"{path} contains a pixel function in Python, and code of files is not run")
            is_plain = text == "" or text.startswith(("{", "+")) or "[" in text or _PLAIN_CRS.fullmatch(text)
            if name in _CRS and not is_plain:
                raise AccessError(
                    f"{path} names the coordinate system {text[:60]!r}; expected WKT or EPSG:NUMBER"
                )
            is_file = name in _FILES or (name == "mdi" and key in _FILE_KEYS)
            if is_file or (name in ("argument", "option") and "filename" in key):
                yield NamedSource(_PAGE.sub("", text), folder, is_raw)
        pending += [(child, is_raw) for child in reversed(element)]


def _plain(name: object) -> str:
    """Return name of an element or an attribute without its namespace, in lower case."""
    return str(name).rsplit("}", 1)[-1].lower()


def check_limits(path: str, source: DatasetReader) -> None:
    """Refuse too many bands, and blocks that are larger than the file can hold (RasterError)."""
    if source.count > MAX_BANDS:
        raise RasterError(
            f"{path} has {source.count:,} bands, and at most {MAX_BANDS:,} are read; is its header damaged?"
        )
    if source.count == 0 or source.driver == "VRT":  # the blocks of a VRT are those of its sources
        return
    rows, cols = source.block_shapes[0]
    size = rows * cols * np.dtype(source.dtypes[0]).itemsize
    if size * source.count <= FREE_BYTES:
        return
    if is_by_pixel(source):
        size *= source.count
    if size <= max(FREE_BYTES, _capacity(path, source)):
        return
    stored = stored_blocks(path, source) if source.driver == "GTiff" else None
    if stored is None or stored.any():  # a sparse file may store no block at all
        raise RasterError(
            f"{path} has blocks of {cols:,} x {rows:,} pixels in {source.count:,} bands, {size / 1e9:.1f} GB "
            "each, which the file is too small to hold; its header is damaged"
        )


def check_readable_whole(path: str, source: DatasetReader) -> None:
    """Refuse an image that is too large to be read whole, or larger than its file can hold (RasterError)."""
    rows, cols = source.shape
    if rows * cols > MAX_WHOLE_PIXELS:
        raise RasterError(
            f"{path} has {cols:,} x {rows:,} pixels, and at most {MAX_WHOLE_PIXELS:,} are read at once"
        )
    if rows * cols * source.count > max(FREE_BYTES, _capacity(path, source)):
        raise RasterError(f"{path} claims {cols:,} x {rows:,} pixels, which the file is too small to hold")


def _capacity(path: str, source: DatasetReader) -> int:
    """Return how many bytes of pixels a file can hold; without bound where its size is not known."""
    try:
        size = Path(path).stat().st_size
    except (OSError, ValueError):
        return 1 << 62
    plain = source.driver == "GTiff" and source.compression is None
    return size if plain else size * MAX_RATIO


class NamedFiles:
    """The files that one raster, which the user named `owner`, consists of, as they are found."""

    def __init__(self, owner: str) -> None:
        self.owner = owner
        self.rasters: dict[str, None] = {}  # sources that are no VRT, in the order in which they are named
        self._reads: dict[Path, int] = {}

    def check(self) -> None:
        """Check the raster and all that it names, unless its name is that of no local file.

        A RasterReadError says that it is not a regular file, an AccessError that it names what may not be
        opened or is something else than its extension promises, a RasterError that VRTs lie too deep in each
        other or read too many sources.
        """
        path = regular_file(self.owner)
        self._check_beside(path)
        if path.suffix.lower() == ".vrt":
            self._check_vrt(path, 1)
        else:
            self._check_content(path, self.owner)

    def _check_vrt(self, path: Path, depth: int) -> int:
        """Check the sources of a VRT; returns how many are read where it is read once."""
        if depth > MAX_NESTING:
            raise RasterError(f"{self.owner} has VRTs that lie more than {MAX_NESTING} deep in each other")
        if path in self._reads:
            return self._reads[path]
        reads, nested = 0, depth > 1
        for source in sources_of(str(path), read_bytes(path)):
            target = current_policy().check_name(self.owner, source.name, source.folder)
            if target is None or source.is_raw:
                reads += 1
            elif target.suffix.lower() == ".vrt":
                nested = True
                reads += self._check_vrt(target, depth + 1)
            else:
                reads += 1
                if str(target) not in self.rasters:
                    self._check_beside(target)
                    self._check_content(target, f"{self.owner} names {target}, which")
                    self.rasters[str(target)] = None
            limit = MAX_NESTED_READS if nested else MAX_READS
            if reads > limit:
                raise RasterError(
                    f"{self.owner} reads more than {limit:,} sources; build one VRT of fewer files "
                    "(gdalbuildvrt), or copy it to a GeoTIFF"
                )
        self._reads[path] = reads
        return reads

    def _check_content(self, path: Path, subject: str) -> None:
        """Refuse a description of other files under a name that promises an image."""
        if opening.drivers_of(str(path)) == ("GTiff",) and read_start(path, 4) in _TIFF:
            return
        start = read_start(path)
        if is_vrt(start):
            raise AccessError(f"{subject} holds a VRT, which names other files; call it .vrt if you trust it")
        if start.startswith(_HDF5):
            raise AccessError(
                f"{subject} is HDF5, which may name other files unseen; convert it to "
                'GeoTIFF (gdal_translate), or name its subdataset (NETCDF:"a.nc":band) if you trust it'
            )
        if start.startswith(untrusted.NETCDF):
            untrusted.check_netcdf_header(path)
        elif start.startswith(untrusted.JPEG2000):
            untrusted.check_geojp2(path)
        elif path.suffix.lower() == ".xml":
            current_policy().check_address(subject, "of a web service")
        elif start.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] in (b"<", b"{", b"["):
            raise AccessError(f"{subject} holds a description in text, not an image")

    def _check_beside(self, path: Path) -> None:
        """Check the files that GDAL opens because they lie beside a raster."""
        name, stem = str(path), str(path.with_suffix(""))
        for beside in (name + end for end in _IMAGES_BESIDE):
            if os.path.lexists(beside):
                current_policy().check_file(self.owner, beside)
                if read_start(beside, 4) not in _TIFF:
                    raise AccessError(f"{beside} is not a TIFF file, as overviews and masks are")
        for beside in (*(name + end for end in _TEXTS_BESIDE), *(stem + end for end in _TEXTS_OF_STEM)):
            if os.path.lexists(beside):
                current_policy().check_file(self.owner, beside)
                if is_vrt(read_start(beside)):  # GDAL ignores what it cannot read: a raster without its place
                    raise AccessError(f"{beside} holds a VRT, which is not what lies beside a raster")


def check_named_file(owner: str, name: str) -> None:
    """Refuse a file that may not be opened, which GDAL or metadata say a raster consists of (AccessError)."""
    if opening.names_no_file(name):
        raise AccessError(f"{owner} names {name[:60]!r}, which is not a file")
    target = current_policy().check_name(owner, name, Path())
    if target is not None and is_vrt(read_start(target)):
        raise AccessError(f"{owner} names {name}, which holds a VRT; name the sources in one VRT")


@contextmanager
def open_checked(path: str) -> Iterator[DatasetReader]:
    """Open a raster once what it names and the sizes in its header are known to be allowed.

    `path` is as the user named it: a file, or any name that GDAL opens. An UavsegError says that it names
    what the access policy in effect does not allow, or that its header is beyond the limits, a RasterioError
    that GDAL cannot open it.
    """
    path, found = opening.as_file_name(path), None
    if is_local(path):
        found = NamedFiles(path)
        found.check()
        for source_path in (path, *found.rasters):
            if opening.drivers_of(source_path) in _DATABASES and Path(source_path).is_file():
                untrusted.check_database(source_path, source_path, RasterReadError)
    elif page := _PAGE.match(path):
        regular_file(path[page.end() :])
    elif opening.drivers_of(path) == ("VRT",):  # which cannot be read before GDAL opens it
        if not is_address(path):
            raise AccessError(
                f"{path} lies in an archive, so what it names cannot be checked; unpack the archive"
            )
        current_policy().check_address(path, "of a file, which cannot be checked before it is read")
    with opening.gdal_env(is_online(path)):
        for source_path in found.rasters if found else ():
            with open_by(source_path, opening.drivers_of(source_path)) as source:
                _check_opened(path, source_path, source)
                if not opening.is_sequential(source.driver):
                    continue
                unread = f"{path} names {source_path}, which cannot be read as a whole"
                # each row, because GDAL would look for ever for one after a damaged one
                with caused_errors(unread, RasterReadError, *opening.GDAL_ERRORS, form="{} ({}); repair it"):
                    opening.read_rows_before(source, Window(0, 0, *source.shape))
        with open_by(path, opening.drivers_of(path)) as source:
            _check_opened(path, path, source)
            yield source


def open_by(path: str, drivers: tuple[str, ...]) -> DatasetReader:
    """Return a raster, opened by one of these drivers or any; RasterioIOError of the first if none can."""
    first: RasterioIOError | None = None
    for driver in drivers or (None,):
        try:
            with opening.unread_tags_are_errors(path):
                return opening.quiet_open(path, driver=driver)
        except RasterioIOError as error:
            first = first or error
    assert first is not None
    raise first


def is_local(path: str) -> bool:
    """Return whether a name is that of a local file, which may not exist."""
    return not (is_address(path) or path.startswith("/vsi") or "://" in path or opening.names_no_file(path))


def is_online(path: str) -> bool:
    """Return whether a raster that the user named may make requests: by its own name, or if allowed."""
    return current_policy().allow_network or is_address(path) or "://" in path


def _check_opened(owner: str, path: str, source: DatasetReader) -> None:
    """Check what is known of a raster only once it is open."""
    overview = source.tags(ns="OVERVIEWS").get("OVERVIEW_FILE")
    if overview is not None:
        name = overview.removeprefix(":::BASE:::")
        check_named_file(owner, name if name == overview else str(Path(path).parent / name))
    check_limits(path, source)
    if source.driver not in ("GTiff", "VRT", "PNG", "JPEG") and is_local(path):
        for name in source.files:
            check_named_file(owner, name)
    if source.driver == "VRT" and not is_local(path):
        for text in source.tags(ns="xml:VRT").values():
            for named in sources_of(path, text.encode()):
                current_policy().check_name(path, named.name, Path())
