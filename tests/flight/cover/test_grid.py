"""Lines of one grid: they cover the polygon, a cell has one line in each strip, and they are few."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from tests.flight.cover.cover_fields import fields
from tests.flight.cover.test_strips import uncovered
from uavseg.flight.cover.lines import WIDTH_SLACK, grid_lines


def never(starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    return np.zeros(len(starts), bool)


def always(starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    return np.ones(len(starts), bool)


@pytest.mark.slow
@given(fields(), st.floats(4, 40), st.floats(0, 30), st.sampled_from([never, always]))
@settings(max_examples=60)
def test_lines_cover_the_polygon(field: shapely.Polygon, spacing: float, reach: float, joins: object) -> None:
    cells = grid_lines(field, spacing, (reach, 5.0), joins)  # type: ignore[arg-type]
    assert uncovered(field, np.concatenate(cells), (1 + WIDTH_SLACK) * spacing, reach) <= 1e-6


@given(fields(), st.floats(4, 40))
@settings(max_examples=40)
def test_cells_have_neighbouring_lines_only(field: shapely.Polygon, spacing: float) -> None:
    _, south, _, north = field.bounds
    most = int(np.ceil((north - south) / spacing))
    for cell in grid_lines(field, spacing, (0.0, 5.0), never):
        steps = np.diff(cell[:, 0, 1])
        assert (steps > 0).all() and np.allclose(steps, steps[0] if len(steps) else 0)
        assert len(cell) <= most and (steps <= spacing * (1 + 2 * WIDTH_SLACK)).all()


def test_holes_cost_no_more_lines_than_the_field_is_high() -> None:
    field = shapely.box(0, 0, 120, 100) - shapely.Point(60, 47).buffer(13)
    heights = {
        round(y, 6) for cell in grid_lines(field, 10, (0.0, 5.0), never) for y in cell[:, 0, 1].tolist()
    }
    assert heights == {5.0 + 10 * k for k in range(10)}
