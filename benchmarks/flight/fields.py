"""Fields to fly over: drawn shapes, regions of the samples, and many regions with keep-out zones."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from pyproj import Proj

SAMPLES = Path(__file__).resolve().parents[2] / "samples"
HOME = (47.0, 8.0, 430.0)
_FLAT = Proj(proj="aeqd", lat_0=HOME[0], lon_0=HOME[1], datum="WGS84")


@dataclass(frozen=True, slots=True)
class Field:
    """Regions in degrees (lon, lat), and where the vehicle starts.

    Parameters
    ----------
    name : str
    polygons : tuple of shapely Polygon
    home : (lat, lon) or (lat, lon, altitude_m)
    zones : tuple of shapely Polygon
        Where it may not fly.
    """

    name: str
    polygons: tuple[Any, ...]
    home: tuple[float, ...] = HOME
    zones: tuple[Any, ...] = ()

    @property
    def points(self) -> list[tuple[float, float]]:
        """A point inside each region."""
        found = shapely.get_coordinates(shapely.point_on_surface(list(self.polygons)))
        return [(float(lon), float(lat)) for lon, lat in found]


def degrees(polygon: Any) -> Any:
    """A polygon in metres east and north of home, in degrees."""
    return shapely.transform(polygon, lambda xy: np.column_stack(_FLAT(*xy.T, inverse=True)))


def metres(geometry: Any) -> Any:
    """A geometry in degrees, in metres east and north of home."""
    return shapely.transform(geometry, lambda lonlat: np.column_stack(_FLAT(*lonlat.T)))


def drawn() -> list[Field]:
    """Shapes that are hard to cover: concave ones, holes, and several regions."""
    comb = shapely.union_all(
        [shapely.box(60, 60, 360, 100), *(shapely.box(x, 60, x + 30, 260) for x in range(60, 360, 60))]
    )
    angle = np.linspace(0, 5 * np.pi, 160)
    spiral = shapely.LineString(
        np.column_stack([np.cos(angle), np.sin(angle)]) * (20 + 8 * angle)[:, None] + 260
    )
    letter = shapely.union_all(
        [shapely.box(60, 60, 100, 300), shapely.box(60, 60, 240, 100), shapely.box(60, 160, 180, 200)]
    )
    ring = shapely.difference(shapely.Point(260, 220).buffer(150), shapely.Point(240, 230).buffer(60))
    return [
        Field("rectangle", (degrees(shapely.box(60, 60, 360, 210)),)),
        Field("triangle", (degrees(shapely.Polygon([(60, 60), (380, 120), (140, 330)])),)),
        Field("letter E", (degrees(letter),)),
        Field("comb", (degrees(comb),)),
        Field("ring", (degrees(ring),)),
        Field("spiral", (degrees(spiral.buffer(11)),)),
        Field("12 ponds", tuple(map(degrees, ponds(12, seed=3)))),
    ]


def of_sample(name: str, low: float, min_area_m2: float) -> Field:
    """The regions of a sample image that are brighter than a value; home lies to their south-west."""
    import uavseg

    regions = uavseg.extract(SAMPLES / name, range=(low, 1), min_area=f"{min_area_m2:g}")
    frame = regions.to_crs(4326)
    west, south, _, _ = frame.total_bounds
    return Field(Path(name).stem, tuple(frame.geometry), (south - 2e-4, west - 2e-4, 100.0))


def ponds(count: int, seed: int, side_m: float = 900.0) -> list[Any]:
    """Round, uneven regions that do not touch, in metres."""
    draw = np.random.default_rng(seed)
    found: list[Any] = []
    while len(found) < count:
        middle, radius = draw.uniform(40, side_m, 2), draw.uniform(10, 30)
        angles = np.linspace(0, 2 * np.pi, 14, endpoint=False)
        sizes = radius * draw.uniform(0.7, 1.3, 14)
        pond = shapely.Polygon(middle + np.column_stack([np.cos(angles), np.sin(angles)]) * sizes[:, None])
        if all(shapely.distance(pond, other) > 8 for other in found):
            found.append(pond)
    return found


def many(regions: int, zones: int, seed: int = 0) -> Field:
    """Regions with keep-out zones between them; home, at the origin, is free."""
    side = 1000 * (regions / 50) ** 0.5 + 200
    drawn_all = ponds(regions + zones, seed, side)
    order = np.random.default_rng(seed).permutation(len(drawn_all))
    shapes = [degrees(drawn_all[k]) for k in order]
    name = f"{regions} regions" + (f", {zones} zones" if zones else "")
    return Field(name, tuple(shapes[:regions]), HOME, tuple(shapes[regions:]))
