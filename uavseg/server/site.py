"""Routes of a local server: the page, tiles, jobs and their files."""

import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from uavseg.dataclass import dataclass
from uavseg.errors import UavsegError
from uavseg.execution.executors import Progress, threads
from uavseg.jobs.extract import ExtractRequest, extract
from uavseg.jobs.flights.plan import plan
from uavseg.jobs.flights.plan_regions import open_regions
from uavseg.jobs.match.match import match
from uavseg.jobs.match.request import MatchRequest
from uavseg.jobs.result.result import Extraction
from uavseg.jobs.source.source import Raster
from uavseg.jobs.source.work import Work
from uavseg.jobs.web_map.content import FieldMap, FieldMapRequest
from uavseg.jobs.web_map.tiles import CellTiles, map_tile
from uavseg.plain_text import printable
from uavseg.plot.web.field_map import read_collection, read_flights
from uavseg.raster.read.dataset import Dataset
from uavseg.regions.formats.export import write_regions
from uavseg.regions.sample.place import Disc
from uavseg.server.local_server import Answer, json_answer
from uavseg.server.questions import PlanQuestion, extract_request, match_request, plan_question
from uavseg.server.tasks import BusyError, Job, Tasks
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
_MISSING = json_answer({"error": "there is no such thing here"}, 404)


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
        content = map_tile(self.tiles, self.field_map.info.stretch, place)
        return Answer(content or b"", "image/webp", 200 if content else 204)

    def _job(self, method: str, number: str, stop: str | None, name: str | None) -> Answer:
        task = self.tasks.find(int(number))
        if task is None or (method == "POST") != (stop is not None):
            return _MISSING
        if stop is not None:
            task.stop.set()
        if name is None:
            return json_answer(task.report())
        if name not in task.files:
            return _MISSING
        return Answer(task.files[name].read_bytes(), _MEDIA_TYPES[task.files[name].suffix], file_name=name)

    def _begin(self, command: str, body: bytes) -> Answer:
        job: Job
        if command == "extract":
            job = partial(self._extract, extract_request(body, self.request.segment))
        elif command == "match":
            job = partial(self._match, match_request(body, self.raster.geobox))
        elif command == "plan":
            question = plan_question(body)
            regions = self.tasks.find(question.job)
            if regions is None or _REGIONS not in regions.files:
                return json_answer({"error": "these regions are not there any more; extract them again"}, 404)
            job = partial(self._plan, question, regions.files[_REGIONS])
        else:
            return _MISSING
        try:
            return json_answer(self.tasks.begin(_naming_fields()(job)).report(), 202)
        except BusyError as error:
            return json_answer({"error": str(error)}, 409)

    def _extract(self, request: ExtractRequest, folder: Path, progress: Progress) -> _Result:
        return _regions(extract(self.raster, request, _work(progress)), folder)

    def _match(self, request: MatchRequest, folder: Path, progress: Progress) -> _Result:
        answer, files = _regions(match(self.raster, request, _work(progress)).found, folder)
        assert isinstance(request.like, Disc)
        return answer | {"like": [request.like.x, request.like.y, request.like.radius]}, files

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


def _regions(extraction: Extraction, folder: Path) -> tuple[dict[str, Any], dict[str, Path]]:
    path = folder / _REGIONS
    write_regions(extraction.regions, path)
    notes = [printable(_with_fields(note)) for note in extraction.warnings]
    answer = {"regions": read_collection(path), "warnings": notes}
    return answer, {path.name: path}
