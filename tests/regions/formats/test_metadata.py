"""Files of regions say from what and how they were made, and info reads it back."""

import json
import xml.etree.ElementTree as ET
from contextlib import chdir
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import pytest
import rasterio
import shapely
from affine import Affine
from click.testing import CliRunner
from hypothesis import HealthCheck, given, settings, strategies as st

import uavseg
from uavseg.cli import main
from uavseg.regions.formats.export import write_regions
from uavseg.regions.formats.metadata import about_file, is_region_file, metadata_text, parse_metadata
from uavseg.regions.table import Regions

FORMATS = ["geojson", "gpkg", "fgb", "parquet", "kml"]
PLACE = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6)}


@pytest.fixture
def tile(tmp_path: Path) -> Path:
    image = np.full((64, 96), 40, np.uint8)
    image[10:50, 20:70] = 210
    with rasterio.open(tmp_path / "a b.tif", "w", "GTiff", 96, 64, 1, dtype="uint8", **PLACE) as file:
        file.write(image, 1)
    return tmp_path


def run(*words: object) -> Any:
    done = CliRunner().invoke(main, [str(word) for word in words])
    assert done.exit_code == 0, done.output
    return done


def regions(metadata: dict[str, Any]) -> Regions:
    values = {"area_m2": 0, "perimeter_m": 0, "mean": 0, "std": 0, "pixels": 0, "holes": 0}
    columns = {"id": np.arange(1, 3)} | {name: np.ones(2) for name in values}
    polygons = np.array([shapely.box(k, 0, k + 0.5, 1) for k in (0, 1)], object)
    return Regions(columns, polygons, pyproj.CRS(4326).to_wkt(), metadata)


texts = st.text(max_size=30)
values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**53), 2**53)
    | st.floats(allow_nan=False, allow_infinity=False)
    | texts,
    lambda inner: st.lists(inner, max_size=3),
    max_leaves=8,
)


@pytest.mark.slow
@pytest.mark.parametrize("extension", FORMATS)
@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(metadata=st.dictionaries(texts, values, min_size=1, max_size=4))
def test_what_is_written_is_read_back(tmp_path: Path, extension: str, metadata: dict[str, Any]) -> None:
    path = tmp_path / f"r.{extension}"
    known = json.loads(json.dumps(metadata))
    write_regions(regions(known), path, overwrite=True)
    found = about_file(path)
    assert found.metadata == known and found.regions == 2 and found.crs is not None


@pytest.mark.parametrize("extension", [*FORMATS, "shp"])
def test_info_shows_how_regions_were_made(tile: Path, extension: str) -> None:
    with chdir(tile):
        out = f"r.{extension}"
        run("extract", "a b.tif", "--range", "0.5,0.9", "--nodata", 7, "--min-area", "9px", "-o", out)
        assert is_region_file(out) and not is_region_file("a b.tif")
        text, metadata = run("info", out).stdout, json.loads(run("info", out, "--json").stdout)
        assert uavseg.info(out).as_dict() == metadata | {  # type: ignore[comparison-overlap]
            "columns": tuple(metadata["columns"]),
            "bounds": tuple(metadata["bounds"]),
        }
    assert metadata["regions"] == 1 and {"id", "area_m2", "mean", "source"} <= set(metadata["columns"])
    if extension == "shp":
        assert metadata["metadata"] == {} and "does not say how" in text
        return
    about = metadata["metadata"]
    assert about["sources"] == ["a b.tif"] and about["software"] == f"uavseg {uavseg.__version__}"
    assert about["range"] == [0.5, 0.9] and about["range_values"] == [127.5, 229.5]
    assert (about["band"], about["nodata"], about["stretch"]) == ("band 1", 7, "dtype -> 0..255")
    assert (about["method"], about["refine"], about["min_area"]) == ("adaptive", "tv", "9 pixels")
    for line in ("range            v 0.5 to 0.9; values 127.5 to 229.5", "sources          a b.tif"):
        assert line in text
    assert str(tile) not in json.dumps(about)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("levels", "--width", 0.25), {"job": "levels", "levels": [0, 0.25, 0.5, 0.75, 1], "refine": "tv"}),
        (("match", "--like", "400088,4999940,44", "--window", 16), {"job": "match", "window": 16}),
        (("extract", "--range", "0,0.5"), {"job": "extract", "range_values": [0, 127.5]}),
    ],
)
def test_every_job_that_makes_regions_says_how(
    tile: Path, words: tuple[object, ...], expected: dict[str, Any]
) -> None:
    with chdir(tile):
        run(*words, "a b.tif", "-o", "r.fgb")
        assert expected.items() <= about_file("r.fgb").metadata.items()


@pytest.mark.slow
def test_a_block_map_and_both_faces_say_the_same(tile: Path) -> None:
    with chdir(tile):
        run("extract", "a b.tif", "--range", "0.5,1", "-o", "r.fgb")
        run("divide", "a b.tif", "-o", "blocks.tif")
        run("extract", "blocks.tif", "--range", "0.5,1", "-o", "b.fgb")
        frame = uavseg.extract("a b.tif", range="0.5,1")
        assert frame.attrs["uavseg"] == about_file("r.fgb").metadata == about_file("b.fgb").metadata


def test_the_files_stay_valid(tile: Path) -> None:
    with chdir(tile):
        run("extract", "a b.tif", "--range", "0.5,1", "-o", "r.kml")
        run("extract", "a b.tif", "--range", "0.5,1", "-o", "r.geojson")
        document = ET.parse("r.kml").getroot()[0]
        classes = [child.tag.rpartition("}")[2] for child in document]
        assert classes == ["Style", "ExtendedData", "Schema", "Folder"]  # the order of KML 2.2
        found = json.loads(Path("r.geojson").read_text())
    assert list(found) == ["type", "uavseg", "features"] and len(found["features"]) == 1


def test_files_of_others_say_nothing(tile: Path) -> None:
    with chdir(tile):
        run("extract", "a b.tif", "--range", "0.5,1", "-o", "r.geojson")
        plain = json.loads(Path("r.geojson").read_text())
        del plain["uavseg"]
        for member in (None, 3, "text", [1], {"sources": {"deep": 1}, "range": "odd"}):
            Path("o.geojson").write_text(json.dumps({"uavseg": member} | plain))
            assert "1 (Polygon)" in run("info", "o.geojson").stdout
        Path("o.geojson").write_text('{"type":"FeatureCollection","uavseg":{"a":[[')
        done = CliRunner().invoke(main, ["info", "o.geojson"])
        assert done.exit_code == 1 and done.stderr.count("\n") == 1


def test_options_of_rasters_are_refused_for_regions(tile: Path) -> None:
    with chdir(tile):
        run("extract", "a b.tif", "--range", "0.5,1", "-o", "r.gpkg")
        for option in (("--band", "1"), ("--nodata", "0"), ("--stretch", "minmax"), ("--skip-bad-tiles",)):
            done = CliRunner().invoke(main, ["info", "r.gpkg", *option])
            assert done.exit_code == 1 and "are for rasters" in done.stderr


@given(st.text())
def test_text_that_is_no_metadata_is_none(text: str) -> None:
    assert isinstance(parse_metadata(text), dict)
    assert parse_metadata(metadata_text({"a": text})) == {"a": text}


@pytest.mark.parametrize("number", ["NaN", "-Infinity", "1e999"])
def test_what_is_not_finite_is_not_shown_as_json(tmp_path: Path, number: str) -> None:
    assert parse_metadata(f'{{"range": [0, {number}]}}') == {}
    ring = f"[[0, 0], [1e999, 0], [1, 1], [0, {number.replace('NaN', '-1e999')}], [0, 0]]"
    path = tmp_path / "r.geojson"
    path.write_text(f'{{"type": "Polygon", "coordinates": [{ring}]}}')
    with chdir(tmp_path):
        metadata = json.loads(run("info", "r.geojson", "--json").stdout)
    assert metadata["bounds"] is None and metadata["regions"] == 1


def test_a_geopackage_whose_text_is_damaged_is_still_told_apart(tmp_path: Path) -> None:
    path = tmp_path / "r.gpkg"
    write_regions(regions({}), path)
    content = path.read_bytes()
    schema = content.replace(b"CREATE TABLE gpkg_contents", b"CREATE TABLE\xffgpkg_contents")
    assert schema != content
    for damaged in (content, content.replace(b"features", b"feat\xffres"), schema):
        path.write_bytes(damaged)
        assert is_region_file(path) == (damaged == content)
