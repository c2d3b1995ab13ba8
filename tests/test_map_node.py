"""The ROS 2 node of the documentation: its body with rosbags' messages, its shell with a stand-in."""

import runpy
import sys
from itertools import pairwise
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

NODE = Path(__file__).resolve().parents[1] / "docs" / "how-to" / "map_node.py"
STORE = get_typestore(Stores.ROS2_HUMBLE)
TYPES = STORE.types


def stamped(frame: str = "map") -> Any:
    return TYPES["std_msgs/msg/Header"](TYPES["builtin_interfaces/msg/Time"](7, 9), frame)


def pose() -> Any:
    place = TYPES["geometry_msgs/msg/Point"](0.0, 0.0, 0.0)
    return TYPES["geometry_msgs/msg/Pose"](place, TYPES["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0))


def room() -> Any:
    """A room of 6.4 x 3.2 m; a wall of 0.4 m divides it but for a door at the top."""
    cells = np.zeros((64, 128), np.int8)
    cells[:40, 70:78] = 100
    cells[:, :4] = -1
    info = TYPES["nav_msgs/msg/MapMetaData"](stamped().stamp, float(np.float32(0.05)), 128, 64, pose())
    return TYPES["nav_msgs/msg/OccupancyGrid"](stamped(), info, cells.reshape(-1))


def empty_pose() -> Any:
    return TYPES["geometry_msgs/msg/PoseStamped"](stamped(""), pose())


def test_the_node_has_under_forty_lines() -> None:
    assert len(NODE.read_text().splitlines()) < 40


@pytest.mark.filterwarnings("ignore:.* unknown cells of occupancy grid are called free")
def test_a_map_in_states_and_a_path_out() -> None:
    message = room()
    states, poses = runpy.run_path(str(NODE))["answer"](message, empty_pose(), (0.5, 0.5), (5.0, 0.5))
    read = STORE.deserialize_cdr(STORE.serialize_cdr(states, states.__msgtype__), states.__msgtype__)
    cells = read.data.reshape(64, 128)
    assert read.header.frame_id == "map" and read.info == message.info
    assert (cells[:32, 70:78] == 100).all() and (cells[:, 8:64] == 0).all()
    places = [(one.pose.position.x, one.pose.position.y) for one in poses]
    assert np.hypot(*np.subtract(places[0], (0.5, 0.5))) < 0.05
    assert np.hypot(*np.subtract(places[-1], (5.0, 0.5))) < 0.05
    for (x0, y0), (x1, y1) in pairwise(places):
        for share in np.linspace(0, 1, 50):
            x, y = x0 + share * (x1 - x0), y0 + share * (y1 - y0)
            assert cells[int(y / 0.05), int(x / 0.05)] == 0
    assert max(y for _, y in places) > 2.0  # through the door
    assert {one.header.stamp.sec for one in poses} == {7}
    for one in poses:
        STORE.serialize_cdr(one, "geometry_msgs/msg/PoseStamped")


class Node:
    """What rclpy.create_node gives, as far as the node uses it."""

    def __init__(self) -> None:
        self.published: dict[str, list[Any]] = {"states": [], "path": []}
        self.errors: list[str] = []
        self.received: Any = None

    def create_publisher(self, kind: Any, topic: str, qos: Any) -> Any:
        return SimpleNamespace(publish=self.published[topic].append)

    def create_subscription(self, kind: Any, topic: str, call: Any, qos: Any) -> None:
        assert topic == "map"
        self.received = call

    def get_logger(self) -> Any:
        return SimpleNamespace(error=self.errors.append)


@pytest.mark.filterwarnings("ignore:.* unknown cells of occupancy grid are called free")
def test_the_shell_publishes_both_and_logs_what_cannot_be_answered(monkeypatch: pytest.MonkeyPatch) -> None:
    node, message = Node(), room()
    blocked = room()
    blocked.data[:] = 100

    def spin(_: Node) -> None:
        for one in (message, blocked):
            node.received(one)

    def module(name: str, **names: Any) -> None:
        made = ModuleType(name)
        vars(made).update(names)
        monkeypatch.setitem(sys.modules, name, made)

    module("rclpy", init=lambda: None, create_node=lambda name: node, spin=spin)
    module("rclpy.qos", QoSProfile=SimpleNamespace, DurabilityPolicy=SimpleNamespace(TRANSIENT_LOCAL=1))
    module("geometry_msgs")
    module("geometry_msgs.msg", PoseStamped=empty_pose)
    classes = {"OccupancyGrid": TYPES["nav_msgs/msg/OccupancyGrid"], "Path": TYPES["nav_msgs/msg/Path"]}
    module("nav_msgs", msg=SimpleNamespace(**classes))
    runpy.run_path(str(NODE), run_name="__main__")
    assert len(node.published["states"]) == len(node.published["path"]) == len(node.errors) == 1
    assert len(node.published["path"][0].poses) >= 2
