"""Point clouds as scans, compared with a loop over their points."""

import math
from array import array
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from uavseg.errors import SceneError
from uavseg.occupancy.mapping.scan import Pose, Scan
from uavseg.occupancy.mapping.sensor_messages import read_points


def cloud(
    points: Any, big: bool = False, double: bool = False, padding: int = 0, rows: int = 1, **how: Any
) -> Any:
    """A message of points (n, 3), in rows that end with some bytes of padding."""
    points = np.asarray(points, float).reshape(rows, -1, 3)
    form = (">" if big else "<") + ("f8" if double else "f4")
    kind = np.dtype({"names": ["z", "i", "x", "y"], "formats": [form, "u1", form, form]}, align=True)
    table = np.zeros(points.shape[:2], kind)
    for k, name in enumerate("xyz"):
        table[name] = points[..., k]
    lines = [row.tobytes() + bytes(padding) for row in table]
    fields = [
        SimpleNamespace(name=name, offset=kind.fields[name][1], datatype=8 if double else 7, count=1)
        for name in "xyz"
    ]
    message = {
        "height": rows,
        "width": points.shape[1],
        "fields": fields,
        "is_bigendian": big,
        "point_step": kind.itemsize,
        "row_step": kind.itemsize * points.shape[1] + padding,
        "data": b"".join(lines),
    }
    return SimpleNamespace(**(message | how))


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("double", [False, True])
@pytest.mark.parametrize(("rows", "padding"), [(1, 0), (3, 0), (4, 5)])
def test_points_are_read_in_every_layout(big: bool, double: bool, rows: int, padding: int) -> None:
    points = np.random.default_rng(1).normal(0, 3, (12, 3)).astype(np.float32)
    points[5, 1], points[7, 2] = math.nan, math.inf
    message = cloud(points, big, double, padding, rows)
    found = read_points(message)
    assert np.array_equal(found, points[np.isfinite(points).all(axis=1)].astype(float))
    for kind in (bytearray, list, lambda data: array("B", data), lambda data: np.frombuffer(data, np.uint8)):
        message.data = kind(bytes(message.data))
        assert np.array_equal(read_points(message), found)


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ({"data": b"123"}, "says 1 x 2 points .* holds 3 bytes"),
        ({"point_step": 4}, "says 1 x 2 points of 4 bytes"),
        ({"row_step": 1}, "says 1 x 2 points"),
        ({"height": 1 << 40}, "at most 20,000,000 points"),
        ({"fields": []}, "expected x, y and z as floats in a point cloud; missing: x, y, z"),
        ({"data": None}, "expected a sensor_msgs/PointCloud2, not 'SimpleNamespace'"),
    ],
)
def test_a_message_that_is_no_cloud_is_refused(how: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        read_points(cloud([[1, 2, 3], [4, 5, 6]], **how))


def test_an_empty_cloud_has_no_points() -> None:
    assert read_points(cloud(np.empty((0, 3)))).shape == (0, 3)
    scan = Scan.from_point_cloud(cloud(np.empty((0, 3))), Pose(1, 2), heights=(0, 1))
    assert len(scan.ranges) == 0


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.floats(-3, 3))
def test_each_direction_has_its_nearest_point_of_the_band(seed: int, heading: float) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(0, 2, (rng.integers(1, 400), 3)).astype(np.float32)
    pose = Pose(1.0, -2.0, heading_rad=heading)
    scan = Scan.from_point_cloud(cloud(points), pose, heights=(-0.5, 1.0), max_range_m=4.0)
    nearest: dict[int, float] = {}
    for x, y, z in points.astype(float).tolist():
        away, direction = math.hypot(x, y), math.degrees(heading + math.atan2(y, x))
        if -0.5 <= z <= 1.0 and 0 < away <= 4.0:
            sector = math.floor((math.remainder(direction, 360) if abs(direction) > 180 else direction) / 0.5)
            nearest[sector] = min(nearest.get(sector, math.inf), away)
    found = dict(zip(np.floor(np.degrees(scan.angles) / 0.5).astype(int).tolist(), scan.ranges, strict=True))
    assert (scan.pose.x, scan.pose.y, scan.pose.heading_rad, scan.max_range_m) == (1.0, -2.0, 0.0, 4.0)
    assert abs(len(found) - len(nearest)) <= 2  # a point on the border of two directions
    same = [key for key in found if key in nearest]
    assert len(same) >= len(found) - 2
    assert sum(found[key] != pytest.approx(nearest[key], rel=1e-6) for key in same) <= 2


@pytest.mark.parametrize("heights", [(1.0, 1.0), (2.0, 1.0), (math.nan, 1.0), (0.0, math.inf)])
def test_heights_are_a_band(heights: tuple[float, float]) -> None:
    with pytest.raises(SceneError, match="the lowest and the highest in metres"):
        Scan.from_point_cloud(cloud([[1, 2, 3]]), Pose(0, 0), heights=heights)
