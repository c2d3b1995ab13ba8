"""YAML metadata of ROS maps: numbers, flags, and one line for each fault."""

from pathlib import Path
from typing import Any

import pytest

from tests.occupancy.ros.map_files import ALL, put
from uavseg.errors import MapError, RasterReadError
from uavseg.occupancy.ros.ros_map import read_ros_map


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"free_thresh": 0.7}, "free_thresh (0.7) lies below occupied_thresh (0.65)"),
        ({"free_thresh": 0.65}, "free_thresh (0.65) lies below"),
        ({"free_thresh": ".nan"}, "thresholds are finite"),
        ({"resolution": -0.05}, "a number above 0, not -0.05"),
        ({"resolution": 0}, "a number above 0, not 0"),
        ({"resolution": ".nan"}, "a number above 0, not nan"),
        ({"resolution": ".inf"}, "a number above 0, not inf"),
        ({"resolution": "fine"}, "resolution is a number, not 'fine'"),
        ({"resolution": "true"}, "resolution is a number, not True"),
        ({"origin": "[0, 0]"}, "origin is a list of three numbers"),
        ({"origin": "[0, 0, .nan]"}, "origin is finite x, y and yaw"),
        ({"origin": 0}, "origin is a list of three numbers"),
        ({"mode": "ternary"}, "mode is trinary, scale or raw, not 'ternary'"),
        ({"negate": "maybe"}, "negate is 0 or 1, not 'maybe'"),
        ({"image": "[]"}, "image is the file name of an image"),
        ({"image": "none.pgm"}, "there is no such file"),
        ({"image": None}, "missing here: image"),
        ({"resolution": None, "negate": None}, "missing here: resolution, negate"),
        ({"origin": "[0, 0"}, "is not valid YAML"),
        ({"image": "map.yaml"}, "cannot be read as a picture"),
    ],
)
def test_a_yaml_that_is_no_map_is_refused_in_one_line(
    tmp_path: Path, keys: dict[str, Any], told: str
) -> None:
    path = put(tmp_path, ALL, **keys)
    with pytest.raises((MapError, RasterReadError)) as caught:
        read_ros_map(path)
    assert told in str(caught.value) and "map.yaml" in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("number", ["5e-2", '"0.05"', "0.05"])
def test_numbers_are_read_as_yaml_cpp_reads_them(tmp_path: Path, number: str) -> None:
    assert read_ros_map(put(tmp_path, ALL, resolution=number)).geobox.transform.a == 0.05


@pytest.mark.parametrize(("negate", "first"), [("0", 100), ("1", 0), ("true", 0), ("no", 100), ("2", 0)])
def test_negate_is_a_number_or_a_flag(tmp_path: Path, negate: str, first: int) -> None:
    assert read_ros_map(put(tmp_path, ALL, negate=negate)).cells[0, 0] == first


def test_a_missing_yaml_is_told(tmp_path: Path) -> None:
    with pytest.raises(RasterReadError, match=r"there is no file .*none\.yaml"):
        read_ros_map(tmp_path / "none.yaml")
