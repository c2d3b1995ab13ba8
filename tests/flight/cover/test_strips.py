"""Lines of strips: they cover a cell, reach no farther than they must, and are evenly spaced."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from tests.flight.cover.cover_fields import fields
from uavseg.errors import MissionError, ParameterError
from uavseg.flight.cover.lines import WIDTH_SLACK, strip_lines
from uavseg.flight.cover.survey import monotone_cells


def uncovered(polygon: shapely.Polygon, lines: np.ndarray, spacing: float, reach: float = 0.0) -> float:
    """Share of a polygon outside of the swaths of lines along x."""
    longer = lines + np.array([[-reach - 1e-6, 0], [reach + 1e-6, 0]])
    swaths = shapely.buffer(shapely.linestrings(longer), spacing / 2 + 1e-6, cap_style="flat")
    return float(shapely.difference(polygon, shapely.union_all(swaths)).area / polygon.area)


@pytest.mark.slow
@given(fields(), st.floats(4, 40), st.floats(0, 30))
@settings(max_examples=60)
def test_swaths_of_the_lines_cover_the_cell(field: shapely.Polygon, spacing: float, reach: float) -> None:
    for cell in monotone_cells(field):
        lines = strip_lines(cell, spacing, reach)
        assert uncovered(cell, lines, (1 + WIDTH_SLACK) * spacing, reach) <= 1e-6
        assert np.allclose(
            np.diff(lines[:, :, 1], axis=0), lines[1, 0, 1] - lines[0, 0, 1] if len(lines) > 1 else 0
        )
        assert (lines[:, 1, 0] >= lines[:, 0, 0]).all()
        longer = strip_lines(cell, spacing)
        assert (np.ptp(lines[:, :, 0], axis=1) <= np.ptp(longer[:, :, 0], axis=1) + 1e-9).all()


@given(fields(), st.floats(4, 40))
@settings(max_examples=40)
def test_lines_stay_within_half_a_spacing_of_the_cell(field: shapely.Polygon, spacing: float) -> None:
    for cell in monotone_cells(field):
        allowed = shapely.buffer(cell, spacing / 2 + 0.05, quad_segs=32)
        assert shapely.covers(allowed, shapely.linestrings(strip_lines(cell, spacing))).all()


def test_a_tooth_between_two_lines_gets_a_line_of_its_own() -> None:
    comb = shapely.box(0, 0, 100, 20) | shapely.box(41, 20, 44, 60)
    lines = strip_lines(comb, 20)
    assert len(lines) == 3 and uncovered(comb, lines, 20) < 1e-9


@pytest.mark.parametrize("spacing", [0, -1, math.nan, math.inf])
def test_a_spacing_that_is_none_is_refused(spacing: float) -> None:
    with pytest.raises(ParameterError, match="spacing"):
        strip_lines(shapely.box(0, 0, 1, 1), spacing)


def test_more_lines_than_a_mission_holds_are_refused() -> None:
    with pytest.raises(MissionError, match="wider spacing"):
        strip_lines(shapely.box(0, 0, 1000, 1000), 0.01)
