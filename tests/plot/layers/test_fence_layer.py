"""Layer of a fence: shapes where they are, each once."""

from dataclasses import replace

import numpy as np
import pytest

from tests.plot.pictures import NORTH_UP, UTM, a_mission
from uavseg.flight.mission.items import FenceCircle, FencePolygon, RallyPoint
from uavseg.plot.layers.mission_layer import FenceLayer
from uavseg.plot.page.page import Frame
from uavseg.raster.grid.geobox import GeoBox

FRAME = Frame(GeoBox((200, 200), NORTH_UP, UTM))
INSIDE = FencePolygon(((44.2, -76.5), (44.201, -76.5), (44.201, -76.499)))
ZONE = FenceCircle(44.2005, -76.4995, 25.0, inclusion=False)
FLIGHT = replace(
    a_mission([(-76.5, 44.2), (-76.5, 44.201)]), fence=(INSIDE, ZONE), rally=(RallyPoint(44.2, -76.5, 30.0),)
)


def test_a_circle_has_its_radius() -> None:
    [ring] = FenceLayer.of([FLIGHT], FRAME).keep_out
    [middle] = FRAME.plot_from_lonlat([ZONE.lon], [ZONE.lat])
    assert np.hypot(*(ring - middle).T) == pytest.approx(ZONE.radius_m, rel=2e-3)


def test_a_polygon_has_its_vertices_and_what_missions_share_is_drawn_once() -> None:
    layer = FenceLayer.of([FLIGHT, FLIGHT], FRAME)
    [ring] = layer.inside
    lat, lon = np.array(INSIDE.vertices).T
    assert np.array_equal(ring, FRAME.plot_from_lonlat(lon, lat))
    assert len(layer.keep_out) == 1 and len(layer.rally) == 1
    assert len(layer.points) == len(INSIDE.vertices) + len(layer.keep_out[0]) + 1


def test_a_mission_without_fence_has_an_empty_layer() -> None:
    layer = FenceLayer.of([a_mission([(-76.5, 44.2), (-76.5, 44.201)])], FRAME)
    assert layer.points.shape == (0, 2) and not layer.inside and not layer.keep_out
