"""Layer of a mission: arrows, numbers, positions."""

from pathlib import Path

import numpy as np
import pytest

from tests.plot.pictures import NORTH_UP, UTM, a_mission, colored, middle_of, write
from uavseg.flight.formats import files
from uavseg.flight.mission.items import HomePosition, MissionItem
from uavseg.flight.mission.mission import Mission
from uavseg.plot.layers import mission_layer
from uavseg.plot.page.page import Frame
from uavseg.plot.preview import preview
from uavseg.raster.grid.geobox import GeoBox


def test_arrows_point_along_long_legs_only() -> None:
    heads = mission_layer.arrow_heads(np.array([[0.0, 0], [100, 0], [100, 5], [100, 90]]), 20, 4)
    tips, tails = heads[:, 0], heads[:, 1:].mean(axis=1)
    assert np.allclose((tips - tails) / 4, [[1, 0], [0, 1]])
    assert np.allclose(heads[:, 0] * 0.4 + tails * 0.6, [[50, 0], [100, 47.5]])


def test_numbers_keep_apart_and_name_the_first() -> None:
    path = np.column_stack([np.arange(200.0), np.zeros(200)])
    chosen = mission_layer.choose_numbered(path, np.arange(200), 15)
    assert chosen[0] == 1 and np.diff(path[chosen, 0]).min() >= 15


@pytest.mark.parametrize("suffix", [".plan", ".waypoints"])
def test_a_mission_is_drawn_where_it_flies(suffix: str, tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", np.full((200, 200), 128, np.uint8))
    box = GeoBox((200, 200), NORTH_UP, UTM)
    lon, lat = box.lonlat_from_xy(*box.xy_from_pixel(np.array([20, 30, 60]), np.array([20, 70, 40])))
    flight = tmp_path / f"m{suffix}"
    files.write_mission(a_mission(list(zip(lon.tolist(), lat.tolist(), strict=True))), flight)
    mask = colored(preview(raster, tmp_path / "a.png", mission=flight, width_px=500))
    body = mask[: int(0.8 * len(mask))]  # without the legend
    row, col = middle_of(body)
    assert 0.1 < row < 0.45 and 0.1 < col < 0.4


def test_lines_with_photographs_and_single_photographs_are_known() -> None:
    waypoint = [MissionItem(16, 3, (0.0, 0.0, 0.0, None), 44.2, -76.5 + 0.001 * k, 50.0) for k in range(5)]
    start, stop = MissionItem(206, 2, (9.0, 0.0, 1.0, 0.0)), MissionItem(206, 2, (0.0, 0.0, 0.0, 0.0))
    shot, back = MissionItem(2000, 2, (0.0, 0.0, 1.0, 0.0)), MissionItem(20, 2)
    up = MissionItem(22, 3, (0.0, 0.0, 0.0, None), 0.0, 0.0, 50.0)
    items = (up, waypoint[0], start, waypoint[1], waypoint[2], stop, waypoint[3], shot, waypoint[4], back)
    frame = Frame(GeoBox((200, 200), NORTH_UP, UTM))
    layer = mission_layer.MissionLayer.of(Mission(HomePosition(44.2, -76.5), items), frame)
    assert layer.is_line.tolist() == [False, False, True, True, False, False, False]
    assert np.flatnonzero(layer.has_shot).tolist() == [2, 5]  # where the line starts, and the single one
    assert layer.returns and len(layer.path) == 8
