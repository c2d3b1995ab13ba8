"""Fields to cover: random polygons with holes."""

import math

import numpy as np
import shapely
from hypothesis import strategies as st


@st.composite
def fields(draw: st.DrawFn) -> shapely.Polygon:
    """A star-shaped polygon of some 100 m with up to two holes."""
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    count = draw(st.integers(3, 12))
    turns = np.sort(rng.random(count)) * 2 * math.pi
    radii = 30 + 70 * rng.random(count)
    field = shapely.make_valid(
        shapely.Polygon(np.column_stack([radii * np.cos(turns), radii * np.sin(turns)]))
    )
    for _ in range(draw(st.integers(0, 2))):
        field = field - shapely.Point(*(rng.random(2) * 80 - 40)).buffer(3 + 15 * rng.random())
    parts = [part for part in shapely.get_parts(field) if part.geom_type == "Polygon"]
    return max(parts, key=lambda part: part.area)
