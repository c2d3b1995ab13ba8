"""Geofence and rally points: areas to stay inside or outside of, and places to return to in an emergency."""

import math

import shapely

from uavseg.dataclass import dataclass
from uavseg.errors import MissionError
from uavseg.flight.mission.items import MAX_DISTANCE_M, MAX_HEIGHT_M, check_position

Position = tuple[float, float]  # lat, lon in degrees, WGS 84


@dataclass(frozen=True, slots=True)
class FencePolygon:
    """A polygon that the vehicle must stay inside or outside of.

    The vertices, degrees (WGS 84), are stored clockwise, as QGroundControl asks for, and without a repetition
    of the first. A MissionError says that a vertex is not on Earth, that there are fewer than three, or that
    the outline is not simple.
    """

    vertices: tuple[Position, ...]
    inclusion: bool = True  # whether the vehicle stays inside; False is a keep-out zone

    def __post_init__(self) -> None:
        vertices = tuple((float(lat), float(lon)) for lat, lon in self.vertices)
        for lat, lon in vertices:
            check_position(lat, lon, "a vertex of the fence")
        if len(vertices) > 1 and vertices[0] == vertices[-1]:
            vertices = vertices[:-1]
        if len(set(vertices)) < 3:
            raise MissionError(
                f"a fence polygon has at least three vertices; this one has {len(set(vertices))}"
            )
        object.__setattr__(self, "vertices", _clockwise(vertices))

    @property
    def positions(self) -> tuple[Position, ...]:
        """The vertices."""
        return self.vertices


@dataclass(frozen=True, slots=True)
class FenceCircle:
    """A circle that the vehicle must stay inside or outside of.

    A MissionError says that the centre is not on Earth, or the radius not above 0 and at most 100 km.
    """

    lat: float  # of the centre, in degrees, WGS 84
    lon: float
    radius_m: float
    inclusion: bool = True  # whether the vehicle stays inside; False is a keep-out zone

    def __post_init__(self) -> None:
        check_position(self.lat, self.lon, "the centre of a fence")
        if not 0 < self.radius_m <= MAX_DISTANCE_M:
            raise MissionError(
                f"the radius of a fence is above 0 and at most {MAX_DISTANCE_M:g} m, not {self.radius_m:g}"
            )

    @property
    def positions(self) -> tuple[Position, ...]:
        """The centre."""
        return ((self.lat, self.lon),)


@dataclass(frozen=True, slots=True)
class RallyPoint:
    """A place to which the vehicle may return instead of home.

    A MissionError says that it is not on Earth, or the altitude not above 0 and at most 1000 m.
    """

    lat: float  # degrees, WGS 84
    lon: float
    altitude_m: float  # above home

    def __post_init__(self) -> None:
        check_position(self.lat, self.lon, "a rally point")
        if not (math.isfinite(self.altitude_m) and 0 < self.altitude_m <= MAX_HEIGHT_M):
            raise MissionError(
                f"a rally point is above home by more than 0 and at most {MAX_HEIGHT_M:g} m, "
                f"not {self.altitude_m:g}"
            )

    @property
    def positions(self) -> tuple[Position, ...]:
        """Its position."""
        return ((self.lat, self.lon),)


Fence = FencePolygon | FenceCircle


def _clockwise(vertices: tuple[Position, ...]) -> tuple[Position, ...]:
    """Return the vertices clockwise as seen from above, from the same first one; refuse rings not simple."""
    first = vertices[0][1]
    unwrapped = [(first + (lon - first + 180) % 360 - 180, lat) for lat, lon in vertices]  # antimeridian
    ring = shapely.LinearRing(unwrapped)
    if not ring.is_simple:
        raise MissionError("the outline of a fence polygon crosses or touches itself")
    return (vertices[0], *vertices[:0:-1]) if ring.is_ccw else vertices
