"""Zones that are left out change no shortest way."""

import numpy as np
import shapely
from hypothesis import assume, given, strategies as st

from uavseg.flight.avoid.free_space import FreeSpace
from uavseg.flight.safety.keep_out import near_zones

PLACES = st.lists(st.tuples(st.integers(0, 60), st.integers(0, 60)), min_size=2, max_size=4, unique=True)
BOXES = st.lists(
    st.tuples(st.integers(-80, 120), st.integers(-80, 120), st.integers(1, 60), st.integers(1, 60)),
    max_size=6,
)


@given(PLACES, BOXES)
def test_shortest_ways_are_as_long_as_among_all_zones(
    places: list[tuple[int, int]], boxes: list[tuple[int, int, int, int]]
) -> None:
    zones = [shapely.box(x, y, x + width, y + height) for x, y, width, height in boxes]
    points = np.array(places, float)
    assume(FreeSpace(obstacles=[shapely.union_all(zones)]).is_free(points).all())
    near = near_zones(zones, shapely.points(points), 0.0)
    lengths = [
        FreeSpace(obstacles=[shapely.union_all(some)] if some else []).lengths_from(points[0], points)
        for some in (zones, near)
    ]
    assert np.allclose(*lengths)
    assert [zone for zone in zones if any(zone is one for one in near)] == near


def test_a_zone_counts_where_another_one_leads_the_way_to_it() -> None:
    wall, beside, far = (
        shapely.box(40, -300, 60, 80),
        shapely.box(70, 60, 90, 100),
        shapely.box(40, 400, 60, 500),
    )
    places = shapely.points([[0, 0], [100, 0]])
    assert near_zones([far, beside, wall], places, 0) == [beside, wall]
    assert near_zones([far, beside], places, 0) == []
    assert near_zones([far, beside], places, 60) == [beside]
