"""The widget of notebooks: its range, and the regions of the range that was chosen."""

import json
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine

import uavseg
from uavseg.errors import IntensityRangeError, MissingLibraryError, ParameterError, RasterError

pytest.importorskip("anywidget")
from uavseg.api.widget import RangeWidget


@pytest.fixture
def name(tmp_path: Path) -> str:
    image = np.full((80, 90), 30, np.uint8)
    image[16:56, 16:64] = 200
    image[60:64, 80:84] = 120
    place = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6)}
    path = str(tmp_path / "tile.tif")
    with rasterio.open(path, "w", "GTiff", 90, 80, 1, dtype="uint8", **place) as file:
        file.write(image, 1)
    return path


def data_of(widget: RangeWidget) -> dict[str, Any]:
    [text] = re.findall(r'id="data">(.*?)</script>', widget.page, re.DOTALL)
    found: dict[str, Any] = json.loads(text)
    return found


@pytest.mark.slow
def test_regions_are_those_of_extract_in_the_range(name: str) -> None:
    widget = RangeWidget(name, (0.4, 1), min_area="20px", height=300)
    for chosen in [(0.4, 1), (0.05, 0.3)]:
        widget.range = chosen
        expected = uavseg.extract(name, chosen, min_area="20px")
        assert widget.regions().geometry.geom_equals(expected.geometry).all()
        assert widget.regions().attrs == expected.attrs and len(expected)


def test_the_page_begins_with_the_range(name: str) -> None:
    data = data_of(RangeWidget(name, (0.123, 0.5)))
    assert data["range"] == [123, 500] and data["cells"] is not None
    assert data["regions"] is None and data["missions"] == []


def test_words_of_reading_are_those_of_the_page(name: str) -> None:
    plain, other = (data_of(RangeWidget(name, **words)) for words in ({}, {"stretch": "0,400"}))
    assert plain["cells"]["codes"] != other["cells"]["codes"]


def test_regions_are_shown(name: str) -> None:
    regions = uavseg.extract(name, (0.55, 1))
    [feature] = data_of(RangeWidget(name, regions=regions))["regions"]["features"]
    assert feature["properties"]["pixels"] == 40 * 48


@pytest.mark.parametrize(
    "range", [(0.5, 0.5), (0.9, 0.1), (-0.1, 0.5), (0.5, 1.001), (0.1234, 0.5), (float("nan"), 1)]
)
def test_ranges_that_the_slider_cannot_show_are_refused(name: str, range: tuple[float, float]) -> None:
    with pytest.raises(IntensityRangeError, match="in thousandths"):
        RangeWidget(name, range)
    widget = RangeWidget(name)
    with pytest.raises(IntensityRangeError, match="in thousandths"):
        widget.range = range
    assert widget.range == (0.55, 1)


def test_changes_are_observed(name: str) -> None:
    widget, seen = RangeWidget(name), []
    widget.observe(lambda change: seen.append(change["new"]), "range")
    widget.set_state({"range": [0.6, 0.9]})  # as the browser does
    assert seen == [(0.6, 0.9)] and widget.range == (0.6, 0.9)


def test_wrong_words_are_errors_at_once(name: str) -> None:
    with pytest.raises(TypeError, match="bandd"):
        RangeWidget(name, bandd=1)
    with pytest.raises(ParameterError, match=r"values is for uavseg\.extract"):
        RangeWidget(name, values=(20, 30))
    with pytest.raises(ParameterError, match="200 to 4000 pixels, not 5"):
        RangeWidget(name, height=5)
    with pytest.raises(ParameterError, match="not 1"):
        RangeWidget(name, size=1)


def test_a_raster_without_a_place_is_refused() -> None:
    with pytest.raises(RasterError, match="no coordinate system"):
        RangeWidget(np.zeros((64, 64), np.uint8))


def test_without_anywidget_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "anywidget", None)
    monkeypatch.delitem(sys.modules, "uavseg.api.widget")
    with pytest.raises(MissingLibraryError, match=r'pip install "uavseg\[notebook\]"'):
        import uavseg.api.widget  # noqa: F401
