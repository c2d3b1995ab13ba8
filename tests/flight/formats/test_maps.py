"""Missions as .kml and .geojson: drawn where they are flown, readable by GDAL, and refused when damaged."""

import json
import xml.etree.ElementTree as ET
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import geopandas
import pytest

from tests.flight.fences import FENCE, RALLY
from tests.flight.formats.test_kmz import SURVEY, mission_of
from tests.flight.mission_items import waypoint
from tests.flight.test_files import FENCED
from uavseg.errors import MissionError
from uavseg.flight.formats import files
from uavseg.flight.formats.files import write_geojson
from uavseg.flight.formats.kml import kml_losses, write_kml
from uavseg.flight.formats.options import FileOptions
from uavseg.flight.mission.items import (
    FRAME_AMSL,
    FRAME_MISSION,
    FRAME_TERRAIN,
    IMAGE_START,
    HomePosition,
    MissionItem,
)
from uavseg.flight.mission.mission import Mission

KML = "{http://www.opengis.net/kml/2.2}"


def lines(mission: Mission, folder: str) -> list[tuple[str, list[tuple[float, ...]]]]:
    """The altitude mode and the coordinates of the lines in a folder."""
    root = ET.fromstring(write_kml(mission, FileOptions()))
    found = []
    for one in root.iter(f"{KML}Folder"):
        if one.findtext(f"{KML}name") == folder:
            for line in one.iter(f"{KML}LineString"):
                text = line.findtext(f"{KML}coordinates") or ""
                places = [tuple(map(float, place.split(","))) for place in text.split()]
                found.append((line.findtext(f"{KML}altitudeMode") or "", places))
    return found


def test_the_line_of_flight_is_above_the_sea_where_home_is_known() -> None:
    [(mode, places)] = lines(SURVEY, "line of flight")
    assert mode == "absolute"
    assert places == [
        *((8.0, 47.0, 400.0), (8.0, 47.0, 450.0), (8.0, 47.001, 450.0), (8.0, 47.002, 450.0)),
        *((8.001, 47.002, 450.0), (8.001, 47.001, 450.0), (8.0, 47.0, 450.0)),
    ]
    assert kml_losses(SURVEY, FileOptions()) == []


def test_the_line_of_flight_is_above_the_ground_where_home_is_not_known() -> None:
    low = replace(SURVEY, home=HomePosition(47.0, 8.0))
    [(mode, places)] = lines(low, "line of flight")
    assert (mode, places[1][2]) == ("relativeToGround", 50.0)
    assert "altitude of home is not given" in kml_losses(low, FileOptions())[0]


def test_heights_of_another_meaning_begin_another_line() -> None:
    mixed = mission_of(
        waypoint(47.001),
        waypoint(47.002, frame=FRAME_TERRAIN),
        waypoint(47.003, frame=FRAME_TERRAIN),
        waypoint(47.004, frame=FRAME_AMSL, altitude_m=480.0),
    )
    found = lines(mixed, "line of flight")
    assert [mode for mode, _ in found] == ["absolute", "relativeToGround", "absolute"]
    assert [[place[1] for place in places] for _, places in found] == [
        [47.0, 47.0, 47.001],
        [47.001, 47.002, 47.003],
        [47.003, 47.004],
    ]
    assert found[2][1][-1] == (8.0, 47.004, 480.0)


def test_photographs_are_drawn_on_their_legs() -> None:
    assert [places for _, places in lines(SURVEY, "photographs")] == [
        [(8.0, 47.001, 450.0), (8.0, 47.002, 450.0)],
        [(8.001, 47.002, 450.0), (8.001, 47.001, 450.0)],
    ]
    photo = MissionItem(IMAGE_START, FRAME_MISSION, (0.0, 0.0, 1.0, 0.0))
    hover = mission_of(waypoint(), photo, waypoint(47.002))
    points = [
        one["geometry"]["coordinates"]
        for one in json.loads(write_geojson(hover, FileOptions()))["features"]
        if one["properties"]["kind"] == "photographs"
    ]
    assert points == [[8.0, 47.001]]


@pytest.mark.parametrize("suffix", [".kml", ".geojson"])
def test_gdal_reads_every_feature(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"fly{suffix}"
    files.write_mission(FENCED, path)
    layers = geopandas.list_layers(path)["name"].tolist()
    frames = [geopandas.read_file(path, layer=layer) for layer in layers]
    classes = [geometry.geom_type for frame in frames for geometry in frame.geometry if geometry is not None]
    visited = sum(item.has_position for item in FENCED.items)
    assert classes.count("Polygon") == len(FENCE)
    assert classes.count("Point") == visited + len(RALLY) + 1
    assert classes.count("LineString") == 3  # heights above home, the terrain, the sea


def test_polygons_of_geojson_are_counterclockwise() -> None:
    found = json.loads(write_geojson(FENCED, FileOptions()))
    for one in found["features"]:
        if (one["geometry"] or {}).get("type") == "Polygon":
            [ring] = one["geometry"]["coordinates"]
            assert ring[0] == ring[-1]
            pairs = pairwise(ring)
            assert sum((b[0] - a[0]) * (b[1] + a[1]) for a, b in pairs) < 0


def test_an_edited_position_is_read(tmp_path: Path) -> None:
    path = tmp_path / "fly.geojson"
    path.write_bytes(write_geojson(SURVEY, FileOptions()).replace(b"[8.001, 47.002]}", b"[8.0015, 47.002]}"))
    assert files.read_mission(path).items[7].lon == 8.0015


JSON = write_geojson(FENCED, FileOptions()).decode()
XML = write_kml(FENCED, FileOptions()).decode()


@pytest.mark.parametrize(
    ("suffix", "text", "words"),
    [
        (".geojson", "", "not a mission"),
        (".geojson", "[]", "not GeoJSON"),
        (".geojson", '{"type": "FeatureCollection", "features": []}', "holds no mission"),
        (".geojson", '{"type": "FeatureCollection", "features": 5}', "not a mission"),
        (".geojson", JSON.replace('"kind": "home"', '"kind": "hone"'), "holds no mission"),
        (".geojson", JSON.replace('"autopilot": "ardupilot"', '"autopilot": "dji"'), "'dji'"),
        (".geojson", JSON.replace('"number": 3', '"number": 4'), "not 1, 2, 3"),
        (".geojson", JSON.replace('"number": 3', '"number": true'), "expected a number"),
        (".geojson", JSON.replace('"param1": 3.0', '"param1": "x"'), "expected a number"),
        (".geojson", JSON.replace('"altitude_m": 40.25', '"altitude_m": -40.25'), "item 3: altitude"),
        (".geojson", JSON.replace('"Polygon"', '"MultiPolygon"'), "a MultiPolygon"),
        (".geojson", JSON.replace('"inclusion": true', '"inclusion": 1'), "true or false"),
        (".geojson", JSON.replace('"kind": "fence"', '"kind": "fense"', 1), "'fense'"),
        (".geojson", JSON.replace('"kind": "rally"', '"kine": "rally"', 1), "'None'"),
        (".geojson", "[" * 99 + "]" * 99, "nested"),
        (".kml", "", "not well-formed"),
        (".kml", "<kml><Document/></kml>", "holds no mission"),
        (".kml", XML.replace(">ardupilot<", "><"), "autopilot"),
        (".kml", XML.replace("<coordinates>", "<coordinates>a,b "), "longitude,latitude"),
        (".kml", XML.replace("<value>fence<", "<value>fense<", 1), "'fense'"),
        (".kml", XML.replace(">40.25<", ">1e999<"), "expected a number"),
        (".kml", '<!DOCTYPE k [<!ENTITY x SYSTEM "file:///etc/passwd">]>' + XML[38:], "document type"),
    ],
)
def test_damaged_files_are_refused_in_one_line(tmp_path: Path, suffix: str, text: str, words: str) -> None:
    assert text not in (JSON, XML)
    path = tmp_path / f"odd{suffix}"
    path.write_text(text)
    with pytest.raises(MissionError, match=words) as refused:
        files.read_mission(path)
    assert f"odd{suffix}" in str(refused.value) and "\n" not in str(refused.value)


def test_a_file_that_is_too_large_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "large.kml"
    with path.open("wb") as file:
        file.truncate((64 << 20) + 1)
    with pytest.raises(MissionError, match="more than 67,108,864 bytes"):
        files.read_mission(path)


def test_a_name_with_odd_characters_is_written_plainly() -> None:
    named = replace(SURVEY, name="fly <1>\x00\x1b[31m & \ud800")
    root = ET.fromstring(write_kml(named, FileOptions()))
    assert "fly <1>" in (root.findtext(f"{KML}Document/{KML}name") or "")
