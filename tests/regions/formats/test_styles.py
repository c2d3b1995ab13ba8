"""Styles: well-formed, with a symbol for each class, beside the files of regions."""

import sqlite3
import xml.etree.ElementTree as ET
from contextlib import chdir, closing
from pathlib import Path

import geopandas
import numpy as np
import pandas
import pyogrio
import pytest
import shapely
from click.testing import CliRunner
from hypothesis import given, strategies as st

from uavseg.cli import main
from uavseg.raster.geodesy.globe import WGS84
from uavseg.regions.formats.export import write_regions
from uavseg.regions.formats.metadata import about_file
from uavseg.regions.formats.read import read_regions
from uavseg.regions.formats.styles import classes_of, qml, sld
from uavseg.regions.table import Regions

QUARRY = Path(__file__).resolve().parents[3] / "samples" / "quarry.tif"
SLD, OGC = "{http://www.opengis.net/sld}", "{http://www.opengis.net/ogc}"
names = st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs", "Co", "Cn"]), min_size=1)


def regions(**more: np.ndarray) -> Regions:
    polygons = np.array([shapely.box(k, 0, k + 0.5, 1) for k in range(3)], object)
    columns = {"id": np.arange(1, 4), "area_m2": np.ones(3)} | more
    return Regions(columns, polygons, WGS84)


def of_classes(*values: str) -> Regions:
    return regions(**{"class": np.array(values, object)})


@given(st.lists(names, min_size=3, max_size=3))
def test_each_class_has_its_rule_and_its_symbol(values: list[str]) -> None:
    found = of_classes(*values)
    column, classes = classes_of(found) or ("", ())
    assert column == "class" and [name for name, _ in classes] == sorted(set(values))
    rules = ET.fromstring(sld(found).encode()).iter(f"{SLD}Rule")
    assert [rule.findtext(f".//{OGC}Literal") for rule in rules] == sorted(set(values))
    renderer = ET.fromstring(qml(found)).find("renderer-v2")
    assert (
        renderer is not None
        and renderer.get("type") == "categorizedSymbol"
        and renderer.get("attr") == "class"
    )
    categories = renderer.findall("categories/category")
    assert [one.get("value") for one in categories] == sorted(set(values))
    symbols = {symbol.get("name") for symbol in renderer.findall("symbols/symbol")}
    assert {one.get("symbol") for one in categories} == symbols


def test_colours_that_are_given_are_used() -> None:
    names, colors = ["water", "sand", "wood"], ["#0000ff", "#ffff00", ""]
    colored = regions(**{"class": np.array(names, object), "color": np.array(colors, object)})
    text = qml(colored)
    assert 'value="0,0,255,89"' in text and 'value="255,255,0,89"' in text
    found = classes_of(colored)
    assert found is not None and [name for name, _ in found[1]] == ["sand", "water", "wood"]


def test_levels_go_from_dark_to_bright() -> None:
    column, classes = classes_of(regions(level=np.array([0, 3, 7]))) or ("", ())
    assert column == "level" and [name for name, _ in classes] == ["0", "3", "7"]
    assert [color for _, color in classes] == ["#440154", "#21918c", "#fde725"]


@pytest.mark.parametrize("found", [regions(), of_classes("a", "b", "a"), regions(level=np.array([1, 2, 2]))])
def test_sld_has_the_structure_of_its_schema(found: Regions) -> None:
    """StyledLayerDescriptor 1.0.0: the children of each element in their order."""
    root = ET.fromstring(sld(found, "layer").encode())
    assert root.tag == f"{SLD}StyledLayerDescriptor" and root.get("version") == "1.0.0"
    expected = {
        "StyledLayerDescriptor": ["NamedLayer"],
        "NamedLayer": ["Name", "UserStyle"],
        "UserStyle": ["Name", "FeatureTypeStyle"],
        "PolygonSymbolizer": ["Fill", "Stroke"],
    }
    for element in root.iter():
        tag = element.tag.removeprefix(SLD)
        children = [child.tag.removeprefix(SLD).removeprefix(OGC) for child in element]
        if tag in expected:
            assert children == expected[tag]
        elif tag == "FeatureTypeStyle":
            assert children and set(children) == {"Rule"}
        elif tag == "Rule":
            assert children in (["Name", "PolygonSymbolizer"], ["Name", "Filter", "PolygonSymbolizer"])
        elif tag in ("Fill", "Stroke"):
            assert set(children) == {"CssParameter"}


def test_a_geopackage_holds_one_layer(tmp_path: Path) -> None:
    path = tmp_path / "a.gpkg"
    write_regions(of_classes("a", "b", "a"), path)
    with closing(sqlite3.connect(path)) as base:
        assert dict(base.execute("SELECT table_name, data_type FROM gpkg_contents")) == {
            "regions": "features"
        }
        assert base.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
    assert len(geopandas.read_file(path)) == 3  # a warning of a second layer is an error in these tests


def test_the_table_in_which_qgis_saves_styles_is_no_layer_of_regions(tmp_path: Path) -> None:
    path = tmp_path / "a.gpkg"
    write_regions(of_classes("a", "b", "a"), path)
    styles = pandas.DataFrame({"f_table_name": ["regions"], "styleQML": ["<qgis/>"]})
    pyogrio.write_dataframe(styles, path, layer="layer_styles", append=True)
    assert len(pyogrio.list_layers(path)) == 2
    assert len(read_regions(path)) == 3 and about_file(path).others == 0


def test_the_same_regions_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a.gpkg", "b.gpkg"):
        write_regions(of_classes("a", "b", "a"), tmp_path / name)
    assert (tmp_path / "a.gpkg").read_bytes() == (tmp_path / "b.gpkg").read_bytes()


@pytest.mark.parametrize("kind", ["qml", "sld"])
def test_a_style_is_written_beside_the_regions(tmp_path: Path, kind: str) -> None:
    words = ["extract", str(QUARRY), "--range", "0.511,1", "-o", "out.geojson", "-q", "--style", kind]
    with chdir(tmp_path):
        assert CliRunner().invoke(main, words).exit_code == 0
        style = Path(f"out.{kind}")
        before = style.read_bytes()
        ET.fromstring(before)
        Path("out.geojson").unlink()
        again = CliRunner().invoke(main, words)
        assert again.exit_code == 1 and f"out.{kind} exists" in again.stderr
        assert not Path("out.geojson").exists()
        assert CliRunner().invoke(main, [*words, "--overwrite"]).exit_code == 0
        assert style.read_bytes() == before and Path("out.geojson").exists()


def test_a_style_needs_one_file(tmp_path: Path) -> None:
    with chdir(tmp_path):
        for more in (("-o", "-"), ("--each", "-o", "{stem}.geojson")):
            words = ["extract", str(QUARRY), "--range", "0.511,1", "--style", "qml", *more]
            done = CliRunner().invoke(main, words)
            assert done.exit_code == 2 and "--style" in done.stderr and not list(Path().iterdir())
