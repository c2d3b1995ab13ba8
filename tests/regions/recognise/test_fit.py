"""Fits of outlines to what was seen: laws of the likelihood and of its integral."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from uavseg.regions.recognise.fit import (
    Evidence,
    Outline,
    evidence_of_cells,
    log_evidence,
    smooth_contour,
    solid_cells,
)

SQUARE = shapely.box(0, 0, 2, 2)
BAR = shapely.box(0, 0, 6, 1)
ELL = shapely.Polygon([(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)])
SHAPES = {"square": SQUARE, "bar": BAR, "ell": ELL, "disc": shapely.Point(0, 0).buffer(1, quad_segs=32)}
OUTLINES = {name: Outline.of(shape) for name, shape in SHAPES.items()}


def moved(shape: shapely.Polygon, turn: float, size: float, x: float, y: float) -> shapely.Polygon:
    c, s = size * math.cos(turn), size * math.sin(turn)
    return shapely.affinity.affine_transform(shape, [c, -s, s, c, x, y])


def best_name(evidence: Evidence) -> str:
    return max(OUTLINES, key=lambda name: log_evidence(OUTLINES[name], evidence)[0])


@pytest.mark.slow
@settings(max_examples=8, deadline=None)
@given(
    st.sampled_from(sorted(SHAPES)),
    st.floats(0, math.tau),
    st.floats(0.01, 1e4),
    st.floats(-1e3, 1e3),
    st.floats(-1e3, 1e3),
)
def test_whole_outlines_are_recognised_at_any_pose(
    name: str, turn: float, size: float, x: float, y: float
) -> None:
    evidence = Outline.of(moved(SHAPES[name], turn, size, x, y)).as_evidence()
    assert best_name(evidence) == name
    assert -0.25 < log_evidence(OUTLINES[name], evidence)[1] / evidence.surface[:, 2].sum() <= 0


def test_an_outline_has_no_pose() -> None:
    one, other = OUTLINES["ell"], Outline.of(moved(ELL, 0.0, 40.0, 5.0, -7.0))
    assert np.allclose(one.corners, other.corners) and np.allclose(one.distances, other.distances)
    assert shapely.Polygon(one.corners).area == pytest.approx(1, rel=0.01)


def seen_from_the_left(probabilities: np.ndarray) -> np.ndarray:
    """Cells of a solid as rays along rows see it: free, then a band of surface, then unknown."""
    seen = np.full(probabilities.shape, 0.5)
    for row, solid in enumerate(probabilities > 0.5):
        first = int(np.argmax(solid)) if solid.any() else len(solid)
        seen[row, :first] = 0.1
        seen[row, first : first + 2] = 0.9
    return seen


def drawn(shape: shapely.Polygon, cells: int = 80) -> np.ndarray:
    x, y = np.meshgrid(np.arange(cells) + 0.5, np.arange(cells, 0, -1) - 0.5)
    return np.where(shapely.contains_xy(shape, x, y), 1.0, 0.0)


@pytest.mark.parametrize("name", ["disc", "bar"])
def test_half_of_an_outline_is_enough_where_the_rest_is_hidden(name: str) -> None:
    seen = seen_from_the_left(drawn(moved(SHAPES[name], 2.0, {"disc": 20, "bar": 8}[name], 40, 30)))
    evidence = evidence_of_cells(seen, np.ones(seen.shape, bool), 1.0)
    assert evidence is not None
    assert best_name(evidence) == name


def test_outline_in_unknown_space_costs_nothing_and_in_free_space_it_does() -> None:
    seen = seen_from_the_left(drawn(moved(SHAPES["disc"], 0.0, 20.0, 40.0, 40.0)))
    hidden = evidence_of_cells(seen, np.ones(seen.shape, bool), 1.0)
    known = evidence_of_cells(np.where(seen == 0.5, 0.1, seen), np.ones(seen.shape, bool), 1.0)
    assert hidden is not None and known is not None
    assert log_evidence(OUTLINES["disc"], hidden)[1] > log_evidence(OUTLINES["disc"], known)[1] + 10


def test_evidence_does_not_depend_on_the_unit_of_length() -> None:
    seen = seen_from_the_left(drawn(moved(ELL, 1.0, 10.0, 40.0, 40.0)))
    metres, millimetres = (evidence_of_cells(seen, np.ones(seen.shape, bool), cell) for cell in (0.05, 50.0))
    assert metres is not None and millimetres is not None
    one, other = log_evidence(OUTLINES["ell"], metres), log_evidence(OUTLINES["ell"], millimetres)
    assert one == pytest.approx(other, abs=0.02)


def test_the_same_evidence_gives_the_same_bits() -> None:
    evidence = OUTLINES["ell"].as_evidence()
    assert len({log_evidence(OUTLINES["ell"], evidence) for _ in range(3)}) == 1


def test_nothing_occupied_is_no_evidence() -> None:
    assert evidence_of_cells(np.full((9, 9), 0.5), np.ones((9, 9), bool), 1.0) is None


def test_solid_cells_are_those_connected_without_free_ones() -> None:
    cells = np.full((7, 9), 0.1)
    cells[2:5, 1:4], cells[3, 2], cells[2:5, 6:8] = 0.9, 0.5, 0.9
    seeds = np.zeros(cells.shape, bool)
    seeds[2, 1] = True
    solid = solid_cells(cells, seeds)
    assert solid.sum() == 9 and solid[2:5, 1:4].all()


def test_a_contour_encloses_cells_and_is_none_at_the_border() -> None:
    cells = np.zeros((30, 30), bool)
    cells[10:20, 5:25] = True
    ring = smooth_contour(cells)
    assert ring is not None
    assert shapely.Polygon(ring).area == pytest.approx(200, rel=0.03)
    assert shapely.Polygon(ring).centroid.coords[0] == pytest.approx((15, 15), abs=0.01)
    cells[10, :] = True
    assert smooth_contour(cells) is None
