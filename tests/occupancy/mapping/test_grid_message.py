"""Grids from and to messages: there and back is the same, by hand, with rosbags' types and without."""

import math
from array import array
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from affine import Affine
from hypothesis import given, strategies as st

from uavseg.errors import MapError
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.raster.grid.geobox import GeoBox

CELLS = [-1, 0, 100, 20, 0, 77]  # two rows of three, the lowest first


def message(cells: Any = None, width: int = 3, height: int = 2, yaw: float = 0.0, **how: Any) -> Any:
    place = SimpleNamespace(x=1.0, y=-2.0, z=0.0)
    turn = SimpleNamespace(x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2))
    origin = SimpleNamespace(position=place, orientation=turn)
    info = SimpleNamespace(**({"resolution": 0.5, "width": width, "height": height, "origin": origin} | how))
    return SimpleNamespace(info=info, data=array("b", CELLS) if cells is None else cells)


def ros_message(ros: int) -> Any:
    """A message of rosbags' types."""
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE).types
    time = types["builtin_interfaces/msg/Time"](0, 0)
    first = {"seq": 0} if ros == 1 else {}
    pose = types["geometry_msgs/msg/Pose"](
        types["geometry_msgs/msg/Point"](1.0, -2.0, 0.0),
        types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
    )
    return types["nav_msgs/msg/OccupancyGrid"](
        types["std_msgs/msg/Header"](**first, stamp=time, frame_id="map"),
        types["nav_msgs/msg/MapMetaData"](time, 0.5, 3, 2, pose),
        np.array(CELLS, np.int8),
    )


def test_row_0_of_a_message_is_the_lowest() -> None:
    grid = OccupancyGrid.from_message(message())
    np.testing.assert_allclose(grid.probabilities, [[0.2, 0.0025, 0.77], [0.5, 0.0025, 0.9975]], atol=1e-4)
    assert grid.probabilities[1, 0] == 0.5
    x, y = grid.geobox.xy_from_pixel(2, 0)  # the lower left corner
    assert (float(x), float(y)) == (1.0, -2.0)


@given(
    st.integers(1, 6).flatmap(
        lambda rows: st.integers(1, 6).flatmap(
            lambda cols: st.tuples(
                st.just((rows, cols)),
                st.lists(
                    st.integers(-1, 100).filter(lambda c: c != 50), min_size=rows * cols, max_size=rows * cols
                ),
            )
        )
    ),
    st.sampled_from([0.0, 0.3, -2.0, math.pi]),
)
def test_there_and_back_is_the_same(found: tuple[tuple[int, int], list[int]], yaw: float) -> None:
    (rows, cols), cells = found
    back = OccupancyGrid.from_message(message(cells, cols, rows, yaw)).to_message()
    assert list(back.data) == cells
    assert (back.info.width, back.info.height) == (cols, rows)
    assert back.info.resolution == pytest.approx(0.5, rel=1e-12)
    assert (back.info.origin.position.x, back.info.origin.position.y) == pytest.approx((1.0, -2.0), abs=1e-9)
    turn = back.info.origin.orientation
    assert math.cos(2 * math.atan2(turn.z, turn.w) - yaw) == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("kind", [list, tuple, lambda r: np.array(r, np.int8), lambda r: array("b", r)])
def test_cells_may_be_of_any_kind_that_ros_has(kind: Any) -> None:
    assert list(OccupancyGrid.from_message(message(kind(CELLS))).to_message().data) == CELLS


@pytest.mark.parametrize("ros", [1, 2])
def test_messages_of_rosbags_are_filled_and_can_be_serialised(ros: int) -> None:
    from rosbags.typesys import Stores, get_typestore

    grid = OccupancyGrid.from_message(ros_message(ros))
    empty = ros_message(ros)
    empty.data, empty.info.width = np.zeros(0, np.int8), 0
    empty.header.frame_id = "kept"
    filled = grid.to_message(empty)
    assert filled is empty and filled.header.frame_id == "kept"
    types = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    name = "nav_msgs/msg/OccupancyGrid"
    content = types.serialize_ros1(filled, name) if ros == 1 else types.serialize_cdr(filled, name)
    read = types.deserialize_ros1(content, name) if ros == 1 else types.deserialize_cdr(content, name)
    assert read.data.tolist() == CELLS and (read.info.width, read.info.height) == (3, 2)


def test_the_rows_of_a_map_that_run_upwards_stay_where_they_are() -> None:
    upwards = GeoBox((2, 3), Affine(0.5, 0, 1.0, 0, 0.5, -2.0), None)
    p = np.array([[0.5, 0.1, 0.9], [0.2, 0.1, 0.77]])
    found = OccupancyGrid.from_probabilities(p, upwards).to_message()
    assert list(found.data) == [-1, 10, 90, 20, 10, 77]
    assert (found.info.origin.position.x, found.info.origin.position.y) == (1.0, -2.0)


def test_cells_that_are_not_square_have_no_message() -> None:
    grid = OccupancyGrid(GeoBox((2, 3), Affine(0.5, 0, 1.0, 0, -0.4, -2.0), None))
    with pytest.raises(MapError, match="square cells"):
        grid.to_message()


def tilted() -> Any:
    found = message()
    found.info.origin.orientation.x = 0.3
    return found


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (message([0] * 5), "3 x 2 cells holds as many values; this one holds 5"),
        (message([0, 0, 0, 0, 0, 101]), "are -1 or 0 to 100, not 101"),
        (message([0, 0, 0, 0, 0, -2]), "are -1 or 0 to 100, not -2"),
        (message([0.5] * 6), "one row of whole numbers"),
        (message("abc"), "one row of whole numbers, not 'abc'"),
        (message(width=0), "info.width of an OccupancyGrid message is a number of cells above 0, not 0"),
        (message(height="a"), "info.height of an OccupancyGrid message is a number, not 'a'"),
        (message(width=10**6, height=10**6), "at most 100,000,000"),
        (message(resolution=0.0), "metres per cell, a number above 0, not 0"),
        (message(resolution=math.nan), "metres per cell"),
        (tilted(), "tilts the map by .* degrees out of the plane"),
        (message(origin=5), "has no info.origin.position.x"),
        (5, "this one, 'int', has no info.resolution"),
    ],
)
def test_what_is_no_map_is_refused(given: Any, text: str) -> None:
    with pytest.raises(MapError, match=text):
        OccupancyGrid.from_message(given)


def test_only_a_message_is_filled() -> None:
    with pytest.raises(MapError, match=r"has no info\.origin"):
        OccupancyGrid.empty((2, 3), 0.5).to_message(SimpleNamespace())
