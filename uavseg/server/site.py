"""Routes of a local server (page, tiles, jobs and their files); what a page asks for as requests of jobs."""

import math
import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import astuple
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, UavsegError, caused_errors
from uavseg.execution.executors import Progress, threads
from uavseg.flight.camera.camera import cameras
from uavseg.inputs import parse_json
from uavseg.jobs.extract import ExtractRequest, extract
from uavseg.jobs.flights.check import check, check_request, gap_regions, ground_below
from uavseg.jobs.flights.plan import PlanRequest, plan
from uavseg.jobs.flights.request import open_regions, plan_request
from uavseg.jobs.match.match import match, with_answers
from uavseg.jobs.match.request import MatchRequest
from uavseg.jobs.source.source import Raster
from uavseg.jobs.source.work import Work
from uavseg.jobs.web_map.content import CellTiles, FieldMap, FieldMapRequest, read_map_tile, webp_of
from uavseg.options.flights import Paths, PlanOptions
from uavseg.options.missions import CheckOptions
from uavseg.options.option import Option, build, options_of
from uavseg.photographs.ground import Ground
from uavseg.plain_text import printable
from uavseg.plot.web.field_map import read_collection, read_flights
from uavseg.raster.geodesy.globe import WGS84, geod_wgs84, transform_between
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.read.dataset import Dataset
from uavseg.regions.edit.small import Area
from uavseg.regions.formats.export import write_regions
from uavseg.regions.sample.place import Disc, disc_polygon
from uavseg.regions.table import Regions
from uavseg.segmentation.params.segment import IntensityRange, SegmentParams
from uavseg.server.local_server import Answer, BusyError, Job, Tasks, json_answer, refusal
from uavseg.warning_filters import changing_filters

_MEDIA_TYPES = {".gpkg": "application/geopackage+sqlite3", ".plan": "application/json"}
_REGIONS = "regions.gpkg"
_MAX_ZOOM = 26
_Result = tuple[Any, dict[str, Path]]
"""Answer as values of JSON, files by name."""

_TILE = re.compile(r"(tiles|codes)/([0-9]{1,2})/([0-9]{1,9})/([0-9]{1,9})")
_JOB = re.compile(r"jobs/([0-9]{1,9})(?:/(stop)|/files/([a-z0-9.-]{1,40}))?")
_OPTION = re.compile(r"--[a-z][a-z-]*")
FIELDS = {  # of the page, by the options that messages name
    "--allow-edge": "Regions at the edge of the raster too",
    "--altitude": "Height above home",
    "--avoid": "Keep-out zone",
    "--camera": "Camera",
    "--home": "Home",
    "--min-area": "Smallest region",
    "--pattern": "Pattern",
    "--spacing": "Distance of lines",
    "--speed": "Speed",
}
_MISSING = refusal(404, "there is no such thing here")
MAX_ZONES, MAX_CORNERS, MAX_ANSWERS = 100, 1000, 100
MAX_ID = 1 << 63


@dataclass(frozen=True, slots=True)
class Words:
    """The values of a body of JSON, read by name and type; those that nothing reads are errors."""

    values: dict[str, Any]

    @classmethod
    def of(cls, body: bytes, known: Sequence[str]) -> "Words":
        """Return the object of a body; raise ParameterError if it is not one, or has other names."""
        with caused_errors("the body is not JSON", ParameterError, RecursionError, ValueError, form="{}"):
            found = parse_json(body.decode())
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

    Center and edge are those of a disc, the sample; `like` and `unlike` are answers about other discs, each
    [x, y, radius] in coordinates of the raster.
    """
    words = Words.of(body, ("center", "edge", "similarity", "min_area", "like", "unlike"))
    what = "center and edge of a sample are [lat, lon]"
    ends = [_place(words.values.get(name), what) for name in ("center", "edge")]
    like, unlike = (_discs(words.values.get(name, [])) for name in ("like", "unlike"))
    similarity, area = words.number("similarity", 0.9), words.area("min_area")
    return MatchRequest((_disc(ends, geobox), *like), unlike=unlike, similarity=similarity, min_area=area)


def _discs(value: Any) -> tuple[Disc, ...]:
    is_list = isinstance(value, list) and len(value) <= MAX_ANSWERS
    if not is_list or not all(isinstance(one, list) and len(one) == 3 for one in value):
        raise ParameterError(f"answers are lists of [x, y, radius], at most {MAX_ANSWERS}")
    rows = [Words(dict(zip("xyr", one, strict=True))) for one in value]
    return tuple(Disc(*map(row.number, "xyr")) for row in rows)


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
    described = {name: one for name, one in options_of(PlanOptions).items() if name in words.values}
    given = {name: words.option(name, described[name]) for name in _OF_PLAN if name in described}
    if "camera" in given:
        words.word("camera", [one.name for one in cameras()])
    if "altitude" not in given:
        words.number("altitude")
    ids = words.values.get("ids", [])
    is_list = isinstance(ids, list) and len(ids) <= 100_000
    if not (is_list and all(type(one) is int and abs(one) < MAX_ID for one in ids)):
        raise ParameterError("ids are whole numbers")
    home = words.values.get("home", "auto")
    if home != "auto":
        home = _place(home, "home is [lat, lon] in degrees, or auto")
    request = plan_request(build(PlanOptions, given | {"home": home, "ids": words.values.get("ids")}))
    return PlanQuestion(words.integer("job"), request, _zones(words.values.get("zones", [])))


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


@dataclass(frozen=True)
class Flown:
    """What came back from a flight: outlines of footprints (lon, lat), the missions, and their gaps."""

    footprints: list[Any]
    missions: list[dict[str, Any]]
    gaps: Regions | None
    warnings: tuple[str, ...]

    @classmethod
    def of(cls, photos: Paths, mission: Any = None) -> "Flown":
        """Read photographs, and compare them with a mission.

        A ParameterError says that there is a mission without photographs; a PhotographError or MissionError
        that they cannot be read, or are of another flight.
        """
        if photos is None:
            raise ParameterError("--mission is that of photographs; give them with --photos")
        request = check_request(CheckOptions(photos=photos))
        checked = None if mission is None else check(mission, request)
        ground = Ground() if checked is None else ground_below(request, checked.mission)
        outlines, notes = ground.each(request.photographs, ground.footprint)
        rings = [shapely.get_coordinates(one).round(7).tolist() for one in outlines]
        if checked is None:
            return cls(rings, [], None, (*request.notes, *notes))
        return cls(rings, read_flights(mission), gap_regions(checked.coverage), checked.warnings)


@dataclass(frozen=True)
class Site:
    """Page and data from which a local server answers."""

    raster: Raster
    request: FieldMapRequest
    field_map: FieldMap
    page: bytes
    tasks: Tasks
    tiles: Dataset | None  # the raster without its collar, if tiles can be read
    cells: CellTiles | None = None  # for the slider, where the page does not hold them
    gaps: Regions | None = None  # of the photographs of a flight

    def answer(self, method: str, path: str, body: bytes) -> Answer:
        """Answer a request that is allowed; UavsegError if it is wrong."""
        with _naming_fields():
            return self._answer(method, path, body)

    def _answer(self, method: str, path: str, body: bytes) -> Answer:
        if method == "GET" and path == "":
            return Answer(self.page, "text/html; charset=utf-8")
        if method == "GET" and (tile := _TILE.fullmatch(path)):
            zoom, x, y = map(int, tile.groups()[1:])
            if zoom > _MAX_ZOOM or max(x, y) >= 1 << zoom:
                return _MISSING
            return self._codes((zoom, x, y)) if tile[1] == "codes" else self._tile((zoom, x, y))
        if job := _JOB.fullmatch(path):
            return self._job(method, *job.groups())
        if method == "POST" and path.startswith("jobs/"):
            return self._begin(path.removeprefix("jobs/"), body)
        return _MISSING

    def _codes(self, place: tuple[int, int, int]) -> Answer:
        if self.cells is None:
            return _MISSING
        content = self.cells.tile(place)
        return Answer(content or b"", "application/octet-stream", 200 if content else 204)

    def _tile(self, place: tuple[int, int, int]) -> Answer:
        if self.tiles is None:
            return _MISSING
        tile = read_map_tile(self.tiles, place)
        if tile is None:
            return Answer(b"", "image/webp", 204)
        picture = self.field_map.info.stretch.colored(*tile)
        return Answer(webp_of(picture), "image/webp")

    def _job(self, method: str, number: str, stop: str | None, name: str | None) -> Answer:
        task = self.tasks.find(int(number))
        if task is None or (method == "POST") != (stop is not None):
            return _MISSING
        if stop is not None:
            task.stop.set()
        if name is None:
            return json_answer(task.report())
        file = task.files.get(name)
        return (
            _MISSING if file is None else Answer(file.read_bytes(), _MEDIA_TYPES[file.suffix], file_name=name)
        )

    def _begin(self, command: str, body: bytes) -> Answer:
        job: Job
        if command == "extract":
            job = partial(self._extract, extract_request(body, self.request.segment))
        elif command == "match":
            job = partial(self._match, match_request(body, self.raster.geobox))
        elif command == "gaps" and self.gaps is not None:
            Words.of(body, ())
            job = partial(_gaps, self.gaps)
        elif command == "plan":
            question = plan_question(body)
            regions = self.tasks.find(question.job)
            if regions is None or _REGIONS not in regions.files:
                return refusal(404, "these regions are not there any more; extract them again")
            job = partial(self._plan, question, regions.files[_REGIONS])
        else:
            return _MISSING
        try:
            return json_answer(self.tasks.begin(_naming_fields()(job)).report(), 202)
        except BusyError as error:
            return refusal(409, str(error))

    def _extract(self, request: ExtractRequest, folder: Path, progress: Progress) -> _Result:
        found = extract(self.raster, request, _work(progress))
        return _regions(found.regions, found.warnings, folder)

    def _match(self, request: MatchRequest, folder: Path, progress: Progress) -> _Result:
        found = match(self.raster, request, _work(progress)).found
        asked: list[Disc] = []
        if not request.texture_alone:
            with_answers(self.raster, request, asked.append, _work(progress))
        answer, files = _regions(found.regions, found.warnings, folder)
        first, *_ = request.samples
        assert isinstance(first, Disc)
        geobox = self.raster.geobox
        rings = [shapely.get_coordinates(disc_polygon(disc, geobox)) for disc in asked]
        outlines = [np.stack(geobox.lonlat_from_xy(*ring.T)[::-1], 1).round(8).tolist() for ring in rings]
        shown = [{"disc": astuple(*asked), "ring": ring} for ring in outlines]  # [lat, lon]; one at most
        return answer | {"like": astuple(first), "ask": shown}, files

    def _plan(self, question: PlanQuestion, regions: Path, folder: Path, progress: Progress) -> _Result:
        progress(0, 1)
        planned = plan(open_regions(regions), question.request, question.zones, self.raster)
        with changing_filters(record=True) as caught:
            warnings.simplefilter("always", UserWarning)
            paths = planned.write(folder / "mission.plan")
        notes = [*planned.warnings, *dict.fromkeys(str(one.message) for one in caught)]
        flights = read_flights(planned)
        answer = {"missions": flights, "warnings": [printable(_with_fields(note)) for note in notes]}
        return answer, {path.name: path for path in paths}


@contextmanager
def _naming_fields() -> Iterator[None]:
    """Name fields of the page in errors in place of options of the command line."""
    try:
        yield
    except UavsegError as error:
        raise UavsegError(_with_fields(str(error))) from error


def _with_fields(text: str) -> str:
    """Name fields in a message in place of options; those without a field are of `uavseg`."""
    return _OPTION.sub(lambda one: f'"{FIELDS[one[0]]}"' if one[0] in FIELDS else f"uavseg {one[0]}", text)


def _work(progress: Progress) -> Work:
    run = threads()
    return Work(None, run, run, progress=progress)


def _gaps(gaps: Regions, folder: Path, progress: Progress) -> _Result:
    if not len(gaps):
        raise UavsegError("the photographs show all of it: there are no gaps")
    return _regions(gaps, (), folder)


def _regions(regions: Regions, notes: Sequence[str], folder: Path) -> _Result:
    path = folder / _REGIONS
    write_regions(regions, path)
    said = [printable(_with_fields(note)) for note in notes]
    return {"regions": read_collection(path), "warnings": said}, {path.name: path}
