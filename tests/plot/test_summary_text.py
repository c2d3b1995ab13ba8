"""Bars of the text report: as long as their share, to an eighth of a character."""

from hypothesis import given, strategies as st

from uavseg.plot.summary_text import text_bar

EIGHTHS = " ▏▎▍▌▋▊▉█"


@given(st.floats(0, 1), st.integers(1, 80))
def test_a_bar_is_as_long_as_its_share(share: float, width: int) -> None:
    bar = text_bar(share, width)
    eighths = sum(EIGHTHS.index(character) for character in bar)
    assert abs(eighths - 8 * width * share) <= 0.5
    assert len(bar) <= width and set(bar[:-1]) <= {"█"}
