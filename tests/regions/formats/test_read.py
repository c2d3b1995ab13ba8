"""Regions read from files: those that were written, and those of other tools."""

import json
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import shapely
from pyproj import CRS, Geod, Transformer

import uavseg
from uavseg.errors import RegionError
from uavseg.regions.formats import export
from uavseg.regions.formats.read import read_regions
from uavseg.regions.table import COLUMNS, Regions

UTM = 32632
PARTS = [shapely.box(0, 0, 100, 100) - shapely.box(20, 20, 40, 40), shapely.box(300, 0, 350, 100)]
MAP = [shapely.transform(part, lambda xy: xy + np.array((500_000, 5_250_000))) for part in PARTS]
TO_GLOBE = Transformer.from_crs(UTM, 4326, always_xy=True)


def made() -> Regions:
    points = shapely.get_coordinates(shapely.point_on_surface(MAP))
    lon, lat = TO_GLOBE.transform(points[:, 0], points[:, 1])
    values: dict[str, Any] = {name: np.linspace(0.1, 0.9, 2) for name in COLUMNS}
    values |= {"id": [1, 2], "pixels": [9600, 5000], "area_m2": [9600.0, 5000.0], "holes": [1, 0]}
    values |= {"lon": lon, "lat": lat, "source": ["a.tif", "b.tif"]}
    columns = {name: np.array(values[name]).astype(kind) for name, kind in COLUMNS.items()}
    return Regions(columns, np.array(MAP, dtype=object), CRS(UTM).to_wkt())


def frame(geometries: list[Any], crs: Any = 4326, **columns: Any) -> geopandas.GeoDataFrame:
    return geopandas.GeoDataFrame(columns, geometry=geometries, crs=crs)


def near(lon: float = 0.0, lat: float = 0.0) -> shapely.Polygon:
    return shapely.box(8 + lon, 47 + lat, 8.001 + lon, 47.001 + lat)


@pytest.mark.parametrize("suffix", ["geojson", "gpkg", "fgb", "parquet", "shp", "kml"])
def test_every_format_that_is_written_is_read_back(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"regions.{suffix}"
    export.write_regions(made(), path)
    found = read_regions(path)
    assert list(found.columns) == list(COLUMNS)
    for name, column in made().columns.items():
        if name == "source":
            assert found.columns[name].tolist() == column.tolist()
        else:
            assert np.allclose(found.columns[name], column, rtol=0, atol=1e-6), name
    for ours, theirs in zip(found.polygons, MAP, strict=True):
        expected = shapely.transform(theirs, lambda xy: np.column_stack(TO_GLOBE.transform(*xy.T)))
        assert shapely.hausdorff_distance(ours, expected) < 2e-7
        assert len(shapely.get_rings(ours)) == len(shapely.get_rings(theirs))


def test_geojson_may_come_as_bytes(tmp_path: Path) -> None:
    path = tmp_path / "regions.geojson"
    export.write_regions(made(), path)
    assert read_regions(path.read_bytes()).columns["id"].tolist() == [1, 2]


def test_files_of_other_tools_are_numbered_measured_and_split(tmp_path: Path) -> None:
    path = tmp_path / "theirs.gpkg"
    two = shapely.MultiPolygon([near(0.01), near(0.02)])
    frame([shapely.force_3d(near()), two], name=["field", "woods"]).to_file(path)
    found = read_regions(path)
    assert found.columns["id"].tolist() == [1, 2, 3]
    assert found.columns["name"].tolist() == ["field", "woods", "woods"]
    assert not shapely.has_z(found.polygons).any()
    on_ground = abs(Geod(ellps="WGS84").geometry_area_perimeter(near())[0])
    assert found.columns["area_m2"] == pytest.approx([on_ground] * 3)
    assert shapely.contains_xy(found.polygons, found.columns["lon"], found.columns["lat"]).all()


def test_regions_with_an_id_are_not_split_and_are_sorted_by_it(tmp_path: Path) -> None:
    path = tmp_path / "regions.gpkg"
    two = shapely.MultiPolygon([near(0.01), near(0.02)])
    frame([near(), two], id=[7, 3]).to_file(path)
    found = read_regions(path)
    assert found.columns["id"].tolist() == [3, 7]
    assert [polygon.geom_type for polygon in found.polygons] == ["MultiPolygon", "MultiPolygon"]


def test_a_point_outside_of_its_region_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "regions.geojson"
    frame([near(), near(1)], id=[1, 2], lon=[8.0005, 8.0005], lat=[47.0005, 47.0005]).to_file(path)
    found = read_regions(path)
    assert found.columns["lon"][0] == 8.0005
    assert 9 < found.columns["lon"][1] < 9.001


def test_a_projected_file_is_reprojected(tmp_path: Path) -> None:
    path = tmp_path / "mercator.fgb"
    frame([near()]).to_crs(3857).to_file(path)
    assert read_regions(path).polygons[0].equals_exact(near(), 1e-9) or shapely.hausdorff_distance(
        read_regions(path).polygons[0], near()
    ) == pytest.approx(0, abs=1e-9)


def geojson(geometry: Any) -> str:
    feature = {"type": "Feature", "properties": {}, "geometry": geometry}
    return json.dumps({"type": "FeatureCollection", "features": [feature]})


BOWTIE = {"type": "Polygon", "coordinates": [[[8, 47], [8.1, 47.1], [8.1, 47], [8, 47.1], [8, 47]]]}
LOCAL = {"type": "Polygon", "coordinates": [[[0, 0], [640, 0], [640, 480], [0, 480], [0, 0]]]}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "cannot be read"),
        ("{}", "cannot be read"),
        ("id,mean\n1,2\n", "cannot be read"),
        (geojson({"type": "Point", "coordinates": [8, 47]}), "holds Point; regions are polygons"),
        (geojson({"type": "LineString", "coordinates": [[8, 47], [9, 47]]}), "LineString"),
        (geojson(LOCAL), "local coordinates"),
        (geojson(BOWTIE), "not a valid polygon"),
        (geojson(None), "holds no regions"),
        ('{"type": "FeatureCollection", "features": []}', "no regions|no geometries"),
    ],
)
def test_a_file_without_regions_is_refused_in_one_line(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "odd.geojson"
    path.write_text(text)
    for source in (path, text.encode()):
        with pytest.raises(RegionError, match=words) as refused:
            read_regions(source)
        assert "\n" not in str(refused.value) and "vsimem" not in str(refused.value)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RegionError, match="does not exist"):
        read_regions(tmp_path / "none.gpkg")


def test_an_invalid_parquet_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "odd.parquet").write_text("not at all")
    with pytest.raises(RegionError, match="cannot be read"):
        read_regions(tmp_path / "odd.parquet")


def test_a_file_without_a_coordinate_system_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "lost.shp"
    with pytest.warns(UserWarning, match="crs"):
        frame([near()], crs=None, id=[1]).to_file(path)
    with pytest.raises(RegionError, match="has no coordinate system"):
        read_regions(path)


def test_regions_on_the_moon_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "moon.gpkg"
    frame([near()], crs="+proj=longlat +R=1737400 +no_defs", id=[1]).to_file(path)
    with pytest.raises(RegionError, match="place on Earth"):
        read_regions(path)


def test_one_of_several_layers_is_chosen_by_name(tmp_path: Path) -> None:
    path = tmp_path / "both.gpkg"
    frame([near()], id=[1]).to_file(path, layer="near")
    frame([near(1)], id=[2]).to_file(path, layer="far")
    assert read_regions(path, "far").columns["id"].tolist() == [2]
    with pytest.raises(RegionError, match="2 layers; choose with --layer one of near, far"):
        read_regions(path)
    with pytest.raises(RegionError, match="no layer 'away'; it has near, far"):
        read_regions(path, "away")


def test_a_polygon_that_only_touches_itself_is_repaired(tmp_path: Path) -> None:
    path = tmp_path / "touching.gpkg"
    ring = [(8, 47), (8.06, 47), (8.03, 47.03), (8.06, 47.06), (8, 47.06), (8.03, 47.03), (8, 47)]
    frame([shapely.Polygon(ring)], id=[4]).to_file(path)
    found = read_regions(path)
    assert found.columns["id"].tolist() == [4]
    assert shapely.is_valid(found.polygons).all()


def test_empty_parts_of_multipolygons_are_left_out() -> None:
    ring = shapely.get_coordinates(shapely.box(15, 40.6, 15.001, 40.601)).tolist()
    text = geojson({"type": "MultiPolygon", "coordinates": [[ring], []]})
    found = read_regions(text.encode())
    assert not shapely.is_empty(shapely.get_parts(np.array(found.polygons, object))).any()
    assert len(uavseg.plan(found.frame(), altitude=50, home=(40.6, 15, 0)).missions) == 1


@pytest.mark.parametrize("suffix", ["shp", "geojson", "gpkg"])
@pytest.mark.parametrize("clockwise", [False, True])
def test_a_flight_around_a_region_has_the_direction_that_every_file_gives(
    tmp_path: Path, suffix: str, clockwise: bool
) -> None:
    drawn = shapely.orient_polygons([near()], exterior_cw=clockwise)
    frame(list(drawn), id=[1]).to_file(tmp_path / f"a.{suffix}")
    found = read_regions(tmp_path / f"a.{suffix}").polygons[0]
    assert found.equals(near()) and found.exterior.is_ccw
    how: dict[str, Any] = {"altitude": 50, "home": (46.999, 8.0, 500), "pattern": "perimeter"}
    with pytest.warns(UserWarning, match="simplified"):
        first, second = (
            uavseg.plan(tmp_path / f"a.{suffix}", **how),
            uavseg.plan(frame([near()], id=[1]), **how),
        )
    assert first.missions == second.missions


@pytest.mark.parametrize("crs", ["EPSG:3832", "EPSG:32660", "EPSG:32701", "past 180", "jumping"])
@pytest.mark.parametrize("suffix", ["gpkg", "geojson", "fgb"])
def test_a_region_across_the_antimeridian_is_read_on_both_sides_of_it(
    tmp_path: Path, crs: str, suffix: str
) -> None:
    square = shapely.Polygon(
        [(179.99, -16.5), (180.02, -16.5), (180.02, -16.4), (179.99, -16.4)],
        [[(179.999, -16.46), (179.999, -16.45), (180.001, -16.45), (180.001, -16.46)]],
    )
    parted = shapely.transform(square, lambda xy: xy - [[360, 0]] * (xy[:, :1] > 180))
    frame = geopandas.GeoDataFrame({"id": [1]}, geometry=[square if crs == "past 180" else parted], crs=4326)
    if crs.startswith("EPSG"):
        if suffix == "geojson":
            pytest.skip("GeoJSON is in longitude and latitude")
        frame = frame.to_crs(crs)
    frame.to_file(tmp_path / f"a.{suffix}")
    found = read_regions(tmp_path / f"a.{suffix}").polygons[0]
    west, east = (shapely.box(x, -90, x + 180, 90) for x in (-180, 0))
    assert found.geom_type == "MultiPolygon" and found.is_valid
    assert found.intersection(east).bounds == pytest.approx((179.99, -16.5, 180, -16.4), abs=1e-6)
    assert found.intersection(west).bounds == pytest.approx((-180, -16.5, -179.98, -16.4), abs=1e-6)
    assert found.area == pytest.approx(square.area, rel=1e-3)


def test_a_ring_around_a_pole_is_refused(tmp_path: Path) -> None:
    ring = shapely.Point(0, 0).buffer(1000)
    geopandas.GeoDataFrame(geometry=[ring], crs="EPSG:3413").to_file(tmp_path / "a.gpkg")
    with pytest.raises(RegionError, match="surrounds a pole; write the regions as GeoJSON"):
        read_regions(tmp_path / "a.gpkg")
