"""Vehicles: files of them, and what they refuse."""

import json
from pathlib import Path
from typing import Any

import pytest

from uavseg.errors import ParameterError
from uavseg.flight.mission.vehicle import ARDUCOPTER, PX4, default_vehicle, read_vehicle

POWER = {"hover_w": 180, "cruise_w": 160.5, "battery_wh": 90}


def write(folder: Path, content: Any) -> Path:
    path = folder / "quad.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def test_a_file_changes_what_it_names(tmp_path: Path) -> None:
    path = write(tmp_path, {"radius_m": 5, "return_hold_s": 0, **POWER})
    for autopilot, default in (("ardupilot", ARDUCOPTER), ("px4", PX4)):
        read = read_vehicle(path, autopilot)
        assert (read.name, read.radius_m, read.return_hold_s, read.battery_wh) == ("quad", 5.0, 0.0, 90.0)
        assert (read.turns, read.jerk_m_s3) == (default.turns, default.jerk_m_s3)
        assert default_vehicle(autopilot) is default


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({}, "is not a vehicle; expected a JSON object"),
        ([1], "is not a vehicle"),
        ("{", "cannot be read as a vehicle in JSON"),
        ("nul", "cannot be read as a vehicle in JSON"),
        ({"speed": 3}, "has 'speed'; a vehicle has only name, turns, acceleration_m_s2"),
        ({"radius_m": "5"}, "radius_m of a vehicle is a number, not '5'"),
        ({"radius_m": True}, "radius_m of a vehicle is a number"),
        ({"radius_m": None}, "radius_m of a vehicle is a number"),
        ({"radius_m": 0}, "radius_m .* is above 0, not 0"),
        ({"return_hold_s": -1}, "return_hold_s .* is 0 or more, not -1"),
        ('{"climb_m_s": 1e999}', "climb_m_s|JSON"),
        ({"climb_m_s": 10**400}, "climb_m_s|JSON"),
        ({"climb_m_s": 1e-320}, "climb_m_s of the vehicle quad is 1e-09 to 1e.09, not "),
        ({"climb_m_s": 1e300}, "climb_m_s of the vehicle quad is 1e-09 to 1e.09, not 1e.300"),
        ({"turns": "fast"}, "turns of a vehicle are blend or slow, not 'fast'"),
        ({"turns": 3}, "turns of a vehicle is a word, not 3"),
        ({"hover_w": 100}, "together; only hover_w is given"),
        ({"hover_w": 100, "battery_wh": 50}, "only hover_w and battery_wh"),
    ],
)
def test_what_is_no_vehicle_is_refused_in_a_sentence(tmp_path: Path, content: Any, message: str) -> None:
    with pytest.raises(ParameterError, match=message) as caught:
        read_vehicle(write(tmp_path, content))
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError):
        read_vehicle(tmp_path / "none.json")
