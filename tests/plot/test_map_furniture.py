"""Scale bar and north arrow: round lengths and readable units."""

from hypothesis import given
from hypothesis import strategies as st

from uavseg.plot import map_furniture


@given(st.floats(1e-3, 1e8))
def test_the_scale_bar_is_round_and_takes_a_tenth_to_a_quarter(span: float) -> None:
    length = map_furniture.bar_length(span)
    assert span / 10 * (1 - 1e-9) <= length <= span / 4 * (1 + 1e-9)
    assert f"{length:.6e}"[0] in "125" and set(f"{length:.6e}"[1:8]) <= {".", "0"}
