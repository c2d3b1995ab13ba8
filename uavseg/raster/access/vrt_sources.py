"""Sources of a VRT: the files and addresses that its XML names.

Format: https://gdal.org/drivers/raster/vrt.html. GDAL compares names without case, and takes an attribute for
an element; so does this. XML that declares entities, Python code and names of coordinate systems that are
neither WKT nor a code are refused, because reading them may open files or addresses.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from uavseg.dataclass import dataclass
from uavseg.errors import AccessError, RasterReadError

if TYPE_CHECKING:
    from xml.etree import ElementTree

_FILES = {"sourcefilename", "sourcedataset", "dempath", "grids", "indexdataset"}
_FILE_KEYS = {"x_dataset", "y_dataset", "overview_file", "rpc_dem"}
_CRS = {"srs", "sourcesrs", "targetsrs", "projection", "gcpprojection"}
_PLAIN_CRS = re.compile(r"[A-Za-z][\w+.-]*(?::[\w+.-]*)*")
_PAGE = re.compile(r"GTIFF_DIR:\d+:", re.IGNORECASE)


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


def sources_of(path: str, text: bytes) -> Iterator[NamedSource]:
    """Yield the sources that the XML of a VRT names, each as often as it is named.

    `path` is that of the VRT, for its folder and for messages, and `text` its content. A RasterReadError says
    that it is not valid XML, an AccessError that it contains something that may open files and cannot be
    checked.
    """
    from xml.etree import ElementTree  # rasters other than VRTs need none

    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise AccessError(f"{path} declares XML entities, which a VRT does not need; remove them")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise RasterReadError(f"{path} is not a valid VRT ({error})") from error
    yield from _named_in(path, root, False)


def _named_in(path: str, root: "ElementTree.Element", is_raw: bool) -> Iterator[NamedSource]:
    pending = [(root, is_raw)]
    while pending:
        element, is_raw = pending.pop()
        attributes = {_plain(name): value for name, value in element.attrib.items()}
        is_raw = is_raw or attributes.get("subclass", "").lower() == "vrtrawrasterband"
        relative = attributes.get("relativetovrt", "0").strip() not in ("", "0")
        folder = Path(path).parent if relative else Path()
        for name, value in ((_plain(element.tag), element.text or ""), *attributes.items()):
            _check_value(path, name, value)
            if name in _FILES or _is_file_argument(name, attributes):
                yield NamedSource(_PAGE.sub("", value.strip()), folder, is_raw)
        pending += [(child, is_raw) for child in reversed(element)]


def _plain(name: object) -> str:
    """Return name of an element or an attribute without its namespace, in lower case."""
    return str(name).rsplit("}", 1)[-1].lower()


def _is_file_argument(name: str, attributes: dict[str, str]) -> bool:
    """Return whether an element is metadata or an argument whose value GDAL opens as a file."""
    key = attributes.get("key", attributes.get("name", "")).lower()
    return (name == "mdi" and key in _FILE_KEYS) or (name in ("argument", "option") and "filename" in key)


def _check_value(path: str, name: str, value: str) -> None:
    text = value.strip()
    if name == "pixelfunctionlanguage" and text.lower() == "python":
        raise AccessError(f"{path} contains a pixel function in Python, and code of files is not run")
    is_definition = text.startswith(("{", "+")) or "[" in text
    if name in _CRS and text and not is_definition and not _PLAIN_CRS.fullmatch(text):
        raise AccessError(f"{path} names the coordinate system {text[:60]!r}; expected WKT or EPSG:NUMBER")
