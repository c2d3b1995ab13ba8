"""What a page asks for, as requests of jobs: numbers, listed words and coordinates; never names of files."""

import json
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.flight.camera.camera import cameras
from uavseg.inputs import parse_json
from uavseg.jobs.extract import ExtractRequest
from uavseg.jobs.flights.plan import Home, PlanRequest
from uavseg.jobs.flights.request import plan_request
from uavseg.jobs.match.request import MatchRequest
from uavseg.options.flights import PlanOptions
from uavseg.options.option import Option, build, options_of
from uavseg.raster.geodesy.globe import WGS84, geod_wgs84, transform_between
from uavseg.raster.grid.geobox import GeoBox
from uavseg.regions.edit.small import Area
from uavseg.regions.sample.place import Disc
from uavseg.segmentation.params.segment import IntensityRange, SegmentParams

MAX_ZONES, MAX_CORNERS = 100, 1000
MAX_ID = 1 << 63


@dataclass(frozen=True, slots=True)
class Words:
    """The values of a body of JSON, read by name and type; those that nothing reads are errors."""

    values: dict[str, Any]

    @classmethod
    def of(cls, body: bytes, known: Sequence[str]) -> "Words":
        """Return the object of a body; raise ParameterError if it is not one, or has other names."""
        try:
            found = parse_json(body.decode())
        except (UnicodeDecodeError, json.JSONDecodeError, RecursionError, ValueError) as error:
            raise ParameterError("the body is not JSON") from error
        if not isinstance(found, dict) or not set(found) <= set(known):
            raise ParameterError(f"the body is an object with the names {', '.join(known)}")
        return cls({name: value for name, value in found.items() if value is not None})

    def number(self, name: str, default: float | None = None) -> float:
        """Return a finite number."""
        value = self.values.get(name, default)
        try:
            result = math.nan if value is None or isinstance(value, bool | str) else float(value)
        except (TypeError, OverflowError):  # a whole number of JSON may have 400 digits
            result = math.nan
        if not math.isfinite(result):
            raise ParameterError(f"{name} is a number")
        return result

    def area(self, name: str) -> Area | None:
        """Return an area in square metres, or None."""
        return Area(self.number(name)) if name in self.values else None

    def integer(self, name: str) -> int:
        """Return a whole number."""
        value = self.number(name)
        if not value.is_integer() or abs(value) > 1e9:
            raise ParameterError(f"{name} is a whole number")
        return int(value)

    def option(self, name: str, described: Option) -> Any:
        """Return the value of an option, by its description."""
        if described.choices:
            return self.word(name, described.choices)
        if described.type is bool:
            value = self.values[name]
            if not isinstance(value, bool):
                raise ParameterError(f"{name} is true or false")
            return value
        return self.number(name) if described.type is float else self.values[name]

    def word(self, name: str, allowed: Sequence[str], default: str | None = None) -> str | None:
        """Return one of the words that are allowed."""
        value = self.values.get(name, default)
        if value is not None and value not in allowed:
            raise ParameterError(f"{name} is one of {', '.join(allowed)}")
        return value


def extract_request(body: bytes, segment: SegmentParams) -> ExtractRequest:
    """Return the question of `{"low": ..., "high": ..., "min_area": ...}`; areas in square metres."""
    words = Words.of(body, ("low", "high", "min_area"))
    interval = IntensityRange(words.number("low"), words.number("high"))
    return ExtractRequest(interval, segment, min_area=words.area("min_area"))


def match_request(body: bytes, geobox: GeoBox) -> MatchRequest:
    """Read `{"center": [lat, lon], "edge": [lat, lon], "similarity": ..., "min_area": ...}`.

    Center and edge are those of a disc, the sample.
    """
    words = Words.of(body, ("center", "edge", "similarity", "min_area"))
    what = "center and edge of a sample are [lat, lon]"
    ends = [_place(words.values.get(name), what) for name in ("center", "edge")]
    area = words.area("min_area")
    return MatchRequest(_disc(ends, geobox), similarity=words.number("similarity", 0.9), min_area=area)


def _disc(ends: Sequence[tuple[float, float]], geobox: GeoBox) -> Disc:
    """Return a disc by its center and a place on its edge, in coordinates of the raster."""
    assert geobox.wkt is not None  # a raster on a map has a CRS
    lat, lon = np.array(ends).T
    x, y = transform_between(WGS84, geobox.wkt)(lon, lat)
    radius = math.hypot(x[1] - x[0], y[1] - y[0])
    if geobox.crs is not None and geobox.crs.is_geographic:
        radius = float(geod_wgs84().inv(lon[0], lat[0], lon[1], lat[1])[2])
    return Disc(*(float(f"{value:.10g}") for value in (x[0], y[0], radius)))


@dataclass(frozen=True)
class PlanQuestion:
    """How to fly over regions of a job, and keep-out zones in degrees."""

    job: int
    request: PlanRequest
    zones: list[Any]


_OF_PLAN = ("altitude", "pattern", "spacing", "camera", "speed", "autopilot", "allow_edge")


def plan_question(body: bytes) -> PlanQuestion:
    """Return the question of a flight: regions by their ids, home, height, pattern, camera, zones."""
    words = Words.of(body, ("job", "ids", "home", "zones", *_OF_PLAN))
    given = {
        name: words.option(name, options_of(PlanOptions)[name]) for name in _OF_PLAN if name in words.values
    }
    if "camera" in given:
        words.word("camera", [one.name for one in cameras()])
    if "altitude" not in given:
        words.number("altitude")
    ids = words.values.get("ids")
    if ids is not None and not (
        isinstance(ids, list)
        and len(ids) <= 100_000
        and all(type(one) is int and abs(one) < MAX_ID for one in ids)
    ):
        raise ParameterError("ids are whole numbers")
    home = _home(words.values.get("home", "auto"))
    request = plan_request(build(PlanOptions, given | {"home": home, "ids": ids}))
    return PlanQuestion(words.integer("job"), request, _zones(words.values.get("zones", [])))


def _home(value: Any) -> Home:
    if value == "auto":
        return "auto"
    lat, lon = _place(value, "home is [lat, lon] in degrees, or auto")
    return lat, lon


def _zones(value: Any) -> list[Any]:
    what = "zones are lists of [lat, lon], three corners at least"
    if not isinstance(value, list) or len(value) > MAX_ZONES:
        raise ParameterError(f"{what}, and at most {MAX_ZONES}")
    return [_zone(ring, what) for ring in value]


def _zone(ring: Any, what: str) -> Any:
    if not isinstance(ring, list) or not 3 <= len(ring) <= MAX_CORNERS:
        raise ParameterError(what)
    zone = shapely.Polygon([_place(corner, what)[::-1] for corner in ring])
    if not zone.is_valid or zone.area == 0:
        raise ParameterError("a keep-out zone crosses itself, or has no area; draw it again")
    return zone


def _place(value: Any, what: str) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise ParameterError(what)
    found = Words({"lat": value[0], "lon": value[1]})
    lat, lon = found.number("lat"), found.number("lon")
    if not (-90 <= lat <= 90 and -180 <= lon <= 180):
        raise ParameterError(what)
    return lat, lon
