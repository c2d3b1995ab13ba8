"""GeoJSON writer (RFC 7946, sequences RFC 8142): one feature per line, in bulk from integers."""

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import isfinite
from typing import IO, Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import mapping

from uavseg.raster.geodesy.globe import parse_crs
from uavseg.regions.formats.decimal_text import degree_words, pack_words, unpack_lines, write_degrees
from uavseg.regions.formats.metadata import METADATA_KEY, metadata_text
from uavseg.regions.shapes import RaggedPolygons
from uavseg.regions.table import Regions
from uavseg.regions.wgs84.to_wgs84 import wgs84_batches


@dataclass(frozen=True, slots=True)
class GeoJsonForm:
    """Form of GeoJSON on a stream, with the options of rasterio's and fiona's commands.

    Parameters
    ----------
    projected : bool
        Coordinates in the CRS of the regions, which a collection names in its member ``crs`` (GeoJSON 2008).
    sequence : bool
        One feature a line, in place of a collection.
    rs : bool
        The character RS (0x1E) before each feature of a sequence (RFC 8142).
    """

    projected: bool = False
    sequence: bool = False
    rs: bool = False


COLLECTION = GeoJsonForm()
"""A collection in longitude and latitude."""


def write_geojson(regions: Regions, stream: IO[bytes], form: GeoJsonForm = COLLECTION) -> None:
    """Write regions as a FeatureCollection, or as a sequence of features.

    Longitudes and latitudes are in WGS 84 with decimals as the pixels need (see `decimals_for`), exteriors
    run counter-clockwise, and polygons that cross the antimeridian are split there. Without a CRS the local
    coordinates are written unchanged. A collection has the metadata of the regions as its foreign member
    ``uavseg``. Regions that are not on the Earth are refused with an OutputError.

    Parameters
    ----------
    regions : Regions
    stream : binary file
    form : GeoJsonForm
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
    for parts in zip(ids, _properties(regions), geometries, strict=True):
        yield b'{"type":"Feature","id":%d,"properties":%b,"geometry":%b}' % parts


def _properties(regions: Regions) -> Iterable[bytes]:
    """Format the attributes of each region as a JSON object."""
    columns = regions.columns
    template = "{" + ",".join(f"{json.dumps(name)}:%s" for name in columns) + "}"
    texts = [_texts(column) for column in columns.values()]
    return ((template % values).encode() for values in zip(*texts, strict=True))


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
