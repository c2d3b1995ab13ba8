"""Vector files are of the format that their extension promises, and name nothing else."""

import json
import os
import sqlite3
import struct
import threading
from collections.abc import Iterator
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import geopandas
import pytest
import shapely

from uavseg.access import allowing
from uavseg.errors import AccessError, RegionError
from uavseg.plot.layers.region_layer import PolygonTable
from uavseg.regions.formats.metadata import about_file, is_region_file
from uavseg.regions.formats.read import read_regions

RING = [[15, 40], [15.01, 40], [15.01, 40.01], [15, 40.01], [15, 40]]
FEATURE = {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [RING]}}
READERS = [read_regions, PolygonTable.of]


@pytest.fixture
def requests() -> Iterator[tuple[str, list[str]]]:
    """Address of a server on this machine, and the paths that it was asked for."""
    requested: list[str] = []

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            requested.append(self.path)
            self.send_response(404)
            self.end_headers()

        do_HEAD = do_GET  # noqa: N815

        def log_message(self, *_: Any) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}", requested
        server.shutdown()
        thread.join()


def collection(**more: Any) -> str:
    return json.dumps({"type": "FeatureCollection", **more, "features": [FEATURE]})


def kml(inner: str = "") -> str:
    ring = " ".join(f"{x},{y}" for x, y in RING)
    outline = f"<LinearRing><coordinates>{ring}</coordinates></LinearRing>"
    polygon = f"<Polygon><outerBoundaryIs>{outline}</outerBoundaryIs></Polygon>"
    return (
        '<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document>'
        f"{inner}<Placemark>{polygon}</Placemark></Document></kml>"
    )


@pytest.mark.slow
@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("form", ["link", "LINK", "url", "escaped", "single", "feature"])
def test_a_linked_crs_is_not_fetched(tmp_path: Path, requests: Any, reader: Any, form: str) -> None:
    address, requested = requests
    crs = {
        "type": "url" if form == "url" else "link",
        "properties": {"href": f"{address}/crs", "url": f"{address}/crs"},
    }
    text = collection(crs=crs)
    if form == "LINK":
        text = text.replace('"crs"', '"CRS"').replace('"link"', '"LINK"')
    if form == "escaped":
        text = (
            text.replace('"href"', '"\\u0068ref"')
            .replace('"url"', '"\\u0075rl"')
            .replace('"link"', '"l\\u0069nk"')
        )
    if form == "single":
        text = text.replace('"', "'")
    if form == "feature":
        text = json.dumps({"type": "FeatureCollection", "features": [{**FEATURE, "crs": crs}]})
    (tmp_path / "a.geojson").write_text(text)
    with pytest.raises((AccessError, RegionError)):
        reader(tmp_path / "a.geojson")
    assert requested == []


@pytest.mark.slow
def test_a_linked_crs_is_fetched_where_that_is_allowed(tmp_path: Path, requests: Any) -> None:
    address, requested = requests
    (tmp_path / "a.geojson").write_text(
        collection(crs={"type": "link", "properties": {"href": f"{address}/crs"}})
    )
    with allowing(allow_network=True):
        read_regions(tmp_path / "a.geojson")
    assert set(requested) == {"/crs"}  # the server of these tests sees what is sent


@pytest.mark.parametrize("reader", READERS)
def test_attributes_with_addresses_are_only_attributes(tmp_path: Path, reader: Any) -> None:
    named = {**FEATURE, "properties": {"url": "http://127.0.0.1:1/", "href": "a", "crs": "link"}}
    (tmp_path / "a.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [named]}))
    reader(tmp_path / "a.geojson")


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["http://{}/crs", "ftp://{}/crs", "/vsicurl/http://{}/crs", "urn:ogc:def:crs:http://{}/crs"]
)
def test_the_name_of_a_crs_makes_no_request(tmp_path: Path, requests: Any, name: str) -> None:
    address, requested = requests
    crs = {"type": "name", "properties": {"name": name.format(address.removeprefix("http://"))}}
    for more in ({"crs": crs}, {"coordRefSys": crs["properties"]["name"]}):
        (tmp_path / "a.geojson").write_text(collection(**more))
        with suppress(RegionError):
            read_regions(tmp_path / "a.geojson")
    assert requested == []


@pytest.mark.parametrize("reader", READERS)
def test_links_in_kml_make_no_request(tmp_path: Path, requests: Any, reader: Any) -> None:
    address, requested = requests
    links = (
        f"<NetworkLink><Link><href>{address}/a.kml</href></Link></NetworkLink>"
        f"<Placemark><styleUrl>{address}/s.kml#x</styleUrl></Placemark>"
        f"<GroundOverlay><Icon><href>{address}/i.png</href></Icon></GroundOverlay>"
    )
    (tmp_path / "a.kml").write_text(kml(links))
    with suppress(RegionError):
        reader(tmp_path / "a.kml")
    assert requested == []
    (tmp_path / "b.kml").write_text(kml())
    reader(tmp_path / "b.kml")


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("name", ["a.geojson", "a.json", "a.kml", "a.gpkg", "a.fgb", "a.shp", "a.vrt", "a"])
def test_descriptions_of_other_sources_are_refused(tmp_path: Path, reader: Any, name: str) -> None:
    (tmp_path / "secret.geojson").write_text(collection())
    inner = f'<OGRVRTLayer name="r"><SrcDataSource>{tmp_path}/secret.geojson</SrcDataSource></OGRVRTLayer>'
    pipeline = {
        "type": "gdal_streamed_alg",
        "command_line": f"gdal vector pipeline ! read {tmp_path}/secret.geojson",
    }
    for text in (
        f"<OGRVRTDataSource>{inner}</OGRVRTDataSource>",
        "<OGRWFSDataSource><URL>http://127.0.0.1:1/</URL></OGRWFSDataSource>",
        json.dumps(pipeline),
    ):
        (tmp_path / name).write_text(text)
        with pytest.raises((AccessError, RegionError)):
            reader(tmp_path / name)


@pytest.mark.parametrize("reader", READERS)
def test_a_file_is_of_the_format_of_its_extension(tmp_path: Path, reader: Any) -> None:
    (tmp_path / "a.gpkg").write_text(collection())
    (tmp_path / "a.geojson").write_bytes(b"SQLite format 3\0" + bytes(100))
    (tmp_path / "a.txt").write_text("id,wkt\n1,POINT (0 0)\n")
    for name, kind in (("a.gpkg", "not GeoPackage"), ("a.geojson", "not GeoJSON"), ("a.txt", "not one of")):
        with pytest.raises(RegionError, match=kind):
            reader(tmp_path / name)


@pytest.mark.parametrize("name", ["a.geojson", "a.gpkg", "a.fgb", "a.parquet", "a.shp", "a.kml"])
def test_what_geopandas_writes_is_read(tmp_path: Path, name: str) -> None:
    frame = geopandas.GeoDataFrame({"id": [1]}, geometry=[shapely.Polygon(RING)], crs="EPSG:4326")
    if name == "a.parquet":
        frame.to_parquet(tmp_path / name)
    elif name == "a.kml":
        (tmp_path / name).write_text(kml())
    else:
        frame.to_file(tmp_path / name)
    assert len(read_regions(tmp_path / name)) == 1


@pytest.mark.parametrize(
    ("statement", "reason"),
    [
        ("CREATE VIEW v AS SELECT load_extension('/tmp/x.so') AS a", "view"),
        ("CREATE VIEW v AS SELECT ogr_layer_SRID('a') AS a", "view"),
        ("CREATE VIEW v AS SELECT random() AS a", "view"),
        (
            "CREATE VIEW v AS WITH RECURSIVE n(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM n) "
            "SELECT x FROM n",
            "view",
        ),
        ("CREATE VIEW v AS SELECT (SELECT count(*) FROM a b, a c) AS n FROM a", "view"),
        pytest.param(
            "CREATE VIEW v AS SELECT a.* FROM a, a b, a c, a d, a e, a f",
            "interrupted",
            marks=pytest.mark.slow,
        ),
        ("CREATE VIEW v AS SELECT * FROM w", "view"),
        ('CREATE VIEW """; SELECT 1" AS SELECT random() AS a', "view"),
        ("CREATE VIRTUAL TABLE v USING rtree(a, b, c); CREATE VIEW w AS SELECT 1 UNION SELECT 2", "view"),
    ],
)
def test_a_geopackage_with_code_is_refused(tmp_path: Path, statement: str, reason: str) -> None:
    squares = [shapely.box(n, 0, n + 0.5, 1) for n in range(60)]
    geopandas.GeoDataFrame(geometry=squares, crs="EPSG:4326").to_file(tmp_path / "a.gpkg")
    with sqlite3.connect(tmp_path / "a.gpkg") as database:
        database.executescript(statement)
    database.close()
    for source in (tmp_path / "a.gpkg", (tmp_path / "a.gpkg").read_bytes()):
        with pytest.raises(AccessError, match=reason):
            read_regions(source)
    for read in (about_file, is_region_file):
        with pytest.raises(AccessError, match=reason):
            read(tmp_path / "a.gpkg")


def test_a_view_that_selects_from_a_table_is_a_layer(tmp_path: Path) -> None:
    path = tmp_path / "a.gpkg"
    squares = [shapely.box(n, 0, n + 0.5, 1) for n in range(60)]
    geopandas.GeoDataFrame({"size": range(60)}, geometry=squares, crs="EPSG:4326").to_file(path)
    with sqlite3.connect(path) as database:
        database.execute("CREATE VIEW big AS SELECT fid AS OGC_FID, geom, size FROM a WHERE round(size) > 40")
        database.execute(
            "INSERT INTO gpkg_contents (table_name, data_type, identifier, srs_id) "
            "SELECT 'big', data_type, 'big', srs_id FROM gpkg_contents"
        )
        database.execute(
            "INSERT INTO gpkg_geometry_columns SELECT 'big', column_name, geometry_type_name, srs_id, z, m "
            "FROM gpkg_geometry_columns"
        )
    database.close()
    found = read_regions(path, "big")
    assert found.columns["size"].tolist() == list(range(41, 60))
    assert len(read_regions(path, "a")) == 60


def test_more_features_than_bytes_are_refused(tmp_path: Path) -> None:
    frame = geopandas.GeoDataFrame(geometry=77 * [shapely.Polygon(RING)], crs="EPSG:4326")
    frame.to_file(tmp_path / "a.fgb", SPATIAL_INDEX="NO")
    content = (tmp_path / "a.fgb").read_bytes()
    assert content[:600].count(struct.pack("<Q", 77)) == 1
    (tmp_path / "a.fgb").write_bytes(content.replace(struct.pack("<Q", 77), struct.pack("<Q", 10**6), 1))
    for reader in READERS:
        with pytest.raises(RegionError, match="1,000,000 features"):
            reader(tmp_path / "a.fgb")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on this system")
@pytest.mark.parametrize("reader", READERS)
def test_named_pipes_are_not_opened(tmp_path: Path, reader: Any) -> None:
    for name in ("a.geojson", "a.parquet", "a.kml"):
        os.mkfifo(tmp_path / name)
        with pytest.raises(RegionError, match="named pipe"):
            reader(tmp_path / name)
    frame = geopandas.GeoDataFrame({"id": [1]}, geometry=[shapely.Polygon(RING)], crs="EPSG:4326")
    frame.to_file(tmp_path / "a.shp")
    (tmp_path / "a.prj").unlink()
    os.mkfifo(tmp_path / "a.prj")
    with pytest.raises(OSError, match="named pipe"):
        reader(tmp_path / "a.shp")


@pytest.mark.parametrize("reader", [read_regions, PolygonTable.of])
def test_a_shapefile_whose_table_cannot_be_read_is_not_one_without_attributes(
    tmp_path: Path, reader: Any
) -> None:
    frame = geopandas.GeoDataFrame({"id": [7]}, geometry=[shapely.box(15, 40, 15.01, 40.01)], crs="EPSG:4326")
    frame.to_file(tmp_path / "r.shp")
    table = (tmp_path / "r.dbf").read_bytes()
    for content in (b"", table[:20], bytes(len(table))):
        (tmp_path / "r.dbf").write_bytes(content)
        with pytest.raises(RegionError, match=r"r\.shp cannot be read as regions"):
            reader(tmp_path / "r.shp")
