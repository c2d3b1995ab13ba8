"""What cannot be read is an error that says why, not a traceback and not a region less."""

import json
import random
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import shapely

from uavseg.errors import RegionError
from uavseg.plot.layers.region_layer import PolygonTable
from uavseg.regions.formats import vector_files
from uavseg.regions.formats.read import read_regions, regions_of_frame

OPEN = [[15.0, 40.6], [15.001, 40.6], [15.001, 40.601], [15.0, 40.601]]
CLOSED = [*OPEN, OPEN[0]]
KML = (
    '<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document><Placemark><Polygon>'
    "<outerBoundaryIs><LinearRing><coordinates>{}</coordinates></LinearRing></outerBoundaryIs></Polygon>"
    "</Placemark></Document></kml>"
)


def geojson(*geometries: Any) -> str:
    features = [{"type": "Feature", "properties": {}, "geometry": geometry} for geometry in geometries]
    return json.dumps({"type": "FeatureCollection", "features": features})


def polygon(ring: Any) -> dict[str, Any]:
    return {"type": "Polygon", "coordinates": [ring]}


@pytest.mark.parametrize("read", [read_regions, PolygonTable.of])
@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.geojson", geojson(polygon(OPEN))),
        ("a.geojson", geojson(polygon(CLOSED), polygon([[1], [2], [3], [1]]))),
        ("a.kml", KML.format(" ".join(f"{x},{y}" for x, y in OPEN))),
    ],
)
def test_a_ring_that_is_none_is_refused(tmp_path: Path, read: Any, name: str, text: str) -> None:
    path = tmp_path / name
    path.write_text(text)
    with warnings.catch_warnings(), pytest.raises(RegionError, match=r"cannot be read") as caught:
        warnings.simplefilter("error")
        read(path)
    assert "\n" not in str(caught.value)


def test_from_standard_input_the_same(tmp_path: Path) -> None:
    with pytest.raises(RegionError, match="standard input"):
        read_regions(geojson(polygon(OPEN)).encode())


def test_a_coordinate_that_is_no_number_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.geojson"
    path.write_text(
        geojson(polygon([[15, 40], [15.1, 1e400], [15.1, 40.1], [15, 40]])).replace("Infinity", "1e400")
    )
    with pytest.raises(RegionError):
        read_regions(path)


@pytest.mark.parametrize("read", [read_regions, PolygonTable.of])
@pytest.mark.parametrize(
    "lost",
    [
        polygon([[15, 40], [15.1, "x"], [15.1, 40.1], [15, 40]]),
        {"type": "Polygon", "coordinates": []},
        {"type": "Polygon"},
        None,
    ],
)
def test_no_feature_is_left_out(tmp_path: Path, read: Any, lost: Any) -> None:
    path = tmp_path / "a.geojson"
    path.write_text(geojson(polygon(CLOSED), lost, polygon(CLOSED)))
    with pytest.raises(RegionError, match=r"1 of 3 features .* feature 2\)|cannot be read"):
        read(path)
    path.write_text(geojson(polygon(CLOSED), polygon(CLOSED)))
    read(path)


@pytest.mark.parametrize("read", [read_regions, PolygonTable.of])
@pytest.mark.parametrize("suffix", [".gpkg", ".fgb", ".shp", ".parquet"])
@pytest.mark.parametrize("lost", [None, shapely.Polygon()])
def test_nor_in_another_format(tmp_path: Path, read: Any, suffix: str, lost: Any) -> None:
    places = [shapely.Polygon(CLOSED), lost]
    frame = geopandas.GeoDataFrame({"id": [1, 2]}, geometry=places, crs="EPSG:4326")
    path = tmp_path / f"a{suffix}"
    options = {"SPATIAL_INDEX": "NO"} if suffix == ".fgb" else {}  # which needs all geometries
    frame.to_parquet(path) if suffix == ".parquet" else frame.to_file(path, **options)
    with pytest.raises(RegionError, match=r"1 of 2 features .* feature 2\)"):
        read(path)


FEATURE = {"type": "Feature", "properties": {"geometry": "a"}, "geometry": polygon(CLOSED)}
ONE = json.dumps(FEATURE)
COLLECTION = {"type": "FeatureCollection", "features": [FEATURE, FEATURE]}
ESRI = {
    "geometryType": "esriGeometryPolygon",
    "spatialReference": {"wkid": 4326},
    "fields": [{"name": "a", "type": "esriFieldTypeString"}],
    "features": 2 * [{"attributes": {"a": "b"}, "geometry": {"rings": [CLOSED]}}],
}


def test_two_attributes_of_one_name_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.fgb"
    frame = geopandas.GeoDataFrame(
        {"lat": [40.0], "low": [0.5]}, geometry=[shapely.Polygon(CLOSED)], crs="EPSG:4326"
    )
    frame.to_file(path)
    read_regions(path)
    path.write_bytes(path.read_bytes().replace(b"low", b"lat"))
    with pytest.raises(RegionError, match="two attributes of the same name"):
        read_regions(path)
    with pytest.raises(RegionError, match="the frame has two attributes of the same name"):
        regions_of_frame(frame.rename(columns={"low": "lat"}))


def zeros_in_the_last_feature() -> str:
    """The name of the first member is zeros up to what was the value of its geometry."""
    text = json.dumps(COLLECTION)
    first, end = text.rindex('type": "Feature"'), text.rindex('": {"type": "Polygon"')
    return text[:first] + "\0" * (end - first) + text[end:]


@pytest.mark.parametrize(
    ("name", "text", "count"),
    [
        ("a.geojson", json.dumps(COLLECTION), 2),
        ("a.geojson", "\ufeff" + json.dumps(COLLECTION), 2),
        ("a.geojson", ONE, 1),
        ("a.geojson", json.dumps(polygon(CLOSED)), 1),
        ("a.geojson", json.dumps({**COLLECTION, "features": [FEATURE, None, 7]}), 1),
        ("a.geojson", f"{ONE}\n{ONE}\n", 2),
        ("a.geojsonl", f"{ONE}\r\n\n  \n{ONE}\n{json.dumps(polygon(CLOSED))}", 3),
        ("a.geojsonl", json.dumps(COLLECTION), 2),
        ("a.geojsons", 3 * f"\x1e{json.dumps(FEATURE, indent=1)}\n", 3),
        ("a.json", json.dumps(ESRI), 2),
        (
            "a.geojson",
            json.dumps({**COLLECTION, "features": [FEATURE, {**FEATURE, "type": "Featuse"}]}),
            None,
        ),
        ("a.geojson", json.dumps({**COLLECTION, "features": [FEATURE, COLLECTION]}), None),
        ("a.geojson", zeros_in_the_last_feature(), None),
        ("a.geojsonl", f"{ONE}\n{ONE[:-3]}\n{ONE}\n", None),
        ("a.geojsonl", f"{ONE}\n{ONE}\n{ONE[:40]}", None),
        ("a.geojsonl", f"{ONE}\n{ONE}J{ONE}\n", None),
        ("a.geojsons", f"\x1e{ONE}\n\x1e{ONE[:-3]}\n", None),
        ("a.json", json.dumps({**ESRI, "features": [*ESRI["features"], {"geometrx": 1}]}), None),
    ],
)
def test_all_features_of_a_json_text_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, text: str, count: int | None
) -> None:
    path = tmp_path / name
    path.write_text(text)
    readers = (read_regions, PolygonTable.of, lambda path: read_regions(path.read_bytes()))
    for piece in (1 << 24, 7):  # bytes of the text that are looked at in one go
        monkeypatch.setattr(vector_files, "_PIECE", piece)
        for read in readers:
            if count is None:
                with pytest.raises(RegionError, match=r"of which|without a geometry|null bytes|Extra"):
                    read(path)
            else:
                assert len(read(path).polygons) == count


@pytest.mark.parametrize("piece", [1 << 24, 7])
def test_a_text_that_is_whole_is_not_parsed_a_second_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, piece: int
) -> None:
    def parse(text: str) -> Any:
        raise AssertionError("parsed")

    monkeypatch.setattr(vector_files, "_PIECE", piece)
    monkeypatch.setattr(vector_files, "parse_json", parse)
    (tmp_path / "a.geojson").write_text(geojson(*3 * [polygon(CLOSED)]))
    (tmp_path / "a.geojsonl").write_text(3 * (json.dumps({**FEATURE, "properties": {}}) + "\n"))
    for name in ("a.geojson", "a.geojsonl"):
        assert len(read_regions(tmp_path / name)) == 3


def changes(content: bytes, seed: int, count: int) -> Iterator[bytes]:
    """The content with a bit changed, with 64 bytes of 0, or cut."""
    draw = random.Random(seed)
    for n in range(count):
        at = draw.randrange(len(content))
        flipped = content[at] ^ 1 << draw.randrange(8)
        if n % 4 == 3:
            yield content[:at]
        elif n % 4 == 2:
            yield content[:at] + bytes(min(64, len(content) - at)) + content[at + 64 :]
        else:
            yield content[:at] + bytes([flipped]) + content[at + 1 :]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("suffix", "count"),
    [
        pair
        for suffix in (".geojson", ".geojsonl", ".gpkg", ".fgb", ".shp", ".shx", ".dbf", ".parquet", ".kml")
        for pair in ((suffix, 24), pytest.param(suffix, 600, marks=pytest.mark.thorough))
    ],
)
def test_a_damaged_file_is_refused_or_none_of_its_regions_is_lost(
    tmp_path: Path, suffix: str, count: int
) -> None:
    places = [shapely.box(x, 40, x + 0.0005, 40.0005) for x in np.linspace(15, 15.02, 20)]
    names = [f"region {n}" for n in range(len(places))]
    frame = geopandas.GeoDataFrame({"name": names}, geometry=places, crs="EPSG:4326")
    part = tmp_path / f"a{suffix}"
    path = part.with_suffix(".shp") if suffix in {".shx", ".dbf"} else part
    if suffix == ".kml":
        rings = [" ".join(f"{x},{y}" for x, y in place.exterior.coords) for place in places]
        head, tail = KML.split("<Placemark>")
        part.write_text("<Placemark>".join([head, *[tail.split("</Document>")[0].format(r) for r in rings]]))
        part.write_text(part.read_text() + "</Document></kml>")
    elif suffix == ".parquet":
        frame.to_parquet(path)
    else:
        frame.to_file(path, **({"driver": "GeoJSONSeq"} if suffix == ".geojsonl" else {}))
    whole = part.read_bytes()
    read_regions(path)
    for content in changes(whole, 7, count):
        if suffix == ".geojsonl" and content in whole and whole[len(content) :][:1] in (b"\n", b"{"):
            continue  # a shorter file that is whole
        part.write_bytes(content)
        for read in (read_regions, PolygonTable.of):
            try:
                assert len(read(path).polygons) >= len(places)  # one that crosses itself now is two
            except RegionError as error:
                assert "\n" not in str(error)
