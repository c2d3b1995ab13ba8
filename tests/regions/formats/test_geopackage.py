"""A GeoPackage that SQLite wrote is read as one that GDAL writes of the same regions."""

import math
import sqlite3
import warnings
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pyogrio
import pyproj
import pytest
import shapely
from hypothesis import given, strategies as st

from uavseg.errors import OutputError
from uavseg.regions.formats import geopackage
from uavseg.regions.formats.export import write_regions
from uavseg.regions.formats.metadata import metadata_items
from uavseg.regions.shapes import as_multipolygons, has_multipolygons
from uavseg.regions.table import Regions

DERIVED = "+proj=ob_tran +o_proj=longlat +o_lon_p=0 +o_lat_p=39.25 +lon_0=18 +a=6371229"
CRS = {
    "geographic": "EPSG:4326",
    "one of another name": "OGC:CRS84",
    "UTM": "EPSG:32610",
    "northing first": "EPSG:2193",
    "web": "EPSG:3857",
    "of Esri": "ESRI:54009",
    "of Mars": "IAU_2015:49900",
    "with letters": "IGNF:LAMB93",
    "with heights": "EPSG:32610+5773",
    "of three axes": "EPSG:4979",
    "UTM without a number": "+proj=utm +zone=10 +datum=WGS84",
    "of no authority": "+proj=tmerc +lat_0=10 +lon_0=20 +ellps=GRS80 +units=us-ft",
    "that is derived": DERIVED,
}
TABLES = ("gpkg_spatial_ref_sys", "gpkg_geometry_columns", "gpkg_extensions", "gpkg_ogr_contents")
texts = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=5)


def regions_of(rows: list[tuple[int, float, str | None]], wkt: str | None, parts: int = 1) -> Regions:
    """Boxes, the first of which has so many parts; columns of each type, with names to be quoted."""
    boxes = [shapely.box(3 * k, 0.1, 3 * k + 1, 2) for k in range(len(rows))]
    if parts > 1:
        boxes[0] = shapely.MultiPolygon([shapely.box(0, 3 * k, 1, 3 * k + 1) for k in range(parts)])
    ids, values, names = zip(*rows, strict=True) if rows else ((), (), ())
    columns = {
        "id": np.array(ids, np.int64),
        'mean of "v"': np.array(values, np.float64),
        "class": np.array(names, object),
    }
    metadata = {"software": "uavseg", "a": ['<&>"', 1.5]}
    return Regions(columns, np.array(boxes, object), wkt, metadata)


def by_gdal(regions: Regions, path: Path) -> Path:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of regions without a CRS
        _write(regions, path)
    return path


def _write(regions: Regions, path: Path) -> None:
    promote = has_multipolygons(regions.polygons)
    polygons = np.asarray(regions.polygons)
    pyogrio.raw.write(
        path,
        shapely.to_wkb(as_multipolygons(polygons) if promote else polygons),
        list(regions.columns.values()),
        list(regions.columns),
        layer="regions",
        driver="GPKG",
        geometry_type="MultiPolygon" if promote else "Polygon",
        crs=regions.wkt,
        layer_metadata=metadata_items(regions.metadata) or None,
    )


def by_us(regions: Regions, path: Path) -> Path:
    write_regions(regions, path)
    return path


def as_read(path: Path) -> dict[str, Any]:
    """What a reader is told of a layer, with its features."""
    meta, _, geometry, columns = pyogrio.raw.read(path, layer="regions", return_fids=False)
    info = pyogrio.read_info(path, layer="regions", force_total_bounds=True, force_feature_count=True)
    names = [str(name) for name in info.pop("fields")]
    bounds = info.pop("total_bounds")
    values = [[None if value != value else value for value in column.tolist()] for column in columns]
    told = {key: str(value) for key, value in info.items() if key not in ("capabilities",)}
    return {
        **told,
        "crs": meta["crs"] and pyproj.CRS(meta["crs"]),
        "names": names,
        "bounds": None if bounds is None or not all(map(math.isfinite, bounds)) else tuple(bounds),
        "geometry": [bytes(one) for one in geometry],
        "values": values,
    }


def rows(path: Path, table: str) -> list[tuple[Any, ...]]:
    with closing(sqlite3.connect(path)) as base:
        return base.execute(f"SELECT * FROM {table}").fetchall()


@pytest.mark.parametrize("crs", [*CRS.values(), None], ids=[*CRS, "none"])
def test_a_crs_is_stored_as_gdal_stores_it(tmp_path: Path, crs: str | None) -> None:
    wkt = None if crs is None else pyproj.CRS.from_user_input(crs).to_wkt()
    regions = regions_of([(1, 2.0, "a")], wkt)
    theirs, ours = by_gdal(regions, tmp_path / "gdal.gpkg"), by_us(regions, tmp_path / "ours.gpkg")
    assert as_read(ours) == as_read(theirs)
    [(number,)] = rows(ours, "(SELECT srs_id FROM gpkg_geometry_columns)")
    name_and_number = (
        f"(SELECT srs_name, organization, organization_coordsys_id FROM {TABLES[0]} WHERE srs_id = {number})"
    )
    assert rows(ours, name_and_number) == rows(theirs, name_and_number)


def test_nothing_is_printed_of_a_crs_that_wkt_1_cannot_define(tmp_path: Path, capfd: Any) -> None:
    by_us(regions_of([], pyproj.CRS.from_epsg(4979).to_wkt()), tmp_path / "a.gpkg")
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
@given(
    st.lists(
        st.tuples(st.integers(-(2**63), 2**63 - 1), st.floats(allow_infinity=True), texts | st.none()),
        max_size=4,
    ),
    st.integers(1, 3),
)
def test_values_and_geometries_are_read_as_from_gdal(
    tmp_path_factory: pytest.TempPathFactory, values: list[tuple[int, float, str | None]], parts: int
) -> None:
    folder = tmp_path_factory.mktemp("a")
    regions = regions_of(values, pyproj.CRS.from_epsg(32610).to_wkt(), parts if values else 1)
    theirs, ours = by_gdal(regions, folder / "gdal.gpkg"), by_us(regions, folder / "ours.gpkg")
    assert as_read(ours) == as_read(theirs)
    for table in TABLES[1:]:
        assert set(rows(theirs, table)) <= set(rows(ours, table))


def test_its_tables_and_triggers_have_the_names_of_those_of_gdal(tmp_path: Path) -> None:
    regions = regions_of([(1, 2.0, "a"), (2, math.nan, None)], pyproj.CRS.from_epsg(32610).to_wkt())
    theirs, ours = by_gdal(regions, tmp_path / "gdal.gpkg"), by_us(regions, tmp_path / "ours.gpkg")
    names = "(SELECT type, name FROM sqlite_master WHERE name NOT LIKE '%gpkg_tile%')"
    assert set(rows(theirs, names)) <= set(rows(ours, names))
    columns = "pragma_table_info('regions')"
    assert [row[1:] for row in rows(ours, columns)] == [row[1:] for row in rows(theirs, columns)]
    assert rows(ours, "gpkg_metadata") == rows(theirs, "gpkg_metadata")


def _protected(*args: object) -> None:
    raise sqlite3.OperationalError("table rtree_regions_geom_node may not be modified")


@pytest.mark.parametrize("packed", [True, False])
@pytest.mark.parametrize("count", [1, 51, 52, 3000])
def test_the_spatial_index_finds_what_a_window_touches(
    tmp_path: Path, count: int, packed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not packed:  # as where SQLite protects the tables of an index
        monkeypatch.setattr(geopackage, "_pack_index", _protected)
    x, y = np.random.default_rng(count).random((2, count)) * 1000
    boxes = shapely.box(4e5 + x, 5e6 + y, 4e5 + x + 20, 5e6 + y + 20)
    path = by_us(Regions({"id": np.arange(count)}, boxes, None), tmp_path / "a.gpkg")
    window = (4e5 + 100, 5e6 + 200, 4e5 + 300, 5e6 + 250)
    _, fids, _, _ = pyogrio.raw.read(path, layer="regions", bbox=window, return_fids=True)
    expected = np.flatnonzero(shapely.intersects(boxes, shapely.box(*window))) + 1
    assert sorted(fids.tolist()) == expected.tolist()
    with closing(sqlite3.connect(path)) as base:
        assert base.execute("SELECT rtreecheck('rtree_regions_geom')").fetchone() == ("ok",)
        assert base.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        assert base.execute("PRAGMA foreign_key_check").fetchall() == []


def test_gdal_edits_the_layer(tmp_path: Path) -> None:
    """Triggers keep the index and the count up to date."""
    regions = regions_of([(1, 2.0, "a"), (2, 3.0, "b")], pyproj.CRS.from_epsg(32610).to_wkt())
    path = by_us(regions, tmp_path / "a.gpkg")
    more = pyogrio.read_dataframe(path, layer="regions")
    more.geometry = more.geometry.translate(100, 50)
    pyogrio.write_dataframe(more, path, layer="regions", append=True)
    assert pyogrio.read_info(path, layer="regions")["features"] == 4
    assert rows(path, "gpkg_ogr_contents")[0] == ("regions", 4)
    assert len(pyogrio.read_dataframe(path, layer="regions", bbox=(90, 0, 200, 100))) == 2
    assert tuple(pyogrio.read_info(path, layer="regions")["total_bounds"]) == (0, 0.1, 104, 52)


def test_utm_in_feet_is_no_utm_in_metres(tmp_path: Path) -> None:
    """GDAL takes it for EPSG:32610."""
    crs = pyproj.CRS.from_user_input("+proj=utm +zone=10 +datum=WGS84 +units=us-ft")
    path = by_us(regions_of([(1, 2.0, "a")], crs.to_wkt()), tmp_path / "a.gpkg")
    assert pyproj.CRS(as_read(path)["crs"]).axis_info[0].unit_name == "US survey foot"


def test_columns_that_differ_in_case_alone_are_refused(tmp_path: Path) -> None:
    regions = Regions(
        {"id": np.array([1]), "ID": np.array([2])}, np.array([shapely.box(0, 0, 1, 1)], object), None
    )
    with pytest.raises(OutputError, match="duplicate column name"):
        write_regions(regions, tmp_path / "a.gpkg")
    assert list(tmp_path.iterdir()) == []
