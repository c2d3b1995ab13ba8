"""The map of a bag is the map that the same scans make at the same poses, whatever recorded them."""

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import CompressionFormat, CompressionMode

from tests.occupancy.bags.write_bags import (
    LASERSCAN,
    MULTI_ECHO,
    POINT_CLOUD,
    ROOM,
    START_NS,
    STEP_NS,
    TRANSFORMS,
    Drive,
    Recorded,
    write_ros1,
    write_ros2,
)
from uavseg.errors import BagError, ParameterError, SceneError
from uavseg.occupancy.bags import frames
from uavseg.occupancy.bags.merge_bag import BagTopics, BuiltMap, MergeParams, merge_bag
from uavseg.occupancy.map_file import trinary_states
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.scan import Pose, Scan

LASER = (0.2, -0.1, 0.4)
TF = BagTopics(odom=None)


def direct(drive: Drive, found: BuiltMap, shift: tuple[float, float] = (0.0, 0.0)) -> OccupancyGrid:
    """The map of the same scans, merged at the true poses."""
    grid = OccupancyGrid(found.grid.geobox)
    for time, scan in zip(drive.scan_times(), drive.scans(), strict=True):
        true = drive.sensor_pose(time)
        pose = Pose(true.x + shift[0], true.y + shift[1], heading_rad=true.heading_rad)
        grid.merge(Scan.from_laserscan(drive.laserscan(scan, time), pose))
    return grid


def assert_same_map(found: OccupancyGrid, expected: OccupancyGrid) -> None:
    """All cells but those where rounding of a pose moves a beam across a corner."""
    assert (expected.log_odds != 0).mean() > 0.3
    differ = np.abs(found.log_odds - expected.log_odds) > 1e-3
    assert differ.mean() < 2e-3


WRITERS: dict[str, tuple[int, Callable[[Path, list[Recorded]], Path]]] = {
    "ROS 1": (1, lambda folder, found: write_ros1(folder / "a.bag", found)),
    "ROS 1 bz2": (1, lambda folder, found: write_ros1(folder / "a.bag", found, "BZ2")),
    "ROS 1 lz4": (1, lambda folder, found: write_ros1(folder / "a.bag", found, "LZ4")),
    "ROS 2 folder": (2, lambda folder, found: write_ros2(folder / "a", found)),
    "ROS 2 db3": (2, lambda folder, found: write_ros2(folder / "a", found) / "a.db3"),
    "ROS 2 mcap folder": (2, lambda folder, found: write_ros2(folder / "a", found, "MCAP")),
    "ROS 2 mcap": (2, lambda folder, found: write_ros2(folder / "a", found, "MCAP") / "a.mcap"),
    "ROS 2 mcap zstd": (
        2,
        lambda folder, found: write_ros2(
            folder / "a", found, "MCAP", (CompressionMode.STORAGE, CompressionFormat.ZSTD)
        ),
    ),
}


@pytest.mark.parametrize("kind", WRITERS)
def test_the_map_of_a_bag_is_the_map_of_its_scans(kind: str, tmp_path: Path) -> None:
    ros, write = WRITERS[kind]
    drive = Drive(ros, laser=LASER)
    found = merge_bag(write(tmp_path, drive.everything()))
    assert (found.scans.merged, found.scans.total, found.warnings) == (12, 12, ())
    assert found.frame == "odom"
    assert_same_map(found.grid, direct(drive, found))


@pytest.mark.slow
def test_all_kinds_of_bags_give_the_same_map_to_the_bit(tmp_path: Path) -> None:
    maps = []
    for number, (ros, write) in enumerate(WRITERS.values()):
        folder = tmp_path / str(number)
        folder.mkdir()
        maps.append(merge_bag(write(folder, Drive(ros, laser=LASER).everything())).grid)
    assert all(one.geobox == maps[0].geobox for one in maps)
    assert all(np.array_equal(one.log_odds, maps[0].log_odds) for one in maps)


def test_a_scan_at_the_time_of_a_pose_is_merged_there_exactly(tmp_path: Path) -> None:
    drive = Drive()
    scan = drive.scans()[0]
    time, at = START_NS + STEP_NS, drive.base(START_NS + STEP_NS)
    message = drive.laserscan(scan, time, "base_link")
    path = write_ros2(
        tmp_path / "a", [Recorded("/scan", LASERSCAN, time, message), *drive.recorded_odometry()]
    )
    found = merge_bag(path)
    pose = Pose.from_quaternion(at[0], at[1], drive.rotation(at[2]))
    grid = OccupancyGrid(found.grid.geobox)
    grid.merge(Scan.from_laserscan(message, pose))
    assert grid.log_odds.any() and np.array_equal(grid.log_odds, found.grid.log_odds)


def test_poses_from_tf_place_the_map_in_its_root(tmp_path: Path) -> None:
    drive = Drive(laser=LASER)
    found = merge_bag(write_ros2(tmp_path / "a", drive.everything()), TF)
    assert found.frame == "map" and found.warnings == ()
    assert_same_map(found.grid, direct(drive, found, shift=(1.0, -2.0)))


def test_the_map_covers_what_the_scans_observe_and_shows_the_room(tmp_path: Path) -> None:
    drive = Drive()
    found = merge_bag(
        write_ros1(tmp_path / "a.bag", Drive(1).everything()), params=MergeParams(resolution_m=0.1)
    )
    geobox = found.grid.geobox
    assert geobox.transform.a == 0.1 and min(geobox.shape) > 30
    wider = OccupancyGrid.empty((400, 400), 0.1, (-20.0, -20.0))
    for scan in drive.scans():
        wider.merge(scan)
    (rows, cols), origin = geobox.shape, geobox.transform.c
    observed = np.argwhere(wider.log_odds != 0)
    width = observed[:, 1].max() - observed[:, 1].min() + 1
    assert width <= cols <= width + 3 and origin == pytest.approx(round(origin, 1), abs=1e-9)
    states = trinary_states(found.grid.probabilities)
    x, y = geobox.xy_from_pixel(*(np.indices((rows, cols)) + 0.5))
    solid = ROOM.contains(x, y)
    assert solid[states == 1].mean() < 0.02
    near = np.min(
        [ROOM.contains(x + dx, y + dy) for dx in (-0.15, 0, 0.15) for dy in (-0.15, 0, 0.15)], axis=0
    )
    touching = np.max(
        [ROOM.contains(x + dx, y + dy) for dx in (-0.15, 0, 0.15) for dy in (-0.15, 0, 0.15)], axis=0
    )
    assert touching[states == 3].mean() > 0.95 and not near[states == 1].any()


def test_a_sensor_upside_down_makes_the_same_map(tmp_path: Path) -> None:
    drive = Drive()
    hanging = drive.recorded_static(quaternion=(1, 0, 0, 0))  # rolled by half a turn
    mirrored = []
    for one in drive.recorded_scans():
        message = dataclasses.replace(
            one.message, ranges=one.message.ranges[::-1].copy()
        )  # its fan is symmetric: the beams in reverse order
        mirrored.append(dataclasses.replace(one, message=message))
    found = merge_bag(write_ros2(tmp_path / "a", mirrored + drive.recorded_odometry() + hanging))
    assert found.scans.merged == 12
    expected = OccupancyGrid(found.grid.geobox)
    for time, scan in zip(drive.scan_times(), drive.scans(), strict=True):
        upright = Scan.from_laserscan(drive.laserscan(scan, time), drive.sensor_pose(time))
        backwards = {"angles": upright.angles[::-1], "ranges": upright.ranges[::-1]}
        expected.merge(dataclasses.replace(upright, **backwards))
    assert_same_map(found.grid, expected)


# Beams of a moving robot, other messages, other drivers


def far_from_walls(found: BuiltMap) -> tuple[int, int]:
    """Occupied cells, and how many of them are more than 0.1 m from anything solid."""
    box = found.grid.geobox
    rows, cols = np.nonzero(found.grid.probabilities > 0.65)
    x, y = box.xy_from_pixel(rows + 0.5, cols + 0.5)
    around = [(0.1 * math.cos(a), 0.1 * math.sin(a)) for a in np.linspace(0, math.tau, 16)]
    near = np.any([ROOM.contains(x + dx, y + dy) for dx, dy in [(0, 0), *around]], axis=0)
    return len(rows), int((~near).sum())


@pytest.mark.slow
@pytest.mark.parametrize("topics", [BagTopics(), TF])
def test_each_beam_of_a_turning_robot_has_its_own_pose(tmp_path: Path, topics: BagTopics) -> None:
    drive = Drive(laser=LASER, beam_ns=300_000, turning=1.5)
    found = merge_bag(write_ros2(tmp_path / "a", drive.everything()), topics)
    blurred = [dataclasses.replace(one.message, time_increment=0.0) for one in drive.recorded_scans()]
    messages = [
        dataclasses.replace(one, message=message)
        for one, message in zip(drive.recorded_scans(), blurred, strict=True)
    ]
    static = drive.recorded_odometry() + drive.recorded_tf() + drive.recorded_static()
    before = merge_bag(write_ros2(tmp_path / "b", messages + static), topics)
    if topics.odom:
        assert far_from_walls(before)[1] > 30 and far_from_walls(found)[1] == 0
    alone = OccupancyGrid(found.grid.geobox)
    shift = (0.0, 0.0) if topics.odom else (1.0, -2.0)
    for time, scan in zip(drive.scan_times(), drive.scans(), strict=True):
        for k, angle in enumerate(scan.angles):
            pose = drive.sensor_pose(time + k * drive.beam_ns)
            moved = Pose(pose.x + shift[0], pose.y + shift[1], heading_rad=pose.heading_rad)
            alone.merge(
                Scan(
                    moved, np.array([angle]), scan.ranges[k : k + 1], scan.max_range_m, MergeParams().sigma_m
                )
            )
    # The sensor moves along an arc and is taken to move along its chord, 0.4 mm away at most.
    differ = trinary_states(found.grid.probabilities) != trinary_states(alone.probabilities)
    assert differ.mean() < 0.02


def test_a_scan_whose_end_has_no_pose_is_merged_and_counted(tmp_path: Path) -> None:
    drive = Drive(beam_ns=400_000)
    found = merge_bag(write_ros2(tmp_path / "a", drive.recorded_scans() + drive.recorded_odometry()[:-1]))
    assert found.scans.merged == found.scans.total - 1 == 11 and found.scans.without_end == 1
    assert "1 of 11 scans have no pose at their last beam" in found.warnings[1]


@pytest.mark.parametrize("increment", [-1e-3, math.nan, math.inf, 1e30, 1.0])
def test_an_increment_that_is_no_time_between_beams_moves_none(tmp_path: Path, increment: float) -> None:
    drive = Drive()
    changed = [
        dataclasses.replace(one, message=dataclasses.replace(one.message, time_increment=increment))
        for one in drive.recorded_scans()
    ]
    rest = drive.recorded_odometry() + drive.recorded_static()
    one, other = (
        merge_bag(write_ros2(tmp_path / name, scans + rest))
        for name, scans in (("a", changed), ("b", drive.recorded_scans()))
    )
    assert np.array_equal(one.grid.log_odds, other.grid.log_odds)
    said = 12 if increment >= 1 and math.isfinite(increment) else 0
    assert one.scans.without_end == said and len(one.warnings) == len(other.warnings) + bool(said)


@pytest.mark.slow
def test_a_scan_that_is_invalid_is_not_counted_among_those_without_an_end(tmp_path: Path) -> None:
    drive = Drive(beam_ns=400_000)
    scans = drive.recorded_scans()
    scans[-1] = dataclasses.replace(
        scans[-1], message=dataclasses.replace(scans[-1].message, angle_increment=0.0)
    )
    found = merge_bag(write_ros2(tmp_path / "a", scans + drive.recorded_odometry()[:-1]))
    late = merge_bag(write_ros2(tmp_path / "b", drive.recorded_scans() + drive.recorded_odometry()[:-1]))
    assert (found.scans.without_end, late.scans.without_end) == (1, 1)
    scans[-2] = dataclasses.replace(
        scans[-2], message=dataclasses.replace(scans[-2].message, angle_increment=0.0)
    )
    found = merge_bag(write_ros2(tmp_path / "c", scans + drive.recorded_odometry()[:-1]))
    assert found.scans.without_end == 0 and found.scans.invalid == 1


@pytest.mark.parametrize("ros", [1, 2])
def test_of_several_echoes_the_nearest_valid_one_counts(ros: int, tmp_path: Path) -> None:
    drive = Drive(ros)
    write = write_ros1 if ros == 1 else write_ros2
    echoes = [
        dataclasses.replace(one, kind=MULTI_ECHO, message=drive.multi_echo(one.message))
        for one in drive.recorded_scans()
    ]
    rest = drive.recorded_odometry() + drive.recorded_static()
    one, other = (
        merge_bag(write(tmp_path / f"{k}.bag", scans + rest))
        for k, scans in enumerate((echoes, drive.recorded_scans()))
    )
    assert one.scans.merged == 12
    assert np.array_equal(one.grid.log_odds, other.grid.log_odds)


def test_a_band_of_a_point_cloud_is_the_scan_of_its_nearest_points(tmp_path: Path) -> None:
    """Of a sensor that is tilted by 20 degrees and hangs 1.2 m high: floor and ceiling are no obstacles."""
    drive = Drive(count=6)
    tilt = math.radians(20)
    turn = (0.0, math.sin(tilt / 2), 0.0, math.cos(tilt / 2))
    place = drive.transform(START_NS, "base_link", "laser", (0, 0, 0), turn)
    place.transform.translation.z = 1.2
    static = [Recorded("/tf_static", TRANSFORMS, START_NS, drive.transforms([place]))]
    clouds, expected = [], []
    for time in drive.scan_times():
        pose = drive.sensor_pose(time)
        angles = np.radians(np.arange(-180, 180, 1.0) + 0.3)
        away = ROOM.cast(pose.x, pose.y, pose.heading_rad + angles)
        hit = away < 8.0
        level = np.column_stack([away * np.cos(angles), away * np.sin(angles)])[hit]
        points = [np.column_stack([level * s, np.full(len(level), z)]) for s, z in ((1, 0.5), (1.5, 1.0))]
        floor, above = (np.column_stack([level * 0.3, np.full(len(level), z)]) for z in (0.0, 2.5))
        world = np.vstack([*points, floor, above]) - (0, 0, 1.2)
        cos, sin = math.cos(tilt), math.sin(tilt)
        rotation = np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])  # about the y axis
        clouds.append(Recorded("/scan", POINT_CLOUD, time, drive.point_cloud(world @ rotation, time)))
        expected.append(Scan(pose, angles[hit], away[hit], 8.0, MergeParams().sigma_m))
    path = write_ros2(tmp_path / "a", clouds + drive.recorded_odometry() + static)
    found = merge_bag(path, params=MergeParams(heights=(0.1, 2.0)))
    grid = OccupancyGrid(found.grid.geobox)
    for scan in expected:
        grid.merge(scan)
    assert found.scans.merged == 6
    assert_same_map(found.grid, grid)
    with pytest.raises(BagError, match=r"heights, such as 0\.1,1\.8, say which points"):
        merge_bag(path)
    scans = write_ros2(tmp_path / "b", SCANS + ODOM)
    with pytest.raises(BagError, match="are for these alone"):
        merge_bag(scans, params=MergeParams(heights=(0.1, 2.0)))


def test_a_range_of_range_max_may_be_no_return(tmp_path: Path) -> None:
    drive = Drive()
    messages = []
    for one in drive.recorded_scans():
        ranges = np.where(np.isinf(one.message.ranges), np.float32(3.0), one.message.ranges)
        messages.append(dataclasses.replace(one, message=dataclasses.replace(one.message, ranges=ranges)))
    rest = drive.recorded_odometry() + drive.recorded_static()
    path = write_ros2(tmp_path / "a", messages + rest)
    true = merge_bag(write_ros2(tmp_path / "b", drive.recorded_scans() + rest))
    false, said = merge_bag(path), merge_bag(path, params=MergeParams(no_return="range_max"))
    assert far_from_walls(false)[1] > 50
    assert far_from_walls(said)[1] == far_from_walls(true)[1] == 0
    assert np.array_equal(said.grid.log_odds, true.grid.log_odds)


# Scans that are left out


def test_scans_without_a_pose_are_counted(tmp_path: Path) -> None:
    drive = Drive()
    messages = drive.recorded_scans() + drive.recorded_odometry()[4:] + drive.recorded_static()
    found = merge_bag(write_ros2(tmp_path / "a", messages))
    assert (found.scans.merged, found.scans.without_pose) == (8, 4)
    assert found.warnings == ("4 of 12 scans have no pose from /odom at their time, and are left out",)


def test_tilted_invalid_and_poseless_are_told_apart(tmp_path: Path) -> None:
    drive = Drive()
    messages = drive.everything()
    for one in messages:
        if one.topic == "/scan" and one.time < START_NS + 3 * STEP_NS:
            one.message.angle_increment = 0.5
        if one.topic == "/odom" and one.time > START_NS + 10 * STEP_NS:
            turn = one.message.pose.pose.orientation
            turn.x, turn.y, turn.z, turn.w = 1.0, 0.0, 0.0, 1.0
        if one.topic == "/odom" and one.time == START_NS + 6 * STEP_NS:
            one.message.pose.pose.position.x = math.nan
    found = merge_bag(write_ros2(tmp_path / "a", messages))
    counts = found.scans
    assert (counts.merged, counts.tilted, counts.invalid, counts.total) == (7, 2, 3, 12)
    texts = "\n".join(found.warnings)
    assert "2 of 12 scans were tilted by more than 30 degrees" in texts
    assert "3 of 12 scans are invalid, and left out: a LaserScan from" in texts
    assert "1 poses of /odom are not finite rotations" in texts


def test_a_sensor_that_tf_does_not_place_is_taken_to_be_at_the_base(tmp_path: Path) -> None:
    drive = Drive()
    found = merge_bag(write_ros2(tmp_path / "a", drive.recorded_scans() + drive.recorded_odometry()))
    assert found.warnings == (
        "no transform leads from 'base_link' to 'laser' in /tf_static: the sensor is taken to be at "
        "'base_link'",
    )
    assert_same_map(found.grid, direct(drive, found))


def test_frames_with_a_slash_of_ros_1_are_those_without(tmp_path: Path) -> None:
    drive = Drive(1, laser=LASER)
    messages = drive.recorded_scans(frame="/laser") + drive.recorded_odometry() + drive.recorded_static()
    found = merge_bag(write_ros1(tmp_path / "a.bag", messages))
    assert not found.warnings
    assert_same_map(found.grid, direct(drive, found))


def test_the_old_type_of_tf_is_read(tmp_path: Path) -> None:
    drive = Drive(1)
    old = [dataclasses.replace(one, kind="tf/msg/tfMessage") for one in drive.recorded_tf()]
    messages = drive.recorded_scans() + old + drive.recorded_static()
    assert merge_bag(write_ros1(tmp_path / "a.bag", messages), TF).scans.merged == 12


# Bags of which no map is made


def link(drive: Drive, parent: str, child: str) -> Recorded:
    moved = drive.transform(START_NS, parent, child, (0, 0, 0))
    return Recorded("/tf", TRANSFORMS, START_NS, drive.transforms([moved]))


DRIVE = Drive()
SCANS, ODOM = DRIVE.recorded_scans(), DRIVE.recorded_odometry()


def other_base() -> Recorded:
    time = ODOM[3].time
    return Recorded("/odom", ODOM[3].kind, time, DRIVE.odometry(time, (0, 0, 0), "trailer"))


@pytest.mark.parametrize(
    ("messages", "topics", "text"),
    [
        (ODOM, BagTopics(), r"has no topic /scan; it has /odom \(nav_msgs/msg/Odometry\)"),
        (SCANS, BagTopics(), r"has no topic /odom; it has /scan \(sensor_msgs/msg/LaserScan\)"),
        (SCANS, TF, "has no topic /tf; it has /scan"),
        (SCANS + ODOM, BagTopics(odom="/scan"), r"/scan of .* holds sensor_msgs/msg/LaserScan; expected nav"),
        (SCANS + ODOM, BagTopics(scan="/odom"), "/odom of .* expected sensor_msgs/msg/LaserScan"),
        ([*SCANS, *ODOM, other_base()], BagTopics(), "moves several frames"),
        (
            SCANS[:1] + ODOM[3:],
            BagTopics(),
            "no scan of /scan .* has a pose from /odom: the frame of the scans",
        ),
        (
            SCANS + DRIVE.recorded_tf(),
            TF,
            "the frame of the scans is 'laser', frames that move are 'base_link'",
        ),
        ([*SCANS, link(DRIVE, "a", "laser"), link(DRIVE, "b", "laser")], TF, "has two parents, 'a' and 'b'"),
        ([*SCANS, link(DRIVE, "a", "laser"), link(DRIVE, "laser", "a")], TF, "form a circle at"),
    ],
)
def test_what_is_missing_is_named(
    messages: list[Recorded], topics: BagTopics, text: str, tmp_path: Path
) -> None:
    with pytest.raises(BagError, match=text):
        merge_bag(write_ros2(tmp_path / "a", messages), topics)


def test_a_map_without_bound_is_refused_before_it_is_made(tmp_path: Path) -> None:
    odometry = DRIVE.recorded_odometry()
    odometry[-1].message.pose.pose.position.x = 1e6
    path = write_ros2(tmp_path / "a", SCANS + odometry)
    with pytest.raises(BagError, match=r"cells of 0\.05 m; at most 100,000,000 are possible: give a larger"):
        merge_bag(path)


def test_a_smaller_range_makes_a_smaller_map(tmp_path: Path) -> None:
    path = write_ros2(tmp_path / "a", SCANS + ODOM)
    near, all_of_it = (merge_bag(path, params=MergeParams(0.05, max_range_m=m)) for m in (1.0, None))
    assert near.grid.geobox.shape[0] < all_of_it.grid.geobox.shape[0] - 10
    assert near.scans.merged == 12


@pytest.mark.parametrize(
    ("how", "error", "text"),
    [
        ({"resolution_m": 0.0}, ParameterError, r"resolution is 0\.001 to 100 metres per cell, not 0"),
        ({"resolution_m": math.nan}, ParameterError, "not nan"),
        ({"sigma_m": -1.0}, SceneError, "sigma is a number above 0, not -1"),
        ({"max_range_m": 0.0}, SceneError, "max range is a number above 0, not 0"),
        (
            {"heights": (1.8, 0.1)},
            SceneError,
            "lowest and the highest in metres, such as 0.1,1.8, not 1.8,0.1",
        ),
        ({"heights": (0.1, math.nan)}, SceneError, "not 0.1,nan"),
        ({"no_return": "zero"}, ParameterError, "no return is inf or range_max, not 'zero'"),
        ({"beam_order": "both"}, ParameterError, "beam order is angles or increment, not 'both'"),
    ],
)
def test_lengths_are_checked(how: dict[str, Any], error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=text):
        MergeParams(**how)


def test_too_many_poses_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frames, "MAX_POSES", 5)
    path = write_ros2(tmp_path / "a", DRIVE.everything())
    for topics in (BagTopics(), TF):
        with pytest.raises(BagError, match="has more than 5 poses"):
            merge_bag(path, topics)
