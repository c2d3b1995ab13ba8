"""The lifecycle node with stand-ins for rclpy and tf2: transitions, topics, and what goes wrong."""

import importlib
import re
import sys
from array import array
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml

from tests.ros import stand_ins
from tests.ros.messages import goal, grid, room, transform, update
from tests.ros.stand_ins import TransitionCallbackReturn
from uavseg.errors import MapError

PAGE = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "ros.md"
CONFIG = Path(__file__).resolve().parents[2] / "ros" / "uavseg_ros" / "config" / "uavseg_ros.yaml"
SUCCESS, STATE = TransitionCallbackReturn.SUCCESS, SimpleNamespace(label="", state_id=0)
New = Callable[..., Any]


@pytest.fixture
def new_node(monkeypatch: pytest.MonkeyPatch) -> New:
    """Make the node with some parameters set."""
    stand_ins.install(monkeypatch)
    module = importlib.import_module("uavseg_ros.node")
    return lambda **overrides: module.MapNode(overrides=overrides)


@pytest.fixture
def active(new_node: New) -> Any:
    """A node that is active and knows where the robot is."""
    node = new_node()
    assert node.on_configure(STATE) == SUCCESS
    assert node.on_activate(STATE) == SUCCESS
    node._buffer.known["base_link"] = transform(0.5, 0.5, stamp=99.9)
    return node


def live_map() -> Any:
    """A map as rclpy has it, with its data in an array.array."""
    message = grid(room())
    message.data = array("b", message.data.tobytes())
    return message


def receive(node: Any, topic: str, message: Any) -> None:
    node.subscriptions[topic].call(message)


def sent(node: Any, topic: str) -> list[Any]:
    return node.publishers[topic].messages


def cells(message: Any) -> Any:
    return np.array(message.data, np.int8).reshape(message.info.height, message.info.width)


def warnings_of(node: Any) -> list[str]:
    return [text for _, text in node.log]


def test_each_parameter_is_in_the_yaml_file_with_its_default(new_node: New) -> None:
    given = yaml.safe_load(CONFIG.read_text())["/**"]["ros__parameters"]
    declared = new_node().parameters
    assert given == declared
    assert {name: type(value) for name, value in given.items()} == {
        name: type(value) for name, value in declared.items()
    }


def test_map_and_states_are_reliable_and_transient_local(new_node: New) -> None:
    node = new_node()
    node.on_configure(STATE)
    entities = {**node.publishers, **node.subscriptions}
    del entities["/tf"]
    assert {entity.qos.reliability for entity in entities.values()} == {"reliable"}
    kept = {name for name, entity in entities.items() if entity.qos.durability == "transient local"}
    assert kept == {"map", "states", "free_space", "objects"}
    assert set(entities) - kept == {"map_updates", "goal_pose", "path"}
    volatile = new_node(map_transient_local=False)
    volatile.on_configure(STATE)
    assert volatile.subscriptions["map"].qos.durability == "volatile"


def test_the_documentation_has_each_topic_with_its_type_and_durability(new_node: New) -> None:
    node = new_node()
    node.on_configure(STATE)
    del node.subscriptions["/tf"]
    named = {"in": node.subscriptions, "out": node.publishers}
    expected = {
        (way, topic, entity.kind, entity.qos.durability)
        for way, several in named.items()
        for topic, entity in several.items()
    }
    part = PAGE.read_text().split("### Topics")[1].split("\n### ")[0]
    row = r"^\| (in|out) \| `(\w+)` \| `([\w/]+)` \| ([\w ]+) \|"
    assert set(re.findall(row, part, re.MULTILINE)) == expected


def test_a_life(new_node: New) -> None:
    node = new_node(update_period=2)
    assert node.on_configure(STATE) == SUCCESS
    assert [timer.period for timer in node.timers] == [2.0]
    receive(node, "map", live_map())  # before the activation
    receive(node, "goal_pose", goal(5, 0.5))
    assert warnings_of(node) == ["a goal is left out, because the node is not active"]
    assert not sent(node, "states")

    assert node.on_activate(STATE) == SUCCESS
    node.timers[0].call()
    assert np.array_equal(cells(sent(node, "states")[0]), room())
    assert np.array_equal(cells(sent(node, "free_space")[0]) == 0, room() == 0)
    assert len(sent(node, "objects")[0].markers) == 2 and not sent(node, "path")

    node._buffer.known["base_link"] = transform(0.5, 0.5, stamp=99.9)
    receive(node, "goal_pose", goal(5, 0.5))
    [path] = sent(node, "path")
    assert path.header.frame_id == "map" and path.header.stamp.sec == 100
    places = [(one.pose.position.x, one.pose.position.y) for one in path.poses]
    assert np.hypot(*np.subtract(places[0], (0.5, 0.5))) < 0.05
    assert np.hypot(*np.subtract(places[-1], (5.0, 0.5))) < 0.05

    publishers = dict(node.publishers)
    assert node.on_deactivate(STATE) == SUCCESS
    assert [len(one.poses) for one in publishers["path"].messages[1:]] == [0]  # nobody follows the old one
    receive(node, "map_updates", update(0, 20, np.full((30, 2), 100, np.int8)))
    receive(node, "goal_pose", goal(5, 0.5))
    assert warnings_of(node).count("a goal is left out, because the node is not active") == 2
    node.timers[0].call()
    assert len(publishers["states"].messages) == 1
    assert node.on_activate(STATE) == SUCCESS
    node.timers[0].call()
    assert (cells(publishers["states"].messages[1])[:30, 20:22] == 100).all()
    assert len(publishers["path"].messages) == 2  # the goal is forgotten

    assert node.on_deactivate(STATE) == SUCCESS and node.on_cleanup(STATE) == SUCCESS
    assert not node.publishers and not node.subscriptions and not node.timers
    assert node.on_configure(STATE) == SUCCESS and node.on_activate(STATE) == SUCCESS
    node.timers[0].call()
    assert not sent(node, "states")  # the map is forgotten
    assert node.on_shutdown(STATE) == SUCCESS and not node.subscriptions
    assert node.on_shutdown(STATE) == SUCCESS and node.on_error(STATE) == SUCCESS


def test_states_are_published_where_no_path_is_found(active: Any) -> None:
    closed = live_map()
    closed.data = array("b", np.where(room()[:1] == 100, 100, room()).astype(np.int8).tobytes())
    receive(active, "goal_pose", goal(5, 0.5))
    assert warnings_of(active) == ["no path yet: no map has come"]
    receive(active, "map", closed)
    assert len(sent(active, "states")) == 1
    assert "no path: no path leads from the start to the goal" in warnings_of(active)[-1]
    assert [len(one.poses) for one in sent(active, "path")] == [0]
    receive(active, "map", live_map())
    assert len(sent(active, "states")) == 2 and len(sent(active, "path")[-1].poses) > 2


def test_a_map_without_states_is_said_and_planned_over(active: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any) -> None:
        raise MapError("the reason")

    monkeypatch.setattr(sys.modules["uavseg_ros.maps"], "classify_map", refuse)
    receive(active, "goal_pose", goal(5, 0.5))
    receive(active, "map", live_map())
    assert "no states: the reason" in warnings_of(active) and not sent(active, "states")
    assert sent(active, "path")[0].poses


def test_updates_are_answered_together_and_the_path_follows_them(active: Any) -> None:
    receive(active, "map", live_map())
    receive(active, "goal_pose", goal(5, 0.5))
    door = np.full((12, 8), 100, np.int8)
    for row in (40, 52):
        receive(active, "map_updates", update(row, 70, door))
    assert len(sent(active, "states")) == 1
    for _ in range(3):
        active.timers[0].call()
    assert len(sent(active, "states")) == 2
    assert (cells(sent(active, "states")[1])[:, 70:78] == 100).all()
    assert sent(active, "states")[1].header.stamp.sec == 8
    assert [len(one.poses) > 0 for one in sent(active, "path")] == [True, False]
    receive(active, "map_updates", update(52, 70, door - 100))
    active.timers[0].call()
    assert [len(one.poses) > 0 for one in sent(active, "path")] == [True, False, True]


def test_without_replan_a_goal_is_answered_once(new_node: New) -> None:
    node = new_node(replan=False)
    node.on_configure(STATE)
    node.on_activate(STATE)
    node._buffer.known["base_link"] = transform(0.5, 0.5)
    receive(node, "goal_pose", goal(5, 0.5))
    assert not sent(node, "path")
    for _ in range(3):
        receive(node, "map", live_map())
    assert [len(one.poses) > 0 for one in sent(node, "path")] == [True]


def test_a_map_of_another_size_takes_the_place_of_the_first(active: Any) -> None:
    receive(active, "map", live_map())
    larger = grid(np.pad(room(), ((0, 40), (30, 0))), origin=(-1.5, 0, 0))
    receive(active, "map", larger)
    assert np.array_equal(cells(sent(active, "states")[-1]), cells(larger))
    receive(active, "map_updates", update(100, 150, np.full((4, 8), 100, np.int8)))
    receive(active, "map", live_map())
    receive(active, "map_updates", update(100, 150, np.full((4, 8), 100, np.int8)))
    assert "update refused" in warnings_of(active)[-1]
    active.timers[0].call()
    assert np.array_equal(cells(sent(active, "states")[-1]), room())


def test_a_goal_in_another_frame_is_transformed(active: Any) -> None:
    receive(active, "map", live_map())
    active._buffer.known["odom"] = transform(4.0, 1.0, np.pi / 2, child="odom", stamp=99.9)
    receive(active, "goal_pose", goal(0.5, -1.0, -np.pi / 2, frame="odom"))
    last = sent(active, "path")[-1].poses[-1].pose
    assert np.hypot(last.position.x - 5.0, last.position.y - 1.5) < 0.05
    assert (last.orientation.z, last.orientation.w) == pytest.approx((0, 1), abs=1e-9)


def test_a_goal_ahead_of_the_robot_stays_where_it_was_while_the_robot_moves(active: Any) -> None:
    receive(active, "map", live_map())
    receive(active, "goal_pose", goal(1.5, 0.0, frame="base_link"))
    active._buffer.known["base_link"] = transform(1.0, 1.0, stamp=99.9)
    receive(active, "map", live_map())
    moved = grid(room())
    moved.header.frame_id = "other_map"
    first, second = (path.poses[-1].pose.position for path in sent(active, "path"))
    assert (first.x, first.y) == (second.x, second.y)
    assert np.hypot(first.x - 2.0, first.y - 0.5) < 0.05
    active._buffer.known["base_link"].header.frame_id = "other_map"
    receive(active, "map", moved)
    third = sent(active, "path")[-1]
    assert third.header.frame_id == "other_map"
    assert np.hypot(third.poses[-1].pose.position.x - 2.5, third.poses[-1].pose.position.y - 1.0) < 0.05


def test_what_tf_does_not_know_is_named_once_and_tried_again(active: Any) -> None:
    receive(active, "map", live_map())
    del active._buffer.known["base_link"]
    receive(active, "goal_pose", goal(5, 0.5))
    for _ in range(4):
        active.timers[0].call()
    [warning] = warnings_of(active)
    assert warning.startswith("no path yet: no transform from base_link to map (")
    assert len(sent(active, "states")) == 1
    assert [len(one.poses) for one in sent(active, "path")] == [0]
    active._buffer.known["base_link"] = transform(0.5, 0.5, stamp=90.0)
    active.timers[0].call()
    assert "is 10.0 s old" in warnings_of(active)[-1]
    active._buffer.known["base_link"] = transform(0.5, 0.5, stamp=99.9)
    active.timers[0].call()
    active.timers[0].call()
    assert [len(one.poses) > 0 for one in sent(active, "path")] == [False, True]


@pytest.mark.parametrize(
    ("asked", "reason"),
    [
        (goal(50, 0.5), "no path: the goal 50,0.5 lies outside of the map"),
        (goal(3.7, 0.5), "no path: the start lies in region 1 and the goal in no region"),
        (goal(5, 0.5, frame=""), "no path: the goal has no frame_id in its header"),
        (goal(np.nan, 0.5), "no path: a place is finite x, y and z, not nan"),
    ],
)
def test_a_wrong_goal_is_one_line_and_an_empty_path(active: Any, asked: Any, reason: str) -> None:
    receive(active, "map", live_map())
    receive(active, "goal_pose", goal(5, 0.5))
    receive(active, "goal_pose", asked)
    active.timers[0].call()
    [warning] = warnings_of(active)
    assert warning.startswith(reason) and "\n" not in warning and "--" not in warning
    assert [len(one.poses) > 0 for one in sent(active, "path")] == [True, False]
    receive(active, "goal_pose", asked)
    assert warnings_of(active) == [warning, warning]  # said of each goal
    receive(active, "goal_pose", goal(5, 0.5))
    assert len(sent(active, "path")[-1].poses) > 2


def test_a_wrong_map_is_refused_and_the_last_one_stays(active: Any) -> None:
    receive(active, "map_updates", update(0, 0, np.zeros((2, 2), np.int8)))
    receive(active, "map", live_map())
    wrong = live_map()
    wrong.data = wrong.data[:-1]
    for _ in range(2):
        receive(active, "map", wrong)
    early, refused = warnings_of(active)
    assert early == "an update came before the map, and is left out"
    assert refused.startswith("map refused: an OccupancyGrid message of 128 x 64 cells holds as many values")
    receive(active, "goal_pose", goal(5, 0.5))
    assert len(sent(active, "states")) == 1 and sent(active, "path")[0].poses
    outside = update(63, 0, np.zeros((2, 2), np.int8))
    for topic, message in [("map", live_map()), ("map", wrong), ("map_updates", outside)] * 2:
        receive(active, topic, message)
    receive(active, "map_updates", update(0, 0, np.zeros((2, 2), np.int8)))
    receive(active, "map_updates", outside)
    said = [text.split(":")[0] for text in warnings_of(active)[2:]]
    assert said == ["map refused", "update refused", "map refused", "update refused"]


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        ({"clearance": -1.0}, "a clearance in metres is finite and not negative, not -1"),
        ({"clearance": "wide"}, "clearance is a number, not 'wide'"),
        ({"clearance": True}, "clearance is a number, not True"),
        ({"smooth": 1}, "smooth is true or false, not 1"),
        ({"min_object_cells": 2.5}, "min_object_cells is a whole number, not 2.5"),
        ({"min_object_cells": -1}, "min_object_cells is not negative, not -1"),
        ({"base_frame": ""}, "base_frame is the name of a frame"),
        ({"free_below": 0.6}, "0 <= free below < occupied above <= 1, got 0.6 and 0.502"),
        ({"passable_below": 1.5}, "got"),
        ({"path_spacing": 1e-6}, "path_spacing is 0 or at least 0.001 m, not 1e-06"),
        ({"path_spacing": float("inf")}, "path_spacing is 0 or at least 0.001 m, not inf"),
        ({"transform_tolerance": 0}, "transform_tolerance is a number of seconds above 0, not 0"),
        ({"update_period": float("nan")}, "update_period is a number of seconds above 0, not nan"),
    ],
)
def test_a_wrong_parameter_fails_the_configuration_in_one_line(
    new_node: New, wrong: dict[str, Any], reason: str
) -> None:
    node = new_node(**wrong)
    assert node.on_configure(STATE) == TransitionCallbackReturn.FAILURE
    [(level, text)] = node.log
    assert level == "error" and text.startswith("not configured: ") and reason in text and "\n" not in text
    assert not node.publishers and not node.subscriptions
    node.parameters = new_node().parameters
    assert node.on_configure(STATE) == SUCCESS


@pytest.mark.parametrize("end", [None, KeyboardInterrupt, stand_ins.ExternalShutdownException])
def test_the_program_ends_without_a_traceback(
    new_node: New, monkeypatch: pytest.MonkeyPatch, end: type[BaseException] | None
) -> None:
    module, nodes = sys.modules["uavseg_ros.node"], []

    def spin(node: Any) -> None:
        nodes.append(node)
        if end is not None:
            raise end

    monkeypatch.setattr(module.rclpy, "spin", spin)
    module.main([])
    assert nodes[0].log == [("info", "destroyed")]
