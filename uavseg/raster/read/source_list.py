"""Lists of rasters: a folder, a pattern, a file of names or a STAC item becomes the names of rasters."""

import glob
import os
import re
from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path
from urllib.parse import quote, urljoin

from uavseg.access import current_policy, is_address
from uavseg.arrays import Path_
from uavseg.errors import RasterReadError, caused_errors
from uavseg.inputs import parse_json, read_bytes, read_start, regular_file
from uavseg.plain_text import cause_of, first_of, shown
from uavseg.raster.access.opening import drivers_of, file_exists, image_extensions, is_remote, names_no_file

MAX_LIST = 64 << 20  # bytes of a file of names
MAX_ITEM = 16 << 20  # bytes of a STAC item
_ITEM = re.compile(r"(?is)(?:/vsicurl/)?(https?://[^#]+|(?!\w+://|/vsi).+?\.(?:geo)?json)(?:#(.*))?")
_IMAGES = tuple(image_extensions())
_NAMING = {"VRT", "WMS", "netCDF", "GPKG", "MBTiles"}  # drivers that may open what the content names


def expand_sources(names: Iterable[Path_]) -> list[str]:
    """Return the rasters that names stand for; a name that is none of the following stands for itself.

    - A folder: the image files in it, not those of its subfolders, in the order of their names. A VRT, which
      is made of other rasters, and files whose names begin with a point are not among them.
    - A pattern, such as ``tiles/*.tif`` or ``tiles/**/*.tif``: the files that match, in the order of their
      names.
    - ``@FILE``, as GDAL has it: the names in a text file, one a line; empty lines and lines that begin with
      ``#`` are skipped. They are relative to the working directory.
    - ``ITEM.json#NAME``: an asset of a STAC item, which is a file or an address.

    A file whose name looks like one of them is that file. A RasterReadError says that a folder holds no
    rasters, that nothing matches a pattern, or that a list or an item names nothing or cannot be read, an
    AccessError that one of them names what may not be opened.
    """
    return [raster for name in names for raster in _expanded(os.fspath(name))]


def is_list(name: Path_) -> bool:
    """Return whether a name may stand for several rasters."""
    text = os.fspath(name)
    if item_and_asset(text) or is_remote(text) or names_no_file(text):
        return item_and_asset(text) is not None
    if file_exists(text):
        return os.path.isdir(text)  # noqa: PTH112 - false for a name that is too long
    return text.startswith("@") or glob.has_magic(text)


def item_and_asset(source: str) -> tuple[str, str] | None:
    """Return the STAC item that a source names, and the name of its asset or ""; None if it names no item."""
    found, is_json = _ITEM.fullmatch(source), source.partition("?")[0].lower().endswith((".json", ".geojson"))
    if file_exists(source):
        is_item = is_json and Path(source).is_file() and b'"stac_version"' in read_start(source, MAX_ITEM)
        return (source, "") if is_item else None
    return (found[1], found[2] or "") if found and (is_json or found[2] is not None) else None


def parse_list(content: bytes) -> list[str]:
    """Return names of a list, which end with a line or, as `find -print0` writes them, with a zero byte."""
    if b"\0" in content:
        return [os.fsdecode(name) for name in content.split(b"\0") if name]
    lines = [line.rstrip(b"\r") for line in content.split(b"\n")]
    return [os.fsdecode(line) for line in lines if line.strip() and not line.startswith(b"#")]


def stem_of(name: Path_) -> str:
    """Return the stem of an output's name: that of the folder, or of the first raster that a name stands for.

    Examples
    --------
    >>> stem_of("tiles/a.tif")
    'a'
    """
    text = os.fspath(name)
    if os.path.isdir(text):  # noqa: PTH112
        return Path(text).resolve().name or "regions"
    return Path(_expanded(text)[0]).stem


def _expanded(name: str) -> list[str]:
    if not is_list(name):
        return [name]
    if found := item_and_asset(name):
        return [_asset_path(*found)]
    if os.path.isdir(name):  # noqa: PTH112
        return _rasters_in(name)
    return _listed(name[1:]) if name.startswith("@") else _matching(name)


def _rasters_in(folder: str) -> list[str]:
    """Return image files of a folder, in the order of their names."""
    failing = caused_errors(f"{folder} cannot be listed", RasterReadError, OSError)
    with failing, os.scandir(folder) as entries:
        shown = [entry for entry in entries if not entry.name.startswith(".") and entry.is_file()]
        found = [one.name for one in shown if one.name.lower().endswith(_IMAGES)]
    if not found:
        raise RasterReadError(
            f"{folder} is a folder without rasters (.tif, .jp2, .img, .png ...); name files, or a pattern "
            f"such as '{os.path.join(folder, '**', '*.tif')}' for its subfolders"  # noqa: PTH118
        )
    return [os.path.join(folder, name) for name in sorted(found)]  # noqa: PTH118 - keeps ./


def _matching(pattern: str) -> list[str]:
    try:
        result = sorted(name for name in glob.iglob(pattern, recursive=True) if Path(name).is_file())  # noqa: PTH207
    except (OSError, ValueError) as error:
        raise RasterReadError(f"{pattern} is no pattern that can be looked for ({error})") from error
    if not result:
        raise RasterReadError(f"no file matches {pattern}")
    return result


def _listed(path: str) -> list[str]:
    names = parse_list(read_bytes(path, limit=MAX_LIST))
    for name in filter(is_address, names):
        current_policy().check_address(path, name)
    if not names:
        raise RasterReadError(f"{path} names no rasters; write one name a line")
    return [_asset_path(*found, listed=True) if (found := item_and_asset(name)) else name for name in names]


def _asset_path(item: str, name: str, listed: bool = False) -> str:
    """Return the checked path or address of an asset; the address of a `listed` one has to be allowed."""
    from http.client import HTTPException
    from urllib.request import HTTPError, urlopen

    online = is_address(item)
    try:
        with urlopen(item, timeout=30) if online else regular_file(item).open("rb") as file:
            content = file.read(MAX_ITEM + 1)
        if len(content) > MAX_ITEM:
            raise ValueError(f"it has more than {MAX_ITEM:,} bytes")
        found = parse_json(content.decode())
        if found["type"] != "Feature":
            raise ValueError(f"its type is {shown(found['type'])}, not 'Feature'")
        hrefs = {key: asset.get("href") for key, asset in found["assets"].items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError, HTTPException) as error:
        if isinstance(error, HTTPError):
            error.close()  # an answer that is an error keeps its connection
        raise RasterReadError(f"{item} cannot be read as a STAC item ({cause_of(error)})") from error
    if not isinstance(href := hrefs.get(name), str):
        images = [key for key, one in hrefs.items() if str(one).split("?")[0].lower().endswith(_IMAGES)]
        names = list(dict.fromkeys([*get_close_matches(name, images[:100], 1), *images]))
        why = f"has no asset {shown(name)} with an address" if name else "is a STAC item"
        hint = f"name one: {item}#{names[0]} (images: {first_of(names, 40)})" if names else "none is an image"
        raise RasterReadError(f"{item} {why}; of its assets, {hint}")
    address = urljoin(item, quote(href, "%/:?#@!$&'()*+,;=~", errors="replace")) if online else href
    known = ("https://", urljoin(item, "/").lower()) if online else "https://"
    if address.lower().startswith(known) and not listed and _NAMING.isdisjoint(drivers_of(address)):
        return address
    return os.fspath(current_policy().check_name(item, address, Path(item).parent) or address)
