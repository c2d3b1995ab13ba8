"""The best azimuths of surveys: no whole degree is cheaper, over one region or several; orders are short."""

import math
from importlib.util import find_spec

import numpy as np
import pytest
import shapely

from benchmarks.flight.angles import SimpleGrid, closed_groups, exact_m
from tests.flight.small_regions import degrees, inside
from uavseg.flight.avoid.free_space import FreeSpace
from uavseg.flight.cover.lines import OrderParams, SurveyLines, fly_lines
from uavseg.flight.cover.survey import CoverParams, Survey, surveys
from uavseg.flight.mission.estimate import estimate
from uavseg.flight.params.plan import PlanParams, SurveyParams
from uavseg.flight.planning.planner import plan_missions

HOME = (-60.0, -60.0)
SHAPES = {
    "L": shapely.union(shapely.box(0, 0, 150, 45), shapely.box(0, 0, 45, 150)),
    "trapezium": shapely.Polygon([(0, 0), (170, 20), (120, 110), (20, 90)]),
}


def length_from_home_m(flown: Survey) -> float:
    """Length from home, over the region and back, with 10 m for each turn but those at its ends."""
    xy = np.concatenate([[HOME], flown.path()[0], [HOME]])
    return float(np.hypot(*np.diff(xy, axis=0).T).sum()) + 10 * (len(xy) - 4)


@pytest.mark.slow
@pytest.mark.parametrize("name", SHAPES)
def test_no_whole_degree_is_cheaper_than_the_azimuth_that_is_found(name: str) -> None:
    def cost(angle: float | None) -> float:
        found = surveys(SHAPES[name], CoverParams(20, angle, tries=30, home=HOME))
        return min(map(length_from_home_m, found))

    assert cost(None) <= min(cost(angle) for angle in range(0, 180, 5)) + 1e-6


@pytest.mark.slow
def test_the_first_survey_is_the_cheapest() -> None:
    found = surveys(SHAPES["L"], CoverParams(20, tries=30, home=HOME))
    assert length_from_home_m(found[0]) <= min(map(length_from_home_m, found)) + 20  # of both directions


@pytest.mark.slow
@pytest.mark.skipif(find_spec("ortools") is None, reason="OR-tools is not installed")
@pytest.mark.parametrize("seed", range(4))
def test_orders_of_lines_are_within_two_per_cent_of_the_shortest(seed: int) -> None:
    draw = np.random.default_rng(seed)
    starts = draw.uniform(0, 200, (14, 2))
    lines = np.stack([starts, starts + draw.uniform(10, 60, (14, 1)) * [1.0, 0.0]], axis=1)
    (_, outer, legs), *_ = fly_lines(
        SurveyLines(90.0, tuple(line[None] for line in lines)), FreeSpace(), OrderParams()
    )
    flown = sum(float(shapely.LineString(path).length) for path in (*outer, *legs))
    ends = lines.reshape(-1, 2)
    grid = SimpleGrid(lines, np.arange(14), np.hypot(*(ends[:, None] - ends).transpose(2, 0, 1)))
    best = exact_m(grid)
    assert best - 1e-6 <= flown <= 1.02 * best
    assert exact_m(grid, best - 1) == math.inf


def test_groups_are_connected_nodes() -> None:
    assert sorted(map(sorted, closed_groups(5, [(0, 3), (3, 1), (2, 4)]))) == [[0, 1, 3], [2, 4]]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_several_fields_take_no_longer_than_with_one_azimuth_for_all(seed: int) -> None:
    draw = np.random.default_rng(seed)
    count, turn = int(draw.integers(2, 6)), float(draw.uniform(0, 180))
    corners = draw.uniform(0, 300, (count, 2)) + [[0, 400 * k] for k in range(count)]
    boxes = shapely.box(*corners.T, *(corners + draw.uniform(40, 300, (count, 2))).T)
    fields = [degrees(shapely.affinity.rotate(box, turn, (0, 0))) for box in boxes.tolist()]

    def duration_s(angle: float | None) -> float:
        params = PlanParams(60.0, "survey", 30.0, angle, how=SurveyParams())
        found = plan_missions(fields, inside(fields), params, (47.0, 8.0, 400.0))
        return sum(estimate(mission).duration_s for mission in found)

    assert duration_s(None) <= min(duration_s((15 * k + turn) % 180) for k in range(12))
