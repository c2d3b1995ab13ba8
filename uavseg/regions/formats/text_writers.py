"""GeoJSON (RFC 7946, sequences RFC 8142) and KML writers: one feature per line, in bulk from integers.

A coordinate is written as words of four bytes that are looked up in tables; bytes that a word does not need
are zero, and all zero bytes are removed at the end.
"""

import json
from collections.abc import Iterable, Iterator
from functools import cache
from html import escape
from itertools import pairwise
from math import isfinite
from typing import IO, Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import mapping

from uavseg.arrays import Integers, Uint32s
from uavseg.dataclass import dataclass
from uavseg.raster.geodesy.globe import MIN_DECIMALS, parse_crs
from uavseg.regions.formats.metadata import METADATA_KEY, metadata_text
from uavseg.regions.shapes import RaggedPolygons, corner_counts
from uavseg.regions.table import Regions
from uavseg.regions.wgs84.to_wgs84 import wgs84_batches

MAX_CORNERS = 30_000  # of a polygon with its holes, that Google Earth draws

_HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2">
<Document id="uavseg">
<Style id="region">
<LineStyle><color>ff00a5ff</color><width>2</width></LineStyle><PolyStyle><fill>0</fill></PolyStyle>
</Style>
%s<Schema name="regions" id="regions">
%s
</Schema>
<Folder><name>regions</name>
"""
_METADATA = '<ExtendedData><Data name="%s"><value>%s</value></Data></ExtendedData>\n'
_TAIL = "</Folder>\n</Document>\n</kml>\n"
_TYPES = {"i": "int", "f": "double", "O": "string"}
_POLYGON = b"<Polygon><outerBoundaryIs>%b</outerBoundaryIs>%b</Polygon>"
_HOLE = b"<innerBoundaryIs>%b</innerBoundaryIs>"
_RING = b"<LinearRing><coordinates>%b</coordinates></LinearRing>"


def degree_words(decimals: int) -> int:
    """Return the number of words of a coordinate with a number of decimals of degrees."""
    return 3 if decimals == MIN_DECIMALS else 4


def write_degrees(value: Integers, words: Uint32s, decimals: int, after: str = "") -> None:
    """Format integers of the last decimal as degrees.

    `value`, (n,) int64, is in units of the last decimal, within -180..180 degrees, or -90..90 degrees if
    `after` is given: a single character before the number. `words`, (n, degree_words(decimals)) uint32, get
    sign and degrees, point and three decimals, four decimals, and those that follow, 7 to 11.
    """
    degrees = _degrees(after)
    unit, rest = 10**decimals, 10 ** (decimals - MIN_DECIMALS)
    size = np.abs(value)
    whole = size // unit
    words[:, 0] = degrees[whole + (value < 0) * (len(degrees) // 2)]
    fraction = size - whole * unit
    if rest > 1:
        first = fraction // rest
        words[:, 3] = _decimals(decimals - MIN_DECIMALS)[fraction - first * rest]
        fraction = first
    fraction = fraction.astype(np.int32)
    words[:, 1] = _decimals(3, ".")[fraction // 10_000]
    words[:, 2] = _decimals(4)[fraction % 10_000]


def pack_words(texts: Iterable[str]) -> Uint32s:
    """Pack texts of up to four bytes as words, (n,) uint32."""
    return np.frombuffer("".join(text.ljust(4, "\0") for text in texts).encode(), np.uint32)


def unpack_lines(words: Uint32s) -> list[bytes]:
    """Return the lines of text in an array of words; the last one ends with a newline too.

    Examples
    --------
    >>> words = np.empty((2, 4), np.uint32)
    >>> write_degrees(np.array([-5_000_000, 1_230_000_000]), words[:, :3], 7)
    >>> words[:, 3] = pack_words(["\\n"])
    >>> unpack_lines(words)
    [b'-0.5000000', b'123.0000000']
    """
    return words.tobytes().translate(None, b"\0").split(b"\n")[:-1]


@cache
def _degrees(after: str) -> Uint32s:
    """Return the words of 0, 1, 2, ... and then of -0, -1, -2, ..."""
    largest = 90 if after else 180
    return pack_words(f"{after}{sign}{whole}" for sign in ("", "-") for whole in range(largest + 1))


@cache
def _decimals(count: int, before: str = "") -> Uint32s:
    """Return the words of all numbers of `count` digits, up to four."""
    return pack_words(f"{before}{number:0{count}}" for number in range(10**count))


@dataclass(frozen=True, slots=True)
class GeoJsonForm:
    """Form of GeoJSON on a stream, with the options of rasterio's and fiona's commands."""

    projected: bool = False  # in the CRS of the regions, named in the member ``crs`` (GeoJSON 2008)
    sequence: bool = False  # one feature a line, in place of a collection
    rs: bool = False  # the character RS (0x1E) before each feature of a sequence (RFC 8142)


COLLECTION = GeoJsonForm()  # a collection in longitude and latitude


def write_geojson(regions: Regions, stream: IO[bytes], form: GeoJsonForm = COLLECTION) -> None:
    """Write regions as a FeatureCollection, or as a sequence of features.

    Longitudes and latitudes are in WGS 84 with decimals as the pixels need (see `decimals_for`), exteriors
    run counter-clockwise, and polygons that cross the antimeridian are split there. Without a CRS the local
    coordinates are written unchanged. A collection has the metadata of the regions as its foreign member
    ``uavseg``. Regions that are not on the Earth are refused with an OutputError.
    """
    features = _features(regions, form.projected)
    if form.sequence:
        for feature in features:
            stream.write(b"\x1e" * form.rs + feature + b"\n")
        return
    crs = b""
    if form.projected and regions.wkt is not None:
        name = crs_name(regions.wkt) or regions.wkt
        crs = b'"crs":%b,' % _compact({"type": "name", "properties": {"name": name}})
    text = metadata_text(regions.metadata)
    member = b'"%b":%b,' % (METADATA_KEY.encode(), text.encode()) if text else b""
    stream.write(b'{"type":"FeatureCollection",%b%b"features":[' % (member, crs))
    separator = b"\n"
    for feature in features:
        stream.write(separator + feature)
        separator = b",\n"
    stream.write(b"\n]}\n")


def crs_name(wkt: str) -> str | None:
    """Return the name of a CRS by its code (OGC URN), if it has one."""
    authority = parse_crs(wkt).to_authority()
    return None if authority is None else f"urn:ogc:def:crs:{authority[0]}::{authority[1]}"


def _compact(value: Any) -> bytes:
    return json.dumps(value, separators=(",", ":")).encode()


def _features(regions: Regions, projected: bool) -> Iterator[bytes]:
    if projected or regions.wkt is None:
        geometries: Iterator[bytes] = (text.encode() for text in shapely.to_geojson(regions.polygons))
    else:
        geometries = _wgs84_geometries(regions)
    ids = regions.columns["id"].tolist()
    columns = regions.columns
    template = "{" + ",".join(f"{json.dumps(name)}:%s" for name in columns) + "}"
    texts = [_texts(column) for column in columns.values()]
    properties = ((template % values).encode() for values in zip(*texts, strict=True))
    for parts in zip(ids, properties, geometries, strict=True):
        yield b'{"type":"Feature","id":%d,"properties":%b,"geometry":%b}' % parts


def _texts(column: NDArray[Any]) -> list[str]:
    """Format values as JSON: floats with up to twelve significant digits and a point, NaN as null."""
    if column.dtype.kind == "f":
        return [repr(float(f"{x:.12g}")) if isfinite(x) else "null" for x in column.tolist()]
    if column.dtype.kind in "iu":
        return [str(x) for x in column.tolist()]
    texts = {x: json.dumps(x, ensure_ascii=False) for x in set(column.tolist())}
    return [texts[x] for x in column.tolist()]


def _wgs84_geometries(regions: Regions) -> Iterator[bytes]:
    for batch in wgs84_batches(regions):
        polygons = _polygon_texts(batch.polygons, batch.decimals)
        for place, (first, last) in enumerate(pairwise(batch.polygons.regions.tolist())):
            if place in batch.others:
                yield _compact(mapping(batch.others[place]))
            elif last == first + 1:
                yield b'{"type":"Polygon","coordinates":%b}' % polygons[first]
            else:
                yield b'{"type":"MultiPolygon","coordinates":[%b]}' % b",".join(polygons[first:last])


def _polygon_texts(flat: RaggedPolygons, decimals: int) -> list[bytes]:
    """Format the coordinates of each polygon as JSON: one row of 4-byte words per vertex, with brackets."""
    size = degree_words(decimals)
    rows = np.empty((len(flat.vertices), 2 * size + 2), np.uint32)
    ends = flat.rings[flat.polygons]
    rows[:, 0] = _OPEN_VERTEX
    rows[flat.rings[:-1], 0] = _OPEN_RING
    rows[ends[:-1], 0] = _OPEN_POLYGON
    rows[:, -1] = _CLOSE_VERTEX
    rows[flat.rings[1:] - 1, -1] = _CLOSE_RING
    rows[ends[1:] - 1, -1] = _CLOSE_POLYGON
    write_degrees(flat.vertices[:, 0], rows[:, 1 : 1 + size], decimals)
    write_degrees(flat.vertices[:, 1], rows[:, 1 + size : -1], decimals, after=",")
    return unpack_lines(rows)


_OPEN_VERTEX, _OPEN_RING, _OPEN_POLYGON = pack_words(["[", "[[", "[[["])
_CLOSE_VERTEX, _CLOSE_RING, _CLOSE_POLYGON = pack_words(["],", "]],", "]]]\n"])


def write_kml(regions: Regions, stream: IO[bytes]) -> None:
    """Write regions as KML, in WGS 84 with decimals as the pixels need, cut at the antimeridian.

    An OutputError says that the regions are not on the Earth.
    """
    fields = (
        f'<SimpleField name="{name}" type="{_TYPES[column.dtype.kind]}"/>'
        for name, column in regions.columns.items()
    )
    about = metadata_text(regions.metadata)
    about = about and _METADATA % (METADATA_KEY, escape(about, quote=False))
    stream.write((_HEAD % (about, "\n".join(fields))).encode())
    ids = regions.columns["id"].tolist()
    for id_, attributes, geometry in zip(ids, _attributes(regions), _geometries(regions), strict=True):
        stream.write(
            b'<Placemark id="region.%d"><name>%d</name><styleUrl>#region</styleUrl>%b%b</Placemark>\n'
            % (id_, id_, attributes, geometry)
        )
    stream.write(_TAIL.encode())


def kml_notes(regions: Regions) -> list[str]:
    """Return what Google Earth cannot draw of regions; empty where it draws all."""
    counts = corner_counts(regions.polygons)
    many = int(np.count_nonzero(counts > MAX_CORNERS))
    if not many:
        return []
    which = "one polygon has" if many == 1 else f"{many:,} polygons have"
    return [
        f"{which} more than {MAX_CORNERS:,} corners (up to {int(counts.max()):,}), which Google Earth draws "
        "wrongly or not at all; --simplify METRES (simplify=METRES) leaves fewer, and GIS software reads "
        "them as they are"
    ]


def _attributes(regions: Regions) -> Iterator[bytes]:
    """Yield the attributes of each region as XML; missing values are omitted."""
    columns = [_data(name, column) for name, column in regions.columns.items()]
    for values in zip(*columns, strict=True):
        table = f'<SchemaData schemaUrl="#regions">{"".join(values)}</SchemaData>'
        yield f"<ExtendedData>{table}</ExtendedData>".encode()


def _data(name: str, column: NDArray[Any]) -> Iterator[str]:
    for value in column.tolist():
        text = f"{value:.12g}" if isinstance(value, float) else escape(str(value), quote=False)
        yield "" if text == "nan" else f'<SimpleData name="{name}">{text}</SimpleData>'


def _geometries(regions: Regions) -> Iterator[bytes]:
    for batch in wgs84_batches(regions):
        flat = RaggedPolygons.from_geometries(batch.geometries())
        rings = [_RING % text for text in _ring_texts(flat, batch.decimals)]
        polygons = []
        for first, last in pairwise(flat.polygons.tolist()):
            holes = b"".join(_HOLE % ring for ring in rings[first + 1 : last])
            polygons.append(_POLYGON % (rings[first], holes))
        for first, last in pairwise(flat.regions.tolist()):
            text = b"".join(polygons[first:last])
            yield text if last == first + 1 else b"<MultiGeometry>%b</MultiGeometry>" % text


def _ring_texts(flat: RaggedPolygons, decimals: int) -> list[bytes]:
    """Return the coordinates of each ring as text."""
    units = np.rint(flat.vertices * 10**decimals).astype(np.int64)
    size = degree_words(decimals)
    rows = np.empty((len(units), 2 * size + 1), np.uint32)
    write_degrees(units[:, 0], rows[:, :size], decimals)
    write_degrees(units[:, 1], rows[:, size:-1], decimals, after=",")
    rows[:, -1] = pack_words([" "])
    rows[flat.rings[1:] - 1, -1] = pack_words(["\n"])
    return unpack_lines(rows)
