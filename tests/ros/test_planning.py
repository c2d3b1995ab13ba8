"""Paths of the ROS package: those of `uavseg path`, in any frame, as messages."""

import json
import math
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given, strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from uavseg_ros import maps, planning
from uavseg_ros.parameters import NodeParams
from uavseg_ros.planning import PlanarPose

from tests.ros.messages import goal, grid, new, pose, room, serialised, transform
from tests.ros.test_maps import real_map, saved
from uavseg.cli import main
from uavseg.errors import PathError

PARAMS = NodeParams()
START, GOAL = PlanarPose(0.52, 0.53, 0.0), PlanarPose(5.02, 0.48, 2.0)


def message_of(
    start: PlanarPose = START,
    end: PlanarPose = GOAL,
    params: NodeParams = PARAMS,
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Any:
    source = maps.read_map(grid(room(), origin=origin))
    path = planning.plan_path(source, start, end, params)
    header = new("std_msgs/Header")
    header.frame_id, header.stamp.sec = "map", 42
    types = partial(new, "nav_msgs/Path"), partial(new, "geometry_msgs/PoseStamped")
    return serialised(planning.path_message(path, end, header, params.path_spacing, *types))


def places(message: Any) -> NDArray[np.float64]:
    return np.array([(one.pose.position.x, one.pose.position.y) for one in message.poses])


def headings(message: Any) -> NDArray[np.float64]:
    turns = [one.pose.orientation for one in message.poses]
    return Rotation.from_quat([(turn.x, turn.y, turn.z, turn.w) for turn in turns]).as_euler("zyx")[:, 0]


@pytest.mark.parametrize("smooth", [True, False])
def test_the_path_is_that_of_the_command(tmp_path: Path, smooth: bool) -> None:
    resolution = grid(room()).info.resolution
    path, out = saved(tmp_path, room(), resolution, (0.0, 0.0, 0.0)), tmp_path / "path.geojson"
    ends = ["--start", f"{START.x},{START.y}", "--goal", f"{GOAL.x},{GOAL.y}", "--clearance", "0.2"]
    words = ["path", str(path), "--range", "0,0.45", *ends, "-o", str(out), *(["--smooth"] if smooth else [])]
    ran = CliRunner().invoke(main, words)
    assert ran.exit_code == 0, ran.output
    line = json.loads(out.read_text())["features"][0]["geometry"]["coordinates"]
    assert len(line) > 2
    message = message_of(params=NodeParams(path_spacing=0, smooth=smooth))
    np.testing.assert_allclose(places(message), line, atol=1e-8)


@pytest.mark.slow
def test_paths_over_a_real_map_are_those_of_the_command(shared_data: Path, tmp_path: Path) -> None:
    path, out = shared_data / "maps" / "tb3_sandbox.yaml", tmp_path / "path.geojson"
    message, params = real_map(path), NodeParams(path_spacing=0)
    source = maps.read_map(message)
    found = maps.classify_map(source, params)
    free = maps.free_space_message(found, params, message, partial(new, "nav_msgs/OccupancyGrid"))
    rows, cols = np.nonzero(free.data.reshape(message.info.height, -1) == 0)
    corner, side, reached = message.info.origin.position, message.info.resolution, 0
    for k in np.random.default_rng(5).choice(len(rows), (6, 2)):
        x, y = corner.x + side * (cols[k] + 0.5), corner.y + side * (rows[k] + 0.5)
        start, end = (PlanarPose(float(x[i]), float(y[i]), 0.0) for i in (0, 1))
        ends = [f"--start={start.x!r},{start.y!r}", f"--goal={end.x!r},{end.y!r}"]
        words = ["path", str(path), "--range", "0,0.45", *ends, "--clearance", "0.2", "--smooth"]
        ran = CliRunner().invoke(main, [*words, "-o", str(out), "-q", "--overwrite"])
        if ran.exit_code:
            with pytest.raises(PathError):
                planning.plan_path(source, start, end, params)
        else:
            line = json.loads(out.read_text())["features"][0]["geometry"]["coordinates"]
            np.testing.assert_allclose(planning.plan_path(source, start, end, params).xy, line, atol=1e-6)
            reached += 1
    assert reached >= 2


@pytest.mark.parametrize("spacing", [0.0, 0.05, 0.3])
def test_poses_are_close_and_head_for_the_next_one(spacing: float) -> None:
    message, corners = (message_of(params=NodeParams(path_spacing=s)) for s in (spacing, 0))
    xy, yaw = places(message), headings(message)
    steps = np.diff(xy, axis=0)
    np.testing.assert_allclose(yaw[:-1], np.arctan2(steps[:, 1], steps[:, 0]), atol=1e-9)
    assert yaw[-1] == pytest.approx(GOAL.yaw)
    assert not spacing or np.hypot(*steps.T).max() <= spacing + 1e-9
    away = np.hypot(*(places(corners)[:, None] - xy[None]).T).min(axis=0)
    assert away.max() < 1e-9  # each corner is kept
    assert np.hypot(*steps.T).sum() == pytest.approx(np.hypot(*np.diff(places(corners), axis=0).T).sum())
    assert message.header.frame_id == "map" and message.header.stamp.sec == 42
    assert all(one.header == message.header for one in message.poses)


def test_no_pose_lies_on_a_wall_or_nearer_than_the_clearance() -> None:
    xy = places(message_of())
    rows, cols = np.nonzero(room())
    walls = (np.column_stack([cols, rows]) + 0.5) * grid(room()).info.resolution
    away = np.hypot(*(xy[:, None] - walls[None]).transpose(2, 0, 1)).min()
    assert away > 0.2 - 0.05  # corners of the path keep the clearance, legs between them to within a cell
    assert xy[:, 1].max() > 2.0  # through the door


@pytest.mark.parametrize("origin", [(0.0, 0.0, 0.9), (5.5, -2.0, -2.5)])
def test_a_turned_map_has_the_turned_path(origin: tuple[float, float, float]) -> None:
    x, y, yaw = origin
    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])

    def moved(one: PlanarPose) -> PlanarPose:
        place = turn @ (one.x, one.y) + (x, y)
        return PlanarPose(float(place[0]), float(place[1]), one.yaw + yaw)

    plain, turned = message_of(), message_of(moved(START), moved(GOAL), origin=origin)
    np.testing.assert_allclose(places(turned), places(plain) @ turn.T + (x, y), atol=1e-6)
    np.testing.assert_allclose(np.cos(headings(turned) - headings(plain) - yaw), 1, atol=1e-9)


def test_from_a_place_to_itself_is_one_pose_that_heads_as_the_goal() -> None:
    message = message_of(START, PlanarPose(START.x, START.y, -1.25))
    assert headings(message).tolist() == pytest.approx([-1.25])


numbers = st.floats(-50, 50)


@given(st.tuples(*[numbers] * 8))
def test_a_pose_in_another_frame_is_moved_as_scipy_moves_it(drawn: tuple[float, ...]) -> None:
    outer, inner = (Rotation.from_euler("xyz", angles) for angles in (drawn[:3], (0, 0, drawn[3])))
    given_pose, looked_up = pose(drawn[4], drawn[5], drawn[3]), transform(drawn[6], drawn[7])
    rotation = looked_up.transform.rotation
    rotation.x, rotation.y, rotation.z, rotation.w = outer.as_quat().tolist()
    found = planning.pose_in_plane(given_pose, looked_up)
    expected = outer.apply([drawn[4], drawn[5], 0]) + np.array([drawn[6], drawn[7], 0])
    np.testing.assert_allclose([found.x, found.y], expected[:2], atol=1e-9)
    ahead = (outer * inner).apply([1, 0, 0])
    if np.hypot(*ahead[:2]) > 1e-6:
        assert math.cos(found.yaw - math.atan2(ahead[1], ahead[0])) == pytest.approx(1, abs=1e-9)


def test_a_pose_in_the_frame_of_the_map_stays_and_a_transform_is_a_pose() -> None:
    assert planning.pose_in_plane(goal(1.5, -2, 0.5).pose) == PlanarPose(1.5, -2.0, pytest.approx(0.5))
    assert planning.frame_in_plane(transform(1.5, -2, 0.5)) == PlanarPose(1.5, -2.0, pytest.approx(0.5))


def test_wrong_poses_are_refused_in_one_line() -> None:
    with pytest.raises(PathError, match="a place is finite x, y and z, not nan, 0, 0"):
        planning.pose_in_plane(pose(math.nan, 0))
    with pytest.raises(PathError, match="a transform has finite x and y, not inf, 0"):
        planning.frame_in_plane(transform(math.inf, 0))
    lost = pose(0, 0)
    lost.orientation.w = 0.0
    with pytest.raises(PathError, match="a quaternion has a finite length above 0"):
        planning.pose_in_plane(lost)


@pytest.mark.parametrize(("stamp", "old"), [(98.5, True), (99.5, False), (101.0, False), (0.0, False)])
def test_a_transform_of_the_past_is_missing_but_a_static_one_is_not(stamp: float, old: bool) -> None:
    looked_up = transform(0, 0, stamp=stamp)
    if old:
        with pytest.raises(
            planning.TransformMissingError, match=r"from base_link to map is 1\.5 s old, and at"
        ):
            planning.check_age(looked_up, 100_000_000_000, 1.0)
    else:
        planning.check_age(looked_up, 100_000_000_000, 1.0)


@pytest.mark.parametrize(
    ("end", "how", "reason"),
    [
        ((9.0, 0.5), {}, r"the goal 9,0\.5 lies outside of the map, which has x 0\.\.6\.4"),
        ((3.7, 0.5), {}, "and the goal in no region .*the nearest free cell"),
        ((5.0, 1.5), {"clearance": 0.7}, r"with at most 0\.\d+ m exists \(clearance\)"),
    ],
)
def test_what_cannot_be_reached_is_explained_in_parameters(
    end: tuple[float, float], how: dict[str, Any], reason: str
) -> None:
    with pytest.raises(PathError, match=reason) as raised:
        message_of(PlanarPose(1.5, 1.5, 0), PlanarPose(*end, 0), NodeParams(**how))
    assert "--" not in str(raised.value) and "\n" not in str(raised.value)


def test_a_closed_door_is_explained_in_parameters() -> None:
    cells = room()
    cells[40:, 70:78] = 51
    with pytest.raises(PathError, match=r"; passable_below: 0\.511 joins them there") as raised:
        planning.plan_path(maps.read_map(grid(cells)), START, GOAL, NodeParams(clearance=0))
    assert "--" not in str(raised.value)
    opened = NodeParams(clearance=0, passable_below=0.511)
    path = planning.plan_path(maps.read_map(grid(cells)), START, GOAL, opened)
    assert all(b > a for (a, _), (b, _) in pairwise([path.xy[0], path.xy[-1]]))
