"""Geometries that cannot be read are an error that says why, not a traceback and not a region less."""

import json
import warnings
from pathlib import Path
from typing import Any

import geopandas
import pytest
import shapely

from uavseg.errors import RegionError
from uavseg.plot.polygons import PolygonTable
from uavseg.regions.formats.read import read_regions

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
