"""GeoJSON as RFC 7946 requires it, tested on the text itself."""

import io
import json
import re

import numpy as np
import pytest
import shapely
from affine import Affine
from rasterio.crs import CRS

from uavseg.raster.grid.geobox import GeoBox
from uavseg.regions.formats import text_writers
from uavseg.regions.outline.trace import trace
from uavseg.regions.table import make_regions
from uavseg.regions.wgs84 import to_wgs84
from uavseg.segmentation.components import Sums

FIRSTS = np.empty((0, 2), np.int64)  # no measure depends on first pixels
PICTURE = np.array([[1, 1, 1, 0, 3], [1, 0, 1, 0, 0], [1, 1, 1, 2, 2]], np.uint32)
UTM = Affine(0.5, 0, 400_000, 0, -0.5, 5_000_000)


def regions_of(labels=PICTURE, transform=UTM, crs=32618, source="a.tif"):
    box = GeoBox(labels.shape, transform, None if crs is None else CRS.from_epsg(crs))
    rings, counts = trace(labels), np.bincount(labels.reshape(-1), minlength=1)[1:]
    sums = Sums(counts, counts * 65535, counts * 65535.0**2, FIRSTS)
    return make_regions(rings, sums, box, (0.5, 1), source)


def written(regions):
    with io.BytesIO() as stream:
        text_writers.write_geojson(regions, stream)
        return stream.getvalue().decode()


def shapes(text):
    return np.array([shapely.geometry.shape(f["geometry"]) for f in json.loads(text)["features"]])


def test_a_feature_is_a_line():
    lines = written(regions_of()).splitlines()
    assert lines[0] == '{"type":"FeatureCollection","features":['
    assert lines[-1] == "]}"
    assert [json.loads(line.rstrip(","))["id"] for line in lines[1:-1]] == [1, 2, 3]


def test_a_feature_has_its_attributes():
    feature = json.loads(written(regions_of(source='Weiß "Nord".tif')))["features"][0]
    properties = feature["properties"]
    assert feature["type"] == "Feature"
    assert feature["id"] == properties["id"] == 1
    assert properties["source"] == 'Weiß "Nord".tif'
    assert properties["area_m2"] == pytest.approx(8 * 0.25, rel=1e-3)
    assert (properties["pixels"], properties["holes"], properties["mean"]) == (8, 1, 1)


def test_there_is_no_crs_member_and_numbers_with_a_point_keep_it():
    text = written(regions_of())
    assert '"crs"' not in text
    assert '"mean":1.0,"std":0.0,' in text


@pytest.mark.parametrize("side, decimals", [(30, 7), (0.6, 7), (0.5, 8), (0.05, 9), (0.01, 9), (0.003, 10)])
def test_every_coordinate_has_the_decimals_that_its_pixels_need(side, decimals):
    text = written(regions_of(transform=Affine(side, 0, 4e5, 0, -side, 5e6)))
    coordinates = "".join(re.findall(r'"coordinates":(.*?)}}', text))
    number = rf"-?\d+\.\d{{{decimals}}}"
    assert re.fullmatch(rf"(\[+{number},{number}\]+,?)+", coordinates)


def test_exteriors_are_counter_clockwise_and_holes_clockwise():
    exterior, hole = shapely.get_rings(shapes(written(regions_of()))[0])
    assert exterior.is_ccw and not hole.is_ccw


@pytest.mark.parametrize(
    "transform, crs",
    [
        (UTM, 32618),
        (Affine(1, 0, 178, 0, -1, 1.5), 4326),
        (Affine(1e5, 0, -2.6e5, 0, -1e5, 1.4e5), 3031),
        (Affine(0.01, 0, 4e5, 0, -0.01, 5e6), 32618),
    ],
)
def test_the_text_holds_the_geometries_of_wgs84(transform, crs):
    regions = regions_of(transform=transform, crs=crs)
    assert shapely.equals_exact(shapes(written(regions)), to_wgs84.wgs84_geometries(regions)).all()


def test_what_the_antimeridian_cuts_is_a_multipolygon_of_the_same_feature():
    collection = json.loads(written(regions_of(transform=Affine(1, 0, 178.5, 0, -1, 1), crs=4326)))
    assert [f["geometry"]["type"] for f in collection["features"]] == ["MultiPolygon", "Polygon", "Polygon"]


def test_a_region_in_parts_is_a_multipolygon():
    regions = regions_of(np.array([[1, 0, 1, 2]], np.uint32))
    text = written(regions)
    assert [f["geometry"]["type"] for f in json.loads(text)["features"]] == ["MultiPolygon", "Polygon"]
    assert shapely.equals_exact(shapes(text), to_wgs84.wgs84_geometries(regions)).all()


def test_local_coordinates_are_written_as_they_are():
    regions = regions_of(transform=Affine(0.3, 0, 1e6 / 3, 0, -0.3, 0), crs=None)
    text = written(regions)
    assert shapely.equals_exact(shapes(text), regions.polygons).all()
    assert '"lon":null,"lat":null' in text


def test_no_regions_are_an_empty_collection():
    assert json.loads(written(regions_of(np.zeros((2, 2), np.uint32)))) == {
        "type": "FeatureCollection",
        "features": [],
    }
