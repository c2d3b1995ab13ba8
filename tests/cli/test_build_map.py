"""`uavseg build-map`, from the command line to the files that Nav2 and classify read."""

from contextlib import chdir
from pathlib import Path

import numpy as np
import pytest
import rasterio
from click.testing import CliRunner, Result

from tests.occupancy.bags.write_bags import Drive, write_ros1, write_ros2
from uavseg.cli import main
from uavseg.occupancy.bags.merge_bag import merge_bag
from uavseg.occupancy.ros.ros_map import read_ros_map


@pytest.fixture(autouse=True)
def folder(tmp_path: Path) -> None:
    """A bag of each version, in the current folder."""
    for ros in (1, 2):
        drive = Drive(ros, count=4)
        messages = drive.recorded_scans() + drive.recorded_odometry() + drive.recorded_static()
        (write_ros1 if ros == 1 else write_ros2)(tmp_path / ("drive.bag" if ros == 1 else "drive"), messages)
    with chdir(tmp_path):
        yield


def run(*words: str) -> Result:
    return CliRunner().invoke(main, [str(word) for word in words])


@pytest.mark.parametrize("bag", ["drive.bag", "drive", "drive/drive.db3"])
def test_a_bag_becomes_a_map_of_nav2(bag: str) -> None:
    result = run("build-map", bag, "-o", "map.yaml", "--resolution", "0.1")
    assert result.exit_code == 0, result.output
    assert "scans       4 of 4 merged" in result.stderr
    assert "cells of 0.1 m in the frame odom" in result.stderr
    text = Path("map.yaml").read_text()
    assert "image: map.pgm\nmode: trinary\nresolution: 0.1\n" in text and "negate: 0" in text
    found = read_ros_map("map.yaml")
    p = merge_bag(bag, params=_tenth()).grid.probabilities
    expected = np.where(p <= 0.25, 0, np.where(p >= 0.65, 100, -1))
    assert np.array_equal(found.cells, expected)
    assert {0, 100, -1} == set(np.unique(found.cells).tolist())


def _tenth() -> object:
    from uavseg.occupancy.bags.merge_bag import MergeParams

    return MergeParams(resolution_m=0.1)


def test_the_map_is_read_by_classify() -> None:
    assert run("build-map", "drive", "-o", "map.yaml", "-q").exit_code == 0
    result = run("classify", "map.yaml", "-o", "states.tif", "--threads", "1")
    assert result.exit_code == 0, result.output
    with rasterio.open("states.tif") as file:
        assert {1, 2} <= set(np.unique(file.read(1)).tolist())


def test_probabilities_are_those_of_the_grid() -> None:
    result = run("build-map", "drive.bag", "-o", "map.tif", "-q")
    assert (result.exit_code, result.output) == (0, "")
    grid = merge_bag("drive.bag").grid
    with rasterio.open("map.tif") as file:
        assert np.array_equal(file.read(1), grid.probabilities)
        assert file.transform == grid.geobox.transform


def test_an_output_that_is_there_is_kept() -> None:
    Path("map.pgm").write_bytes(b"kept")
    result = run("build-map", "drive", "-o", "map.yaml")
    assert result.exit_code == 1 and "map.pgm" in result.stderr
    assert Path("map.pgm").read_bytes() == b"kept" and not Path("map.yaml").exists()
    assert run("build-map", "drive", "-o", "map.yaml", "--overwrite").exit_code == 0


@pytest.mark.parametrize("output", ["drive/metadata.yaml", "drive.bag"])
def test_no_output_replaces_the_bag(output: str) -> None:
    before = Path(output).read_bytes()
    result = run("build-map", "drive" if "metadata" in output else "drive.bag", "-o", output, "--overwrite")
    assert result.exit_code == 1 and result.stderr.startswith("uavseg: error: ")
    assert Path(output).read_bytes() == before


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["drive", "-o", "map.png"], "a map is written to .yaml for a ROS map, or to .tif"),
        (["drive", "-o", "map.yaml", "--tf", "--odom", "/odom"], "--odom or from --tf"),
        (
            ["drive", "-o", "map.yaml", "--tf"],
            "has no topic /tf; it has /odom (nav_msgs/msg/Odometry), /scan",
        ),
        (["drive", "-o", "map.yaml", "--scan", "/front"], "has no topic /front; it has /odom"),
        (
            ["drive", "-o", "map.yaml", "--resolution", "0"],
            "resolution is 0.001 to 100 metres per cell, not 0",
        ),
        (["drive", "-o", "map.yaml", "--max-range", "nan"], "max range is a number above 0, not nan"),
        (["none.bag", "-o", "map.yaml"], "there is no file none.bag"),
        (["map", "-o", "no/such/map.yaml"], "no/such"),
    ],
)
def test_what_is_wrong_is_one_line_and_no_file(words: list[str], text: str) -> None:
    before = sorted(path.name for path in Path().iterdir())
    result = run("build-map", *words)
    assert result.exit_code == 1
    [line] = result.stderr.splitlines()
    assert line.startswith("uavseg: error: ") and text in line
    assert sorted(path.name for path in Path().iterdir()) == before


def test_scans_without_a_pose_are_reported() -> None:
    drive = Drive(2, count=4)
    write_ros2(Path("late"), drive.recorded_scans() + drive.recorded_odometry()[2:] + drive.recorded_static())
    result = run("build-map", "late", "-o", "map.yaml")
    assert result.exit_code == 0
    assert (
        "uavseg: warning: 2 of 4 scans have no pose from /odom at their time, and are left out"
        in result.stderr
    )
    assert "scans       2 of 4 merged" in result.stderr
