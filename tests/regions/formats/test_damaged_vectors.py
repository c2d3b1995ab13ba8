"""Geometries that cannot be read are an error that says why, not a traceback and not a region less."""

import json
import warnings
from pathlib import Path
from typing import Any

import pytest

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
