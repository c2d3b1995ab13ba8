"""Maps of the ROS package: updates, and the same states, free space and objects as `uavseg classify`."""

import copy
import json
from array import array
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import shapely
import yaml
from click.testing import CliRunner
from hypothesis import given, strategies as st
from numpy.typing import NDArray
from PIL import Image
from uavseg_ros import maps
from uavseg_ros.parameters import NodeParams

from tests.ros.messages import grid, new, room, serialised, update
from uavseg.cli import main
from uavseg.errors import MapError

NEW_GRID = partial(new, "nav_msgs/OccupancyGrid")
NEW_MARKERS = [
    partial(new, f"{name}")
    for name in ("visualization_msgs/MarkerArray", "visualization_msgs/Marker", "geometry_msgs/Point")
]


def noisy(seed: int = 3) -> NDArray[np.int8]:
    """Noisy per cent, a wall, a pole, a ring and unknown cells; the lowest row first."""
    random = np.random.default_rng(seed)
    cells = np.clip(random.normal(22, 9, (120, 170)), 0, 45)
    cells[20:90, 60:66] = np.clip(random.normal(85, 8, (70, 6)), 55, 100)
    cells[30:33, 120:123] = 96
    cells[60:100, 90:140] = 92
    cells[70:90, 100:130] = 8
    cells[:, :25] = -1
    cells[5:110:9, 30:58:4] = -1
    return cells.astype(np.int8)


def real_map(path: Path) -> Any:
    """The message of a trinary map that lies in files, read by Pillow, by the rules of Nav2's map server."""
    about = yaml.safe_load(path.read_text())
    occupancy = 1 - np.asarray(Image.open(path.with_suffix(".pgm"))).astype(np.float32)[::-1] / np.float32(
        255
    )
    cells = np.where(occupancy >= np.float32(about["occupied_thresh"]), 100, -1)
    cells[occupancy <= np.float32(about["free_thresh"])] = 0
    return grid(cells.astype(np.int8), about["resolution"], tuple(about["origin"]))


def saved(folder: Path, cells: NDArray[np.int8], resolution: float, origin: tuple[float, ...]) -> Path:
    """The map as files of mode raw, written here: cells in per cent, 255 unknown, the highest row first."""
    rows, cols = cells.shape
    picture = np.where(cells < 0, 255, cells).astype(np.uint8)[::-1]
    (folder / "map.pgm").write_bytes(b"P5 %d %d 255\n" % (cols, rows) + picture.tobytes())
    (folder / "map.yaml").write_text(
        f"image: map.pgm\nmode: raw\nresolution: {resolution!r}\norigin: {list(origin)}\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    return folder / "map.yaml"


@given(st.data())
def test_updates_are_assignments_to_a_part_of_the_map(data: st.DataObject) -> None:
    cells = data.draw(st.integers(0, 100).map(lambda p: np.full((6, 9), p, np.int8)))
    message, expected = grid(cells), cells.copy()
    for _ in range(3):
        row, col = data.draw(st.integers(0, 5)), data.draw(st.integers(0, 8))
        rows, cols = data.draw(st.integers(1, 6 - row)), data.draw(st.integers(1, 9 - col))
        part = data.draw(st.lists(st.integers(-1, 100), min_size=rows * cols, max_size=rows * cols))
        changed = np.array(part, np.int8).reshape(rows, cols)
        maps.apply_update(message, update(row, col, changed))
        expected[row : row + rows, col : col + cols] = changed
    assert np.array_equal(message.data.reshape(6, 9), expected)
    assert message.header.stamp.sec == 8


@pytest.mark.parametrize("kind", [list, tuple, lambda data: array("b", data), np.array])
def test_data_of_any_kind_is_updated(kind: Any) -> None:
    message = grid(np.zeros((2, 3), np.int8))
    message.data = kind([0, 0, 0, 0, 0, 0])
    maps.apply_update(message, update(1, 1, np.array([[100, -1]], np.int8)))
    assert list(message.data) == [0, 0, 0, 0, 100, -1]


ONE = np.zeros((2, 2), np.int8)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (update(5, 0, ONE), "does not lie in the map, which has 9 x 6 cells"),
        (update(0, 8, ONE), "of 2 x 2 cells from column 8 and row 0 on does not lie"),
        (update(-1, 0, ONE), "row -1 on does not lie"),
        (update(0, -1, ONE), "column -1 and"),
        (update(0, 0, ONE[:0]), "of 2 x 0 cells"),
        (update(0, 0, ONE, "odom"), "in the frame odom is not one of this map, which is in map"),
        (update(0, 0, ONE + 101), "-1 or 0 to 100, not 101"),
        (update(0, 0, ONE - 2), "-1 or 0 to 100, not -2"),
    ],
)
def test_a_wrong_update_is_refused_in_one_line_and_changes_nothing(change: Any, reason: str) -> None:
    message = grid(np.full((6, 9), 3, np.int8))
    before = copy.deepcopy(message)
    with pytest.raises(MapError, match=reason) as raised:
        maps.apply_update(message, change)
    assert "\n" not in str(raised.value)
    assert np.array_equal(message.data, before.data) and message.header == before.header


def test_an_update_that_holds_another_number_of_cells_is_refused() -> None:
    change = update(0, 0, ONE)
    change.data = change.data[:3]
    with pytest.raises(MapError, match="an update of 2 x 2 cells holds 3 values"):
        maps.apply_update(grid(np.zeros((6, 9), np.int8)), change)


@pytest.mark.parametrize("origin", [(0.0, 0.0, 0.0), (-3.5, 12.25, 0.7)])
def test_states_free_space_and_objects_are_those_of_the_command(
    tmp_path: Path, origin: tuple[float, float, float]
) -> None:
    message = grid(noisy(), 0.05, origin)
    path = saved(tmp_path, noisy(), message.info.resolution, origin)
    markers = compare_with_command(path, message, tmp_path)
    assert len(markers) == 3
    found = maps.classify_map(maps.read_map(message), NodeParams())
    assert found.unknown_in_free and not found.warnings


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tb3_sandbox", "depot"])
def test_a_real_map_has_the_answers_of_the_command(shared_data: Path, tmp_path: Path, name: str) -> None:
    message = real_map(shared_data / "maps" / f"{name}.yaml")
    assert len(compare_with_command(shared_data / "maps" / f"{name}.yaml", message, tmp_path)) > 5


def compare_with_command(path: Path, message: Any, folder: Path) -> list[Any]:
    """Compare the answers to a message with those of `uavseg classify` of its file; return its objects."""
    states, objects = folder / "states.tif", folder / "objects.geojson"
    words = ["classify", str(path), "-o", str(states), "--objects", str(objects), "--min-area", "4px"]
    ran = CliRunner().invoke(main, words)
    assert ran.exit_code == 0, ran.output
    with rasterio.open(states) as file:
        expected = file.read(1)[::-1]

    params = NodeParams(min_object_cells=4)
    found = maps.classify_map(maps.read_map(message), params)
    answer = serialised(maps.states_message(found, message, NEW_GRID))
    cells = answer.data.reshape(expected.shape)
    assert np.array_equal(cells, np.array([-2, 0, -1, 100])[expected])
    assert answer.header == message.header and answer.info == message.info

    free = serialised(maps.free_space_message(found, params, message, NEW_GRID)).data.reshape(expected.shape)
    own = (message.data >= 0) & (message.data <= 49)  # up to a probability of 0.498
    assert np.array_equal(free, np.where((expected == 1) & own.reshape(expected.shape), 0, 100))

    markers = serialised(maps.objects_message(found, message, *NEW_MARKERS)).markers
    assert markers[0].action == markers[0].DELETEALL
    features = json.loads(objects.read_text())["features"]
    assert [one.id for one in markers[1:]] == [feature["properties"]["id"] for feature in features]
    for marker, feature in zip(markers[1:], features, strict=True):
        assert marker.header == message.header and marker.type == marker.LINE_LIST
        ends = [(point.x, point.y) for point in marker.points]
        edges = [shapely.LineString(pair) for pair in zip(ends[::2], ends[1::2], strict=True)]
        polygon = shapely.geometry.shape(feature["geometry"])
        assert shapely.hausdorff_distance(shapely.union_all(edges), polygon.boundary) < 1e-6
        assert shapely.union_all(edges).length == pytest.approx(polygon.boundary.length, rel=1e-6)
        assert float(marker.text) == pytest.approx(polygon.area, rel=1e-3)
    return markers[1:]


def test_a_map_of_three_values_keeps_its_states_but_for_what_the_result_warns_of() -> None:
    cells = room()
    message = grid(cells)
    found = maps.classify_map(maps.read_map(message), NodeParams())
    answer = maps.states_message(found, message, NEW_GRID).data.reshape(cells.shape)
    assert np.array_equal(answer == 100, cells == 100)
    free = maps.free_space_message(found, NodeParams(), message, NEW_GRID).data.reshape(cells.shape)
    assert np.array_equal(free == 0, cells == 0)


def test_messages_of_rclpy_are_answered_with_arrays_as_it_has_them() -> None:
    message = grid(room())
    message.data = array("b", message.data.tobytes())
    found = maps.classify_map(maps.read_map(message), NodeParams())
    answer = maps.states_message(found, message, NEW_GRID)
    assert isinstance(answer.data, array) and answer.data.typecode == "b"
    assert answer.data.count(100) == (room() == 100).sum()


@pytest.mark.parametrize(("free", "occupied"), [(0.2, 0.6), (0.29, 0.3), (0.07, 0.57), (0.5, 0.9)])
def test_limits_of_the_node_are_those_of_the_command(tmp_path: Path, free: float, occupied: float) -> None:
    path = saved(tmp_path, noisy(), 0.05, (0.0, 0.0, 0.0))
    states = tmp_path / "states.tif"
    limits = ["--free-below", f"{free}", "--occupied-above", f"{occupied}"]
    ran = CliRunner().invoke(main, ["classify", str(path), "-o", str(states), "-q", *limits])
    assert ran.exit_code == 0, ran.output
    params = NodeParams(free_below=free, occupied_above=occupied)
    found = maps.classify_map(maps.read_map(grid(noisy())), params)
    with rasterio.open(states) as file:
        assert np.array_equal(found.states, file.read(1))
    free_space = maps.free_space_message(found, params, grid(noisy()), NEW_GRID)
    doubtful = found.unknown_in_free + found.occupied_in_free
    assert (free_space.data == 0).sum() == found.cells[1] - doubtful
