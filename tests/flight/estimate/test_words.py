"""Estimates in words."""

import math

import pytest

from uavseg.flight.mission.estimate import duration_text, estimate_text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0, "about 0 min 00 s"), (59.6, "about 1 min 00 s"), (3725, "about 62 min 05 s")]
    + [(without, "without end") for without in (math.inf, math.nan, None)],
)
def test_durations(seconds: float | None, text: str) -> None:
    assert duration_text(seconds) == text


def test_length_and_duration() -> None:
    assert estimate_text(1234, 61) == "1.23 km, about 1 min 01 s"
    assert estimate_text(0, math.inf) == "0.00 km, without end"
