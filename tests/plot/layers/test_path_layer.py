"""Layer of a path: from memory, GeoJSON or a mission in the same position."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import uavseg
from tests.plot.layers.maps import BOX, LOCAL, beliefs, rgb, states, write
from uavseg.errors import MissionError, PathError
from uavseg.flight.formats import files
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.planning.along import fly_along
from uavseg.plot.layers import mission_layer
from uavseg.plot.page.page import Frame
from uavseg.plot.preview import preview
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.read.dataset import Dataset


def planned_path(box: GeoBox) -> Any:
    (x, x2), (y, y2) = box.xy_from_pixel(np.array([20.5, 90.5]), np.array([10.5, 60.5]))
    dataset = Dataset.of_values(np.where(states() == 0, 0.1, beliefs()).astype(np.float32), box, "map")
    return uavseg.path(dataset, (0, 0.45), (x, y), (x2, y2))


@pytest.mark.parametrize("box", [BOX, LOCAL], ids=["on the globe", "local"])
def test_a_path_from_a_file_lies_where_the_planned_path_lies(box: GeoBox, tmp_path: Path) -> None:
    from uavseg.occupancy.paths.path_text import path_to_geojson

    planned, frame = planned_path(box), Frame(box)
    (tmp_path / "path.geojson").write_text(path_to_geojson(planned))
    [here] = mission_layer.PathLayer.of(planned, frame).lines
    layer = mission_layer.PathLayer.of(tmp_path / "path.geojson", frame)
    assert np.allclose(layer.lines[0], here, atol=0.01) and layer.length_m == pytest.approx(planned.length_m)
    assert np.allclose(here[0], frame.plot_from_xy([box.xy_from_pixel(20.5, 10.5)])[0])


@pytest.mark.parametrize("box", [BOX, LOCAL], ids=["on the globe", "local"])
def test_views_lie_where_their_ways_end(box: GeoBox, tmp_path: Path) -> None:
    from uavseg.jobs.maps.explore import NextViews, View

    way = planned_path(box)
    place = (float(way.xy[-1, 0]), float(way.xy[-1, 1]))
    view = View(uavseg.Pose(*place, heading_rad=1.0), way, bits=1.0, frontier_m=2.0, score=1.0)
    (tmp_path / "views.geojson").write_text(NextViews((view,), box, ()).to_geojson())
    layer = mission_layer.PathLayer.of(tmp_path / "views.geojson", Frame(box))
    assert np.allclose(layer.views, layer.lines[0][-1:], atol=0.01)
    assert layer.headings == (pytest.approx(np.degrees(1.0), abs=1e-3),)
    drawn = write(tmp_path / "map.tif", beliefs(), box)
    preview(drawn, tmp_path / "out.png", path=tmp_path / "views.geojson")


@pytest.mark.parametrize("suffix", [".plan", ".waypoints"])
def test_a_path_may_be_a_mission(suffix: str, tmp_path: Path) -> None:
    from uavseg.occupancy.paths.path_text import path_lonlat

    planned, frame = planned_path(BOX), Frame(BOX)
    lon, lat = path_lonlat(planned)
    mission = fly_along(lon, lat, PlanParams(10.0, speed_m_s=3.0), (float(lat[0]), float(lon[0]), 0.0))
    files.write_mission(mission, tmp_path / f"path{suffix}")
    [line] = mission_layer.PathLayer.of(tmp_path / f"path{suffix}", frame).lines
    assert np.allclose(line, mission_layer.PathLayer.of(planned, frame).lines[0], atol=0.05)


@pytest.mark.slow
def test_a_path_is_white_on_free_ground_with_its_ends_in_colour(tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", beliefs())
    plain, drawn = (
        preview(raster, tmp_path / f"{n}.png", path=p) for n, p in enumerate((None, planned_path(BOX)))
    )
    picture = rgb(drawn)[: int(0.85 * len(rgb(drawn)))]
    assert (np.ptp(picture, axis=2) > 60).sum() > 50
    assert rgb(plain).shape == rgb(drawn).shape


def test_files_without_a_path_are_refused(tmp_path: Path) -> None:
    frame = Frame(BOX)
    point = {"type": "Feature", "properties": {}, "geometry": {"type": "Point", "coordinates": [1, 2]}}
    line = {"type": "LineString", "coordinates": [[4e5, 5e6], [4e5, 5e6 - 9]]}
    for text in ("", "{}", "[]", json.dumps({"features": []}), json.dumps({"features": [point]})):
        (tmp_path / "no.geojson").write_text(text)
        with pytest.raises(PathError, match="no line of a path"):
            mission_layer.PathLayer.of(tmp_path / "no.geojson", frame)
    (tmp_path / "local.geojson").write_text(json.dumps({"features": [{"properties": {}, "geometry": line}]}))
    with pytest.raises(PathError, match="local coordinates"):
        mission_layer.PathLayer.of(tmp_path / "local.geojson", frame)
    with pytest.raises(PathError, match="there is no file"):
        mission_layer.PathLayer.of(tmp_path / "missing.geojson", frame)
    with pytest.raises(MissionError):
        mission_layer.PathLayer.of(tmp_path / "missing.plan", frame)
