"""Scale bar and north arrow: round lengths and readable units."""

import pytest
from hypothesis import given, strategies as st

from uavseg.plot.page import page as map_furniture


@given(st.floats(1e-3, 1e8))
def test_the_scale_bar_is_round_and_takes_a_tenth_to_a_quarter(span: float) -> None:
    length = map_furniture.bar_length(span)
    assert span / 10 * (1 - 1e-9) <= length <= span / 4 * (1 + 1e-9)
    assert f"{length:.6e}"[0] in "125" and set(f"{length:.6e}"[1:8]) <= {".", "0"}


@given(st.floats(1e-3, 1e9), st.sampled_from(["m", "px", "units"]))
def test_a_length_is_readable_and_right(length: float, unit: str) -> None:
    number, name = map_furniture.length_text(length, unit).split()
    metres = {"km": 1000, "m": 1, "cm": 0.01}.get(name, 1)
    assert float(number) * metres == pytest.approx(length, rel=1e-5)
    assert unit == "m" or name == unit


@given(st.floats(0.5, 1e12))
def test_an_area_is_readable_and_right(area_m2: float) -> None:
    number, name = map_furniture.area_text(area_m2).split()
    factor = {"m²": 1, "ha": 1e4, "km²": 1e6}[name]
    assert float(number) * factor == pytest.approx(area_m2, rel=6e-3, abs=0.5)
