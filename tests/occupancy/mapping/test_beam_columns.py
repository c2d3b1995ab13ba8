"""Traversal by whole columns: the same cells, the same log-odds as the traversal from cell to cell."""

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tests.occupancy import plain_beams
from uavseg.occupancy.mapping.beams import can_step_by_column
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.mapping.scan import Pose, Scan

ANGLES = st.floats(-math.pi, math.pi, exclude_min=True)


@pytest.mark.parametrize("octant", range(8))
@settings(max_examples=15)
@given(st.floats(0.01, 0.99), st.floats(40, 60), st.floats(40, 60), st.floats(20, 200))
def test_long_beams_in_every_octant_cross_the_same_cells(
    octant: int, share: float, x: float, y: float, distance: float
) -> None:
    grid = OccupancyGrid.empty((101, 103), 1.0)
    plain = grid.log_odds.copy()
    angle = (octant + share) * math.pi / 4
    scan = Scan(Pose(x, y), np.full(3, angle), np.array([math.inf, distance, math.inf]), 150.0, 0.4)
    window = grid.merge(scan)
    touched = plain_beams.merge(grid, plain, scan)
    assert (grid.log_odds == plain).all() and (grid.log_odds < 0).sum() > 15
    rows, cols = zip(*touched, strict=True)
    assert (window.row, window.col) == (min(rows), min(cols))
    assert (window.rows, window.cols) == (max(rows) - min(rows) + 1, max(cols) - min(cols) + 1)


@given(st.floats(-100, 100), st.floats(-100, 100), ANGLES)
def test_beams_along_an_axis_or_a_diagonal_go_from_cell_to_cell(x: float, y: float, angle: float) -> None:
    du, dv = math.cos(angle), math.sin(angle)
    expected = min(abs(du), abs(dv)) > 2e-9 and abs(abs(du) - abs(dv)) > 2e-9
    if expected:
        assert can_step_by_column(x, y, du, dv)
    for step in ((1.0, 0.0), (0.0, -1.0), (-0.6, 0.6), (du, du)):
        assert not can_step_by_column(x, y, *step)
