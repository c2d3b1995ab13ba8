"""Regions in a notebook: facts, a drawing that is well-formed, and the table."""

import pickle
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import geopandas
import numpy as np
import pytest

import uavseg
from uavseg.regions.frame import RegionFrame

QUARRY = Path(__file__).resolve().parents[2] / "samples" / "quarry.tif"


@pytest.fixture(scope="module")
def regions() -> RegionFrame:
    return uavseg.extract(QUARRY, (0.511, 1))  # type: ignore[return-value]


def test_facts_stand_above_the_table(regions: RegionFrame) -> None:
    area = f"{regions['area_m2'].sum():,.0f} m²"
    assert regions.summary == f"4 regions, {area}, v 0.511 to 1, {QUARRY}, WGS 84 / UTM zone 10N"
    html = regions._repr_html_()
    assert html.index("4 regions") < html.index("<svg") < html.index("<table")


def test_each_region_is_drawn_once_within_the_page(regions: RegionFrame) -> None:
    [svg] = re.findall(r"<svg.*</svg>", regions._repr_html_())
    root = ET.fromstring(svg)
    paths = root.findall(".//{http://www.w3.org/2000/svg}path")
    assert len(paths) == len(regions)
    points = np.array([re.findall(r"(-?[\d.]+) (-?[\d.]+)", path.get("d", ""))[0] for path in paths], float)
    assert (points >= -1).all() and (
        points <= (float(root.get("width", 0)) + 1, float(root.get("height", 0)) + 1)
    ).all()


def test_it_is_a_geodataframe(regions: RegionFrame) -> None:
    assert isinstance(regions, geopandas.GeoDataFrame)
    some = regions[regions["pixels"] > 100]
    assert some.summary.startswith(f"{len(some)} region") and some.attrs["uavseg"]["job"] == "extract"
    again = pickle.loads(pickle.dumps(regions))
    assert again.equals(regions) and again.attrs == regions.attrs


def test_none_and_local_regions_have_a_summary_too() -> None:
    image = np.zeros((64, 64), np.uint8)
    with pytest.warns(UserWarning):
        nothing = uavseg.extract(image, (0.9, 1))
    assert nothing.summary.startswith("0 regions, 0 square units") and "<svg" not in nothing._repr_html_()
    image[10:30, 10:30] = 255
    found = uavseg.extract(image, (0.9, 1))
    assert found.summary == "1 region, 400 square units, v 0.9 to 1, array, no CRS"
    assert "<svg" in found._repr_html_()


def test_names_of_files_are_escaped(tmp_path: Path) -> None:
    odd = tmp_path / "<script>.tif"
    odd.write_bytes(QUARRY.read_bytes())
    html = uavseg.extract(odd, (0.511, 1))._repr_html_()
    assert "<script>" not in html and "&lt;script&gt;" in html
