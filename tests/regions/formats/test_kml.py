"""KML: well-formed, with the coordinates of WGS 84 and every attribute."""

import io
from dataclasses import replace
from itertools import pairwise
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely
from affine import Affine
from rasterio.crs import CRS

from uavseg.errors import OutputError
from uavseg.raster.grid.geobox import GeoBox
from uavseg.regions.formats.text_writers import MAX_CORNERS, kml_notes, write_kml
from uavseg.regions.outline.trace import trace
from uavseg.regions.table import COLUMNS, Regions, make_regions
from uavseg.regions.wgs84.to_wgs84 import wgs84_geometries
from uavseg.segmentation.components import Sums

PICTURE = np.array([[1, 1, 1, 0, 3], [1, 0, 1, 0, 0], [1, 1, 1, 2, 2]], np.uint32)
UTM = Affine(0.5, 0, 400_000, 0, -0.5, 5_000_000)
KML = "{http://www.opengis.net/kml/2.2}"


def regions_of(
    labels: Any = PICTURE, transform: Affine = UTM, crs: int | None = 32618, name: str = "a"
) -> Regions:
    box = GeoBox(labels.shape, transform, None if crs is None else CRS.from_epsg(crs))
    counts = np.bincount(labels.reshape(-1), minlength=1)[1:]
    sums = Sums(counts, counts * 65535, counts * 65535.0**2, np.empty((0, 2), np.int64))
    return make_regions(trace(labels), sums, box, (0.5, 1), name)


def placemarks(regions: Regions) -> list[ElementTree.Element]:
    stream = io.BytesIO()
    write_kml(regions, stream)
    return list(ElementTree.fromstring(stream.getvalue()).iter(f"{KML}Placemark"))


def ring(element: ElementTree.Element) -> list[list[float]]:
    text = element.findtext(f"{KML}LinearRing/{KML}coordinates")
    assert text is not None
    return [[float(number) for number in vertex.split(",")] for vertex in text.split()]


def geometry(placemark: ElementTree.Element) -> Any:
    polygons = []
    for polygon in placemark.iter(f"{KML}Polygon"):
        [exterior] = [ring(element) for element in polygon.findall(f"{KML}outerBoundaryIs")]
        holes = [ring(element) for element in polygon.findall(f"{KML}innerBoundaryIs")]
        polygons.append(shapely.Polygon(exterior, holes))
    return polygons[0] if len(polygons) == 1 else shapely.MultiPolygon(polygons)


@pytest.mark.parametrize(
    "transform, crs",
    [(UTM, 32618), (Affine(1, 0, 178.5, 0, -1, 1), 4326), (Affine(1e5, 0, -2.6e5, 0, -1e5, 1.4e5), 3031)],
    ids=["UTM", "the antimeridian", "the south pole"],
)
def test_coordinates_are_those_of_wgs84(transform: Affine, crs: int) -> None:
    regions = regions_of(transform=transform, crs=crs)
    found = np.array([geometry(placemark) for placemark in placemarks(regions)])
    assert shapely.equals_exact(found, wgs84_geometries(regions), 1e-12).all()


@pytest.mark.parametrize("side, decimals", [(30, 7), (0.5, 8), (0.003, 10)])
def test_every_vertex_has_the_decimals_that_its_pixels_need(side: float, decimals: int) -> None:
    for placemark in placemarks(regions_of(transform=Affine(side, 0, 4e5, 0, -side, 5e6))):
        for element in placemark.iter(f"{KML}coordinates"):
            numbers = (element.text or "").replace(",", " ").split()
            assert {len(number.partition(".")[2]) for number in numbers} == {decimals}


def test_attributes_are_in_the_order_of_the_schema() -> None:
    regions = regions_of(name='<Weiß & "Nord">.tif')
    for k, placemark in enumerate(placemarks(regions)):
        data = {one.get("name"): one.text for one in placemark.iter(f"{KML}SimpleData")}
        assert list(data) == list(COLUMNS)
        assert data["source"] == '<Weiß & "Nord">.tif'
        assert int(data["id"] or 0) == k + 1 == int(placemark.findtext(f"{KML}name") or 0)
        assert float(data["area_m2"] or 0) == pytest.approx(regions.columns["area_m2"][k], rel=1e-11)


def test_missing_numbers_are_omitted() -> None:
    regions = regions_of()
    columns = regions.columns | {"mean": np.array([0.5, np.nan, 0.25])}
    marks = placemarks(replace(regions, columns=columns))
    known = [{one.get("name") for one in mark.iter(f"{KML}SimpleData")} for mark in marks]
    assert ["mean" in names for names in known] == [True, False, True]


def test_placemarks_follow_each_other_in_the_order_of_the_regions() -> None:
    ids = [int((mark.get("id") or "").removeprefix("region.")) for mark in placemarks(regions_of())]
    assert all(one + 1 == other for one, other in pairwise(ids)) and ids[0] == 1
    assert placemarks(regions_of(np.zeros((2, 2), np.uint32))) == []


def test_local_coordinates_are_refused() -> None:
    with pytest.raises(OutputError, match="no place on the globe"):
        placemarks(regions_of(crs=None))


def perforated(holes: int, side: int = 88) -> Any:
    """One region with so many holes of a pixel."""
    labels = np.ones((2 * side, 2 * side), np.uint32)
    row, col = np.divmod(np.arange(holes), side - 1)
    labels[2 * row + 1, 2 * col + 1] = 0
    return labels


@pytest.mark.parametrize("built", [False, True], ids=["outlines", "geometries"])
@pytest.mark.parametrize("more", [0, 1])
def test_more_corners_than_google_earth_draws_are_noted(more: int, built: bool) -> None:
    holes = MAX_CORNERS // 4 - 1 + more
    regions = regions_of(perforated(holes))
    regions = replace(regions, polygons=np.asarray(regions.polygons)) if built else regions
    corners = sum(len(ring(part)) - 1 for mark in placemarks(regions) for part in boundaries(mark))
    assert corners == 4 * holes + 4 == MAX_CORNERS + 4 * more
    notes = kml_notes(regions)
    assert len(notes) == more
    text = f"one polygon has more than 30,000 corners (up to {corners:,}), which Google"
    assert all(text in note for note in notes)


def boundaries(placemark: ElementTree.Element) -> list[ElementTree.Element]:
    return [*placemark.iter(f"{KML}outerBoundaryIs"), *placemark.iter(f"{KML}innerBoundaryIs")]


def test_polygons_are_counted_one_by_one() -> None:
    several = np.zeros((176, 2 * 176 + 1), np.uint32)
    several[:, :176] = several[:, 177:] = perforated(4000)  # one region of two polygons
    assert kml_notes(regions_of(several)) == []
    several[:, 177:] = 2 * perforated(7600)
    several[:, :176] = perforated(7500)
    [note] = kml_notes(regions_of(several))
    assert note.startswith("2 polygons have more than 30,000 corners (up to 30,404)")
