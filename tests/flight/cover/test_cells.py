"""Cells: they partition the polygon, every sweep line meets each once, and simple shapes get few."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings

from tests.flight.cover.cover_fields import fields
from uavseg.flight.cover.survey import monotone_cells


@given(fields())
@settings(max_examples=80)
def test_cells_partition_the_polygon(field: shapely.Polygon) -> None:
    cells = monotone_cells(field)
    assert sum(cell.area for cell in cells) == pytest.approx(field.area)
    assert shapely.union_all(cells).symmetric_difference(field).area < 1e-4


@pytest.mark.slow
@given(fields())
@settings(max_examples=80)
def test_every_line_meets_a_cell_in_one_piece(field: shapely.Polygon) -> None:
    for cell in monotone_cells(field):
        west, south, east, north = cell.bounds
        for y in np.linspace(south, north, 13)[1:-1]:
            met = cell.intersection(shapely.LineString([(west - 1, y), (east + 1, y)]))
            pieces = [piece for piece in shapely.get_parts(met) if piece.length > 1e-3]
            assert len(pieces) <= 1


@pytest.mark.parametrize(
    ("polygon", "count"),
    [
        (shapely.box(0, 0, 5, 5), 1),
        (shapely.Polygon([(0, 0), (10, 0), (10, 4), (4, 4), (4, 10), (0, 10)]), 1),  # an L
        (shapely.Polygon([(0, 0), (4, 0), (4, 6), (10, 6), (10, 10), (0, 10)]), 1),
        (shapely.box(0, 0, 9, 9) - shapely.box(3, 3, 6, 6), 4),
        (shapely.box(0, 0, 9, 9) - shapely.Point(4.5, 4.5).buffer(2), 4),
        (shapely.Polygon([(0, 0), (10, 0), (5, 2), (10, 4), (0, 4)]), 1),  # a notch at the side
        (shapely.Polygon([(0, 0), (10, 0), (10, 9), (5, 3), (0, 9)]), 3),  # a notch from above
    ],
)
def test_simple_shapes_have_few_cells(polygon: shapely.Polygon, count: int) -> None:
    assert len(monotone_cells(polygon)) == count
