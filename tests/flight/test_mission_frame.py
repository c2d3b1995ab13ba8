"""Missions in notebooks: the table is that of the .geojson file, the drawing shows what is flown."""

import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import geopandas
import numpy as np
import pandas as pd
import pytest
from shapely.geometry import box

import uavseg
from uavseg.errors import MissingLibraryError
from uavseg.flight.formats.files import write_mission
from uavseg.flight.mission.items import FencePolygon
from uavseg.flight.mission.mission import Mission
from uavseg.flight.safety.check import SafetyCheck
from uavseg.jobs.flights.plan import MissionPlan


@pytest.fixture(scope="module")
def mission() -> Mission:
    frame = geopandas.GeoDataFrame({"id": [1]}, geometry=[box(4e5, 5e6, 4e5 + 120, 5e6 + 90)], crs=32618)
    with pytest.warns(UserWarning):
        plan = uavseg.plan(
            frame,
            altitude=60,
            camera="mavic 3 enterprise",
            home=(45.1455, -76.2720),
            rally=[(45.1450, -76.2719, 40)],
        )
    [mission] = plan.missions
    return mission


def test_the_table_is_that_of_the_file(mission: Mission, tmp_path: Path) -> None:
    write_mission(mission, tmp_path / "fly.geojson")
    theirs = geopandas.read_file(tmp_path / "fly.geojson")
    ours = mission.to_geodataframe()
    assert ours.crs.to_epsg() == 4326 and len(ours) == len(theirs)
    assert set(ours.columns) == set(theirs.columns)
    assert ours.geometry.isna().tolist() == theirs.geometry.isna().tolist()
    here = ~ours.geometry.isna()
    assert ours.geometry[here].geom_equals_exact(theirs.geometry[here], 1e-9).all()
    for name in ("kind", "height_above"):
        assert ours[name].fillna("").tolist() == theirs[name].fillna("").tolist()
    for name in ("number", "command", "altitude_m", "radius_m", "distance_m"):
        if name in ours:
            assert np.allclose(*(pd.to_numeric(one[name]) for one in (ours, theirs)), equal_nan=True)


def test_the_table_has_every_item_in_order(mission: Mission) -> None:
    items = mission.to_geodataframe().query("kind == 'item'")
    assert items["number"].tolist() == list(range(1, len(mission.items) + 1))
    assert items["command"].tolist() == [item.command for item in mission.items]


def test_the_drawing_has_the_flight_the_photographs_and_home(mission: Mission) -> None:
    html = mission._repr_html_()
    root = ElementTree.fromstring(html)
    frame = mission.to_geodataframe()
    drawn = len(frame[frame["kind"].isin(["fence", "flight", "photographs", "rally", "home"])])
    svg = {"s": "http://www.w3.org/2000/svg"}
    assert len(root.findall(".//s:polyline", svg)) + len(root.findall(".//s:circle", svg)) == drawn
    width, height = (float(n) for n in re.findall(r'(?:width|height)="(\d+)"', html)[:2])
    places = [
        tuple(map(float, pair.split(","))) for pair in re.findall(r"[\d.-]+,[\d.-]+", html.split("<svg")[1])
    ]
    assert all(0 <= x <= width + 1 and 0 <= y <= height + 1 for x, y in places)
    assert f"{len(mission.items)} items for ardupilot" in html
    assert f"{mission.distance_m:,.0f} m" in html


def test_north_is_up_and_home_has_its_place(mission: Mission) -> None:
    _, _, home_line = mission._repr_html_().rpartition("<circle")
    x, y = (float(n) for n in re.findall(r'c[xy]="([\d.]+)"', home_line))
    svg = mission._repr_html_().split("<polyline")[2]  # after the fence: the flight
    first = re.findall(r"([\d.]+),([\d.]+)", svg)[0]
    assert (x, y) == tuple(map(float, first))


def drawn_with(mission: Mission, **changes: Any) -> str:
    return replace(mission, **changes)._repr_html_()


def test_a_fence_to_stay_out_of_is_filled(mission: Mission) -> None:
    [shape] = mission.fence
    assert isinstance(shape, FencePolygon)
    assert 'fill-opacity="0.3"' not in mission._repr_html_()
    assert 'fill-opacity="0.3"' in drawn_with(mission, fence=(replace(shape, inclusion=False),))


def test_the_drawing_is_the_same_across_the_antimeridian(mission: Mission) -> None:
    def moved(degrees: float) -> str:
        shift = degrees - mission.home.lon

        def at(lon: float) -> float:
            return (lon + shift + 180) % 360 - 180

        items = [replace(one, lon=at(one.lon)) if one.has_position else one for one in mission.items]
        home = replace(mission.home, lon=at(mission.home.lon))
        return drawn_with(mission, home=home, items=tuple(items), fence=(), rally=(), blocks=(), ground=None)

    def width(html: str) -> float:
        return float(re.findall(r'width="(\d+)"', html)[0])

    assert width(moved(180 - 1e-4)) == pytest.approx(width(moved(0)), abs=1)


def test_a_plan_shows_each_flight(mission: Mission) -> None:
    two = MissionPlan((mission, replace(mission, name="other")), 1, SafetyCheck())
    html = two._repr_html_()
    ElementTree.fromstring(html)
    assert html.count("<svg") == 2 and html.index("flight 1 of 2") < html.index("flight 2 of 2")
    assert "flight 1" not in MissionPlan((mission,), 1, SafetyCheck())._repr_html_()


def test_warnings_of_a_mission_are_shown_as_text(mission: Mission) -> None:
    html = replace(mission, notes=("<b>too & high</b>",), name="<i>")._repr_html_()
    assert "<li>&lt;b&gt;too &amp; high&lt;/b&gt;</li>" in html and "&lt;i&gt;: " in html
    ElementTree.fromstring(html)


@pytest.mark.slow
def test_a_map_without_folium_says_what_to_install(mission: Mission, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "folium", None)
    with pytest.raises(MissingLibraryError, match=r'pip install "uavseg\[explore\]"'):
        mission.explore()


@pytest.mark.slow
def test_the_map_shows_every_kind(mission: Mission) -> None:
    pytest.importorskip("folium")
    pytest.importorskip("mapclassify")
    text = mission.explore().get_root().render()
    for kind in mission.to_geodataframe().dropna(subset="geometry")["kind"].unique():
        assert f'"kind": "{kind}"' in text


@pytest.mark.slow
def test_lines_of_the_map_are_not_filled_areas(mission: Mission) -> None:
    folium = pytest.importorskip("folium")
    pytest.importorskip("mapclassify")
    layers = [one for one in mission.explore()._children.values() if isinstance(one, folium.GeoJson)]
    styles = {one.layer_name: one.style_function(one.data["features"][0]) for one in layers}
    assert styles.keys() >= {"fence", "flight", "photographs", "item", "home"}
    for name in ("fence", "flight", "photographs"):
        assert styles[name]["fill"] is False


@pytest.mark.slow
def test_flights_of_a_plan_share_a_map(mission: Mission) -> None:
    folium = pytest.importorskip("folium")
    pytest.importorskip("mapclassify")
    shown = MissionPlan((mission, mission), 1, SafetyCheck()).explore()
    names = [one.layer_name for one in shown._children.values() if isinstance(one, folium.GeoJson)]
    assert names.count("flight") == 2
