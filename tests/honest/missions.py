"""Missions: what is written, read by other readers, is what was asked for, and covers the regions."""

import csv
import json
import re
import warnings
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any
from xml.etree import ElementTree

import geopandas
import numpy as np
import shapely
from pymavlink import mavwp
from pyproj import Transformer
from shapely.affinity import rotate

from tests.honest.findings import RefusedError, command, differ, far
from tests.hostile.judging import Finding

SUFFIXES = ("geojson", "gpkg", "fgb", "shp", "kml")
HOMES = (
    *((15.0, 40.6), (-122.8, 49.4), (25.0, 69.9), (-70.0, -53.0), (0.0, 0.0), (151.2, -33.9)),
    *((179.9995, -17.0), (-179.9995, 52.0)),
)
NAMESPACE = {"k": "http://www.opengis.net/kml/2.2", "w": "http://www.dji.com/wpmz/1.0.2"}
Places = list[tuple[float, float, float]]


@dataclass
class Asked:
    """Regions in metres around an origin, and how they are flown."""

    origin: tuple[float, float]
    shapes: list[Any]
    home: tuple[float, float]
    altitude: int
    speed: float
    pattern: str
    zones: list[Any] = field(default_factory=list)

    @property
    def local(self) -> str:
        """Metres east and north of the origin, on the ellipsoid."""
        return f"+proj=aeqd +lat_0={self.origin[1]} +lon_0={self.origin[0]} +ellps=WGS84"

    def degrees(self, shape: Any) -> Any:
        """A shape in longitude and latitude."""
        return shapely.transform(shape, lambda xy: _moved(xy, self.local, "EPSG:4326"))

    def metres(self, lon_lat: Any) -> Any:
        """Positions in metres."""
        return _moved(np.asarray(lon_lat, float).reshape(-1, 2), "EPSG:4326", self.local)

    def length_m(self, places: Places) -> float:
        """Length of a flight from home to home."""
        return float(shapely.LineString(self.metres([place[:2] for place in (*places, places[0])])).length)


def _moved(xy: Any, source: str, target: str) -> Any:
    return np.column_stack(Transformer.from_crs(source, target, always_xy=True).transform(xy[:, 0], xy[:, 1]))


def case(rng: Random, folder: Path) -> Iterator[Finding]:
    """A few fields, flown by some pattern, from two formats of regions and to two formats of missions."""
    requested = any_asked(rng)
    first, second = rng.sample(SUFFIXES, 2)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pyogrio, of what a format does not hold
        write_regions(requested.shapes, requested, folder / f"r.{first}")
        write_regions(requested.shapes, requested, folder / f"s.{second}")
        if requested.zones:
            write_regions(requested.zones, requested, folder / "zones.geojson")
    words = words_of(rng, requested)
    command("plan", f"r.{first}", "-o", "a.plan", *words)
    if not (folder / "a.plan").exists():
        return  # it is flown in several flights
    about = requested.pattern
    plan = json.loads((folder / "a.plan").read_text())
    flown = positions(plan)
    yield from as_asked(plan, flown, requested, words, about)
    suffix = rng.choice(sorted(READERS))
    try:
        command("plan", f"r.{first}", "-o", f"a.{suffix}", *words)
        yield from same_places(
            READERS[suffix](folder / f"a.{suffix}", requested), flown, f"{suffix} of {about}"
        )
    except RefusedError as error:
        if not re.search("Litchi flies|of DJI holds 2 to", str(error)):  # 2 waypoints, 0.6 m apart
            raise
    command("plan", f"s.{second}", "-o", "b.plan", *words)
    other = positions(json.loads((folder / "b.plan").read_text()))
    names = f"regions as {' and '.join(sorted((first, second)))}, {about}"
    if list(same_places(other, flown, names, 2e-7)):  # of two routes of about one length either may be taken
        yield from far("SAME FLIGHT", names, requested.length_m(other), requested.length_m(flown), 0.02)


def any_asked(rng: Random) -> Asked:
    """Rectangles, triangles and rings near a home."""
    origin = rng.choice(HOMES)
    shapes = []
    for n in range(rng.randint(1, 4)):
        width, height = rng.randint(30, 160), rng.randint(30, 160)
        shape = shapely.box(0, 0, width, height)
        kind = rng.randrange(4)
        if kind == 1:
            shape = shapely.Polygon([(0, 0), (width, 0), (0, height)])
        elif kind == 2:
            shape = shape.difference(shapely.box(0.2 * width, 0.3 * height, 0.5 * width, 0.7 * height))
        elif kind == 3:
            shape = shape.difference(shapely.box(width / 2, height / 2, width, height))
        shape = rotate(shape, rng.choice([0, 0, 17, 45, 80]), "center")
        shapes.append(
            shapely.transform(shape, lambda xy, n=n: xy + np.array([60 + 260 * (n % 2), 40 + 260 * (n // 2)]))
        )
    requested = Asked(
        origin=origin,
        shapes=shapes,
        home=origin,
        altitude=rng.choice([30, 60, 100]),
        speed=rng.choice([3.0, 5.0, 8.5]),
        pattern=rng.choice(["visit", "survey", "survey", "perimeter", "corridor"]),
    )
    if rng.random() < 0.3:
        requested.zones.append(shapely.box(235, 30, 285, 500))
        requested.zones = [
            zone for zone in requested.zones if not any(zone.distance(one) < 25 for one in shapes)
        ]
    return requested


def words_of(rng: Random, requested: Asked) -> list[str]:
    """The options."""
    lon, lat = requested.home
    words = [
        "--home",
        f"{lat},{lon},200",
        "--altitude",
        str(requested.altitude),
        "--speed",
        str(requested.speed),
    ]
    words += ["--pattern", requested.pattern, "-q", "--fence", "80", "--max-items", "99", "--tolerance", "1"]
    if requested.pattern in ("survey", "corridor"):
        words += ["--spacing", str(rng.choice([9, 15, 25]))]
    if requested.pattern == "survey" and rng.random() < 0.5:
        words += ["--angle", str(rng.choice([0, 30, 90, 135]))]
    if requested.pattern == "visit" and rng.random() < 0.5:
        words += ["--hold", "7"]
    if requested.zones:
        words += ["--avoid", "zones.geojson"]
    return words


def write_regions(shapes: list[Any], requested: Asked, path: Path) -> None:
    """Regions by GDAL; those at the antimeridian as RFC 7946 has them, cut in two."""
    drivers = {
        "geojson": "GeoJSON",
        "gpkg": "GPKG",
        "fgb": "FlatGeobuf",
        "shp": "ESRI Shapefile",
        "kml": "KML",
    }
    geometry = [_cut(requested.degrees(shapely.segmentize(shape, 20))) for shape in shapes]
    frame = geopandas.GeoDataFrame({"id": range(1, len(shapes) + 1)}, geometry=geometry, crs="EPSG:4326")
    frame.to_file(path, driver=drivers[path.suffix[1:]], engine="pyogrio")


def _cut(shape: Any) -> Any:
    """A polygon across the antimeridian as two."""
    west, _, east, _ = shape.bounds
    if east - west < 180:
        return shape
    whole = shapely.transform(shape, lambda xy: np.column_stack([xy[:, 0] % 360, xy[:, 1]]))
    left, right = (
        whole.intersection(shapely.box(0, -90, 180, 90)),
        whole.intersection(shapely.box(180, -90, 360, 90)),
    )
    moved = shapely.transform(right, lambda xy: xy - [360, 0])
    return shapely.MultiPolygon([part for one in (left, moved) for part in getattr(one, "geoms", [one])])


def positions(plan: dict[str, Any]) -> Places:
    """Longitude, latitude and height of the items that have a position, in order, of a .plan."""
    items = [item for item in plan["mission"]["items"] if item["command"] in (16, 22, 19)]
    return [(item["params"][5], item["params"][4], item["params"][6]) for item in items]


def as_asked(
    plan: dict[str, Any], flown: Places, requested: Asked, words: list[str], about: str
) -> Iterator[Finding]:
    """Home, heights, speed, fence, zones and regions."""
    mission = plan["mission"]
    lon, lat = requested.home
    yield from differ("HOME", about, mission["plannedHomePosition"], [lat, lon, 200.0])
    yield from differ("HEIGHT", about, {height for _, _, height in flown}, {requested.altitude})
    speeds = [item["params"][1] for item in mission["items"] if item["command"] == 178]
    yield from differ("SPEED", about, set(speeds), {requested.speed})
    yield from differ(
        "START", about, [mission["items"][0]["command"], mission["items"][-1]["command"]], [22, 20]
    )
    path = requested.metres([place[:2] for place in flown])
    line = shapely.LineString(np.vstack([path, requested.metres([requested.home])]))
    fences = [polygon for polygon in plan["geoFence"]["polygons"] if polygon["inclusion"]]
    yield from differ("FENCE", about, len(fences), 1)
    if fences:
        fence = shapely.Polygon(requested.metres([corner[::-1] for corner in fences[0]["polygon"]]))
        if not fence.buffer(0.2).contains(line.buffer(77.5)):
            least = fence.exterior.distance(line)
            yield Finding("FENCE", about, f"the fence is {least:.1f} m from the flight, not 80")
    for zone in requested.zones:
        if zone.distance(line) < 10 - 0.1:
            yield Finding("ZONE", about, f"a leg is {zone.distance(line):.2f} m from a zone")
    for number, shape in enumerate(requested.shapes, start=1):
        yield from covered(shape, path, requested, words, f"{about}", number)


def covered(
    shape: Any, path: Any, requested: Asked, words: list[str], about: str, number: int
) -> Iterator[Finding]:
    """Whether a region is flown as its pattern says."""
    points = shapely.MultiPoint(path[1:])
    line = shapely.LineString(path)
    if requested.pattern == "visit":
        if not shape.buffer(0.05).intersects(points):
            yield Finding("COVER", about, f"no waypoint in region {number}")
    elif requested.pattern == "perimeter":
        far_off = shapely.hausdorff_distance(shape.exterior, line.intersection(shape.exterior.buffer(2.5)))
        if far_off > 3.5:
            yield Finding("COVER", about, f"an outline of region {number} is {far_off:.1f} m from the flight")
    elif requested.pattern == "survey":
        spacing = float(words[words.index("--spacing") + 1])
        left = shape.difference(line.buffer(spacing / 2 + 1.1))
        if left.area > 0.002 * shape.area:
            yield Finding("COVER", about, f"{left.area / shape.area:.1%} of region {number} are not covered")


def same_places(found: Places, expected: Places, about: str, off: float = 1.1e-8) -> Iterator[Finding]:
    """Positions of another file, in order."""
    if len(found) != len(expected):
        yield Finding("SAME FLIGHT", about, f"{len(found)} positions, not {len(expected)}")
        return
    one, other = np.array(found), np.array(expected)
    apart = np.abs(one - other)
    apart[:, 0] = np.minimum(apart[:, 0], 360 - apart[:, 0])
    if (apart[:, :2] > off).any() or (apart[:, 2] > 1e-3).any():
        yield Finding("SAME FLIGHT", about, f"positions differ by up to {apart.max(axis=0)}")


def read_waypoints(path: Path, requested: Asked) -> Places:
    """By mavwp."""
    loader = mavwp.MAVWPLoader()
    loader.load(str(path))
    rows = [loader.wp(n) for n in range(1, loader.count())]
    return [(row.y, row.x, row.z) for row in rows if row.command in (16, 22, 19)]


def read_kml(path: Path, requested: Asked) -> Places:
    """The line of flight, which ends at home."""
    text = ElementTree.parse(path).find(".//k:LineString/k:coordinates", NAMESPACE)
    assert text is not None and text.text
    places = [tuple(map(float, place.split(","))) for place in text.text.split()]
    return [(lon, lat, height - 200) for lon, lat, height in places[1:-1]]


def read_csv(path: Path, requested: Asked) -> Places:
    """Litchi's table, without the takeoff."""
    with path.open() as file:
        rows = list(csv.DictReader(file))
    places = [(float(r["longitude"]), float(r["latitude"]), float(r["altitude(m)"])) for r in rows]
    return [(*requested.home, float(requested.altitude)), *places]


def read_kmz(path: Path, requested: Asked) -> Places:
    """The waylines of DJI, without the takeoff."""
    with zipfile.ZipFile(path) as archive:
        root = ElementTree.fromstring(archive.read("wpmz/waylines.wpml"))
    places: Places = [(*requested.home, float(requested.altitude))]
    for mark in root.iterfind(".//k:Placemark", NAMESPACE):
        lon, lat = map(float, (mark.findtext("k:Point/k:coordinates", "", NAMESPACE)).strip().split(","))
        places.append((lon, lat, float(mark.findtext("w:executeHeight", "nan", NAMESPACE))))
    return places


READERS = {"waypoints": read_waypoints, "kml": read_kml, "csv": read_csv, "kmz": read_kmz}
