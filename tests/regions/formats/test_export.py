"""Regions as files: what is read back is what was written."""

import io
import json
import shutil
import subprocess

import numpy as np
import pyogrio
import pytest
import shapely
from affine import Affine
from rasterio.crs import CRS

from uavseg.errors import OutputError, OutputExistsError
from uavseg.raster.grid.geobox import GeoBox
from uavseg.regions.formats import export
from uavseg.regions.outline.trace import trace
from uavseg.regions.shapes import RaggedPolygons
from uavseg.regions.table import COLUMNS, make_regions
from uavseg.regions.wgs84 import to_wgs84
from uavseg.segmentation.components import Sums

FIRSTS = np.empty((0, 2), np.int64)  # no measure depends on first pixels
FORMATS = [".geojson", ".json", ".gpkg", ".fgb", ".parquet", ".shp", ".kml"]
KEEPING = [".gpkg", ".fgb", ".parquet", ".shp"]
GLOBAL = [".geojson", ".json", ".kml"]
PICTURE = np.array([[1, 1, 1, 0, 3], [1, 0, 1, 0, 0], [1, 1, 1, 2, 2]], np.uint32)
IN_PARTS = np.array([[1, 0, 1], [0, 2, 0]], np.uint32)
LONG = {"perim_m": "perimeter_m", "range_lo": "range_low", "range_hi": "range_high"}
UTM = Affine(0.5, 0, 400_000.25, 0, -0.5, 5_000_000.125)


def regions_of(labels, transform=UTM, crs=32618):
    box = GeoBox(labels.shape, transform, None if crs is None else CRS.from_user_input(crs))
    rings, counts = trace(labels), np.bincount(labels.reshape(-1), minlength=1)[1:]
    greys = np.arange(1, len(counts) + 1) * 9000 * counts
    squares = (greys // np.maximum(counts, 1) + 100.0) ** 2 * counts
    return make_regions(rings, Sums(counts, greys, squares, FIRSTS), box, (0.25, 1), "Übung 'Nord'.tif")


def read(path):
    if path.suffix == ".parquet":
        import geopandas

        frame = geopandas.read_parquet(path)
    else:
        frame = pyogrio.read_dataframe(path)
    if path.suffix == ".kml":  # which has an id of its own, and no other
        frame = frame.drop(columns="id").rename(columns={"id2": "id"})
    frame = frame.rename(columns=LONG)
    return frame.sort_values("id").reset_index(drop=True)


def same_polygons(some, others):
    return shapely.equals(shapely.normalize(np.asarray(some)), shapely.normalize(np.asarray(others))).all()


@pytest.mark.parametrize("picture", [PICTURE, IN_PARTS])
@pytest.mark.parametrize("suffix", FORMATS)
def test_files_hold_the_regions_that_were_written(tmp_path, suffix, picture):
    regions, path = regions_of(picture), tmp_path / f"out{suffix}"
    export.write_regions(regions, path)
    frame = read(path)
    expected = to_wgs84.wgs84_geometries(regions) if suffix in GLOBAL else regions.polygons
    assert same_polygons(frame.geometry, expected)
    assert frame.crs == (4326 if suffix in GLOBAL else 32618)
    for name, column in regions.columns.items():
        if column.dtype.kind == "f":
            np.testing.assert_allclose(frame[name].astype(float), column, rtol=1e-11)
        else:
            assert frame[name].astype(column.dtype).tolist() == column.tolist()


@pytest.mark.parametrize("suffix", [".gpkg", ".fgb", ".parquet"])
def test_columns_keep_their_names_order_and_kinds(tmp_path, suffix):
    export.write_regions(regions_of(PICTURE), tmp_path / f"out{suffix}")
    frame = read(tmp_path / f"out{suffix}")
    assert list(frame.columns) == [*COLUMNS, "geometry"]
    assert [frame[name].dtype.kind for name in list(COLUMNS)[:-1]] == [
        np.dtype(kind).kind for kind in list(COLUMNS.values())[:-1]
    ]


@pytest.mark.parametrize("suffix", FORMATS)
def test_no_regions_are_a_layer_with_all_its_fields(tmp_path, suffix):
    path = tmp_path / f"none{suffix}"
    export.write_regions(regions_of(np.zeros((3, 3), np.uint32)), path)
    if suffix in (".geojson", ".json"):
        assert json.loads(path.read_text()) == {"type": "FeatureCollection", "features": []}
    else:
        frame = read(path) if suffix != ".kml" else pyogrio.read_dataframe(path)
        assert len(frame) == 0
        assert set(COLUMNS) <= set(frame.columns) or suffix == ".kml"


@pytest.mark.parametrize("suffix", FORMATS)
def test_the_same_regions_are_the_same_bytes(tmp_path, suffix):
    for folder in (tmp_path / "a", tmp_path / "b"):
        folder.mkdir()
        export.write_regions(regions_of(PICTURE), folder / f"out{suffix}")
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()


def test_no_file_holds_the_time_of_writing(tmp_path):
    export.write_regions(regions_of(PICTURE), tmp_path / "out.shp")
    export.write_regions(regions_of(PICTURE), tmp_path / "out.gpkg")
    assert (tmp_path / "out.dbf").read_bytes()[1:4] == bytes([100, 1, 1])
    assert b"2000-01-01T00:00:00" in (tmp_path / "out.gpkg").read_bytes()
    assert pyogrio.get_gdal_config_option("OGR_CURRENT_DATE") is None


def test_field_names_of_a_shapefile_fit_and_differ():
    names = [export._SHORT_NAMES.get(name, name) for name in COLUMNS]
    assert max(len(name) for name in names) <= 10
    assert len(set(names)) == len(names)


def test_a_shapefile_holds_the_area_of_a_continent(tmp_path):
    regions = regions_of(PICTURE)
    regions.columns["area_m2"][:] = [5.10065621724088e14, 0.0001, 123456.789]
    export.write_regions(regions, tmp_path / "out.shp")
    np.testing.assert_allclose(read(tmp_path / "out.shp").area_m2, regions.columns["area_m2"], rtol=1e-11)


@pytest.mark.parametrize("suffix", KEEPING)
def test_local_coordinates_stay_as_they_are(tmp_path, suffix):
    regions, path = regions_of(PICTURE, Affine(1, 0, 0, 0, 1, 0), None), tmp_path / f"local{suffix}"
    export.write_regions(regions, path)
    frame = read(path)
    assert same_polygons(frame.geometry, regions.polygons)
    assert frame.lon.isna().all()
    assert frame.crs is None or "unknown" in frame.crs.name.lower() or "undefined" in frame.crs.name.lower()


def test_a_local_geojson_has_the_local_coordinates(tmp_path):
    regions = regions_of(PICTURE, Affine(0.25, 0, 1e6, 0, -0.25, 7), None)
    export.write_regions(regions, tmp_path / "local.geojson")
    features = json.loads((tmp_path / "local.geojson").read_text())["features"]
    assert same_polygons(
        [shapely.geometry.shape(feature["geometry"]) for feature in features], regions.polygons
    )
    assert features[0]["properties"]["lon"] is None


def test_kml_needs_a_crs(tmp_path):
    with pytest.raises(OutputError, match=r"place on the globe.*\.gpkg"):
        export.write_regions(regions_of(PICTURE, crs=None), tmp_path / "local.kml")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["regions.tif", "regions", "regions.geojson.zip", "memory:"])
def test_an_unknown_extension_is_refused_with_the_known_ones(tmp_path, name):
    with pytest.raises(OutputError, match=r"\.geojson, \.json, \.gpkg, \.fgb, \.parquet, \.shp or \.kml"):
        export.write_regions(regions_of(PICTURE), tmp_path / name)


def test_extensions_may_be_in_capitals(tmp_path):
    export.write_regions(regions_of(PICTURE), tmp_path / "OUT.GPKG")
    assert len(pyogrio.read_dataframe(tmp_path / "OUT.GPKG")) == 3


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_file_is_replaced_only_if_that_is_allowed(tmp_path, suffix):
    path = tmp_path / f"out{suffix}"
    path.write_text("mine")
    with pytest.raises(OutputExistsError):
        export.write_regions(regions_of(PICTURE), path)
    assert path.read_text() == "mine"
    export.write_regions(regions_of(PICTURE), path, overwrite=True)
    assert len(read(path)) == 3


@pytest.mark.parametrize("stream", [io.BytesIO, io.StringIO])
def test_a_stream_gets_what_a_file_gets(tmp_path, stream):
    with stream() as written:
        export.write_regions(regions_of(PICTURE), written)
        text = written.getvalue()
    export.write_regions(regions_of(PICTURE), tmp_path / "out.geojson")
    assert (text if isinstance(text, bytes) else text.encode()) == (tmp_path / "out.geojson").read_bytes()


@pytest.mark.parametrize("suffix", FORMATS)
def test_writing_prints_nothing(tmp_path, suffix, capfd, recwarn):
    export.write_regions(regions_of(PICTURE), tmp_path / f"out{suffix}")
    assert capfd.readouterr() == ("", "")
    assert [str(warning.message) for warning in recwarn] == []


@pytest.mark.skipif(shutil.which("ogrinfo") is None, reason="gdal-bin is not installed")
@pytest.mark.parametrize("suffix", [".geojson", ".gpkg", ".fgb", ".shp", ".kml"])
def test_gdal_of_the_system_reads_it_too(tmp_path, suffix):
    export.write_regions(regions_of(PICTURE), tmp_path / f"out{suffix}")
    told = subprocess.run(
        ["ogrinfo", "-ro", "-so", "-al", tmp_path / f"out{suffix}"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert "Feature Count: 3" in told.stdout
    assert "Layer name: regions" in told.stdout or suffix in (".geojson", ".shp")
    assert "Geometry: Polygon" in told.stdout or suffix == ".kml"


@pytest.mark.parametrize("suffix", KEEPING)
def test_ctrl_c_while_a_file_is_written_is_ctrl_c_and_leaves_none(tmp_path, suffix, monkeypatch):
    def stopped(*_, **__):
        raise KeyboardInterrupt

    regions = regions_of(PICTURE)
    monkeypatch.setattr(export.shapely, "to_wkb", stopped)
    monkeypatch.setattr(RaggedPolygons, "to_wkb", stopped)
    with pytest.raises(KeyboardInterrupt):
        export.write_regions(regions, tmp_path / f"a{suffix}")
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_reported(tmp_path, monkeypatch):
    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(export.text_writers, "write_geojson", fail)
    with pytest.raises(OutputError, match="cannot be written: No space left"):
        export.write_regions(regions_of(PICTURE), tmp_path / "out.geojson")
    assert list(tmp_path.iterdir()) == []
