"""Missions along a line."""

from tests.flight.small_regions import box, planned


def test_an_unknown_altitude_of_home_is_said() -> None:
    assert "written as 0" in planned([box(0, 0, 50, 50)], home=(47.0, 8.0)).warnings[0]
