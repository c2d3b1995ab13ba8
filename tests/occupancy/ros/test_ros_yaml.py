"""YAML metadata of ROS maps: numbers, flags, and one line for each fault."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tests.occupancy.ros.map_files import ALL, put
from uavseg.errors import MapError, RasterReadError
from uavseg.occupancy.ros.ros_map import (
    ROS_MODES,
    CellRules,
    MapDescription,
    read_ros_map,
    read_ros_yaml,
    ros_yaml_text,
)


@pytest.mark.parametrize(
    ("keys", "message"),
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
        ({"image": "none.pgm"}, "there is no file"),
        ({"image": None}, "missing here: image"),
        ({"resolution": None, "negate": None}, "missing here: resolution, negate"),
        ({"origin": "[0, 0"}, "is not valid YAML"),
        ({"image": "map.yaml"}, "cannot be read as a picture"),
    ],
)
def test_an_invalid_yaml_is_refused_in_one_line(tmp_path: Path, keys: dict[str, Any], message: str) -> None:
    path = put(tmp_path, ALL, **keys)
    with pytest.raises((MapError, RasterReadError)) as caught:
        read_ros_map(path)
    assert message in str(caught.value) and "map.yaml" in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("number", ["5e-2", '"0.05"', "0.05"])
def test_numbers_are_read_as_yaml_cpp_reads_them(tmp_path: Path, number: str) -> None:
    assert read_ros_map(put(tmp_path, ALL, resolution=number)).geobox.transform.a == 0.05


@pytest.mark.parametrize(("negate", "first"), [("0", 100), ("1", 0), ("true", 0), ("no", 100), ("2", 0)])
def test_negate_is_a_number_or_a_flag(tmp_path: Path, negate: str, first: int) -> None:
    assert read_ros_map(put(tmp_path, ALL, negate=negate)).cells[0, 0] == first


def test_a_missing_yaml_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RasterReadError, match=r"there is no file .*none\.yaml"):
        read_ros_map(tmp_path / "none.yaml")


@given(st.sampled_from(ROS_MODES), st.booleans(), st.floats(0, 0.49), st.floats(0.51, 1))
def test_a_table_is_monotone_and_negate_mirrors_it(
    mode: str, negate: bool, free: float, occupied: float
) -> None:
    table = CellRules(mode, negate, occupied, free).table()
    assert table.shape == (256,) and table.min() >= -1 and table.max() <= 100
    known = table[table >= 0].astype(int)
    if mode == "raw":
        assert known.tolist() == list(range(101)) and (table[101:] == -1).all()
        return
    steps = np.diff(known)
    assert (steps >= 0).all() if negate else (steps <= 0).all()
    assert {0, 100} <= set(known.tolist()) and (mode == "trinary") == (len(set(known.tolist())) == 2)
    if not negate:
        dark, bright = int(table[0]), int(table[255])
        assert (dark, bright) == (100, 0)


@pytest.mark.slow
@given(
    st.floats(1e-3, 10),
    st.lists(st.floats(-1e6, 1e6), min_size=3, max_size=3),
    st.sampled_from(ROS_MODES),
    st.booleans(),
)
def test_a_description_written_is_read_equal(
    resolution: float, origin: list[float], mode: str, negate: bool
) -> None:
    content = {"image": "a b.pgm", "mode": mode, "resolution": resolution, "origin": origin}
    content |= {"negate": int(negate), "occupied_thresh": 0.65, "free_thresh": 0.196}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.yaml"
        path.write_text(ros_yaml_text(content))
        found = read_ros_yaml(path)
    rules = CellRules(mode, negate, 0.65, 0.196)
    assert found == MapDescription(path.parent / "a b.pgm", resolution, tuple(origin), rules)
