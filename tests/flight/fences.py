"""Fences and rally points near Sydney."""

import math

from hypothesis import strategies as st

from uavseg.flight.mission.items import FenceCircle, FencePolygon, RallyPoint

BOX = FencePolygon(((-33.87, 151.2), (-33.87, 151.23), (-33.84, 151.23), (-33.84, 151.2)), True)
KEEP_OUT = FencePolygon(((-33.852, 151.212), (-33.852, 151.214), (-33.85, 151.213)), False)
FENCE = (BOX, FenceCircle(-33.85, 151.21, 40.5, False), KEEP_OUT)
RALLY = (RallyPoint(-33.855, 151.214, 30.0), RallyPoint(-33.85, 151.22, 45.5))


def star(lat: float, lon: float, radii: list[float], inclusion: bool) -> FencePolygon:
    """A polygon around a centre, counter-clockwise, with these distances of its vertices in degrees."""
    angles = [2 * math.pi * n / len(radii) for n in range(len(radii))]
    vertices = ((lat + r * math.sin(a), lon + r * math.cos(a)) for r, a in zip(radii, angles, strict=True))
    return FencePolygon(tuple(vertices), inclusion)


_lat, _lon = st.floats(-33.9, -33.8), st.floats(151.1, 151.3)
_polygons = st.builds(
    star, _lat, _lon, st.lists(st.floats(0.001, 0.01), min_size=3, max_size=9), st.booleans()
)
_circles = st.builds(FenceCircle, _lat, _lon, st.floats(0.1, 5000), st.booleans())
fences = st.lists(_polygons | _circles, max_size=5)
rally_points = st.lists(st.builds(RallyPoint, _lat, _lon, st.floats(0.1, 1000)), max_size=3)
