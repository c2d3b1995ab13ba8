"""The site of a local server: the page, tiles, jobs and their files."""

import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

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
from uavseg.jobs.web_map.cell_tiles import CellTiles
from uavseg.jobs.web_map.content import FieldMap, FieldMapRequest, map_tile
from uavseg.plain_text import printable
from uavseg.plot.web.field_map import read_flights
from uavseg.plot.web.region_features import read_collection
from uavseg.raster.read.dataset import Dataset
from uavseg.regions.formats.export import write_regions
from uavseg.regions.sample.place import Disc
from uavseg.server.local_server import Answer, json_answer
from uavseg.server.questions import PlanQuestion, extract_request, match_request, plan_question
from uavseg.server.tasks import BusyError, Job, Tasks
from uavseg.warning_filters import changing_filters

KINDS = {".gpkg": "application/geopackage+sqlite3", ".plan": "application/json"}
REGIONS = "regions.gpkg"
MAX_ZOOM = 26
Made = tuple[Any, dict[str, Path]]
"""Answer as values of JSON, files by name."""

_TILE = re.compile(r"tiles/([0-9]{1,2})/([0-9]{1,9})/([0-9]{1,9})")
_CODES = re.compile(r"codes/([0-9]{1,2})/([0-9]{1,9})/([0-9]{1,9})")
_JOB = re.compile(r"jobs/([0-9]{1,9})(?:/(stop)|/files/([a-z0-9.-]{1,40}))?")
_OPTION = re.compile(r"--[a-z][a-z-]*")
FIELDS = {  # of the page, by the options that messages advise
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
MISSING = json_answer({"error": "there is no such thing here"}, 404)


@dataclass(frozen=True)
class Site:
    """What a local server answers from.

    Parameters
    ----------
    raster : Raster
    request : FieldMapRequest
    found : FieldMap
    page : bytes
    tasks : Tasks
    tiles : Dataset, optional
        The raster without its collar, where there are tiles.
    cells : CellTiles, optional
        Cells for the slider, where the page does not hold them.
    """

    raster: Raster
    request: FieldMapRequest
    found: FieldMap
    page: bytes
    tasks: Tasks
    tiles: Dataset | None
    cells: CellTiles | None = None

    def answer(self, method: str, path: str, body: bytes) -> Answer:
        """The answer to a request that is allowed.

        Raises
        ------
        UavsegError
            If the question is wrong.
        """
        with _advising_of_page():
            return self._answer(method, path, body)

    def _answer(self, method: str, path: str, body: bytes) -> Answer:
        if method == "GET" and path == "":
            return Answer(self.page, "text/html; charset=utf-8")
        if method == "GET" and (tile := _TILE.fullmatch(path)):
            return self._tile(*map(int, tile.groups()))
        if method == "GET" and (tile := _CODES.fullmatch(path)):
            return self._codes(*map(int, tile.groups()))
        if job := _JOB.fullmatch(path):
            return self._job(method, *job.groups())
        if method == "POST" and path.startswith("jobs/"):
            return self._begin(path.removeprefix("jobs/"), body)
        return MISSING

    def _codes(self, zoom: int, x: int, y: int) -> Answer:
        if self.cells is None or not _is_tile(zoom, x, y):
            return MISSING
        content = self.cells.tile((zoom, x, y))
        return Answer(content or b"", "application/octet-stream", 200 if content else 204)

    def _tile(self, zoom: int, x: int, y: int) -> Answer:
        if self.tiles is None or not _is_tile(zoom, x, y):
            return MISSING
        content = map_tile(self.tiles, self.found.info.stretch, (zoom, x, y))
        return Answer(b"", "image/webp", 204) if content is None else Answer(content, "image/webp")

    def _job(self, method: str, number: str, stop: str | None, name: str | None) -> Answer:
        task = self.tasks.find(int(number))
        if task is None or (method == "POST") != (stop is not None):
            return MISSING
        if stop is not None:
            task.stop.set()
        if name is None:
            return json_answer(task.report())
        if name not in task.files:
            return MISSING
        return Answer(task.files[name].read_bytes(), KINDS[task.files[name].suffix], file_name=name)

    def _begin(self, kind: str, body: bytes) -> Answer:
        job: Job
        if kind == "extract":
            job = partial(self._extract, extract_request(body, self.request.segment))
        elif kind == "match":
            job = partial(self._match, match_request(body, self.raster.geobox))
        elif kind == "plan":
            question = plan_question(body)
            regions = self.tasks.find(question.job)
            if regions is None or REGIONS not in regions.files:
                return json_answer({"error": "these regions are not there any more; extract them again"}, 404)
            job = partial(self._plan, question, regions.files[REGIONS])
        else:
            return MISSING
        try:
            return json_answer(self.tasks.begin(_advising_of_page()(job)).report(), 202)
        except BusyError as error:
            return json_answer({"error": str(error)}, 409)

    def _extract(self, wanted: ExtractRequest, folder: Path, progress: Progress) -> Made:
        return _regions(extract(self.raster, wanted, _work(progress)), folder)

    def _match(self, sample: MatchRequest, folder: Path, progress: Progress) -> Made:
        answer, files = _regions(match(self.raster, sample, _work(progress)).found, folder)
        assert isinstance(sample.like, Disc)
        return answer | {"like": [sample.like.x, sample.like.y, sample.like.radius]}, files

    def _plan(self, question: PlanQuestion, regions: Path, folder: Path, progress: Progress) -> Made:
        progress(0, 1)
        planned = plan(open_regions(regions), question.request, question.zones, self.raster)
        with changing_filters(record=True) as caught:
            warnings.simplefilter("always", UserWarning)
            paths = planned.write(folder / "mission.plan")
        notes = [*planned.warnings, *dict.fromkeys(str(one.message) for one in caught)]
        flights = read_flights(planned)
        answer = {"missions": flights, "warnings": [printable(_as_of_page(note)) for note in notes]}
        return answer, {path.name: path for path in paths}


@contextmanager
def _advising_of_page() -> Iterator[None]:
    """Context in which errors name fields of the page in place of options of the command line."""
    try:
        yield
    except UavsegError as error:
        raise UavsegError(_as_of_page(str(error))) from error


def _as_of_page(text: str) -> str:
    """A message that names fields in place of options; what the page does not offer is of `uavseg`."""
    return _OPTION.sub(lambda one: f'"{FIELDS[one[0]]}"' if one[0] in FIELDS else f"uavseg {one[0]}", text)


def _is_tile(zoom: int, x: int, y: int) -> bool:
    return zoom <= MAX_ZOOM and max(x, y) < 1 << zoom


def _work(progress: Progress) -> Work:
    run = threads(None)
    return Work(None, run, run, progress=progress)


def _regions(found: Extraction, folder: Path) -> tuple[dict[str, Any], dict[str, Path]]:
    path = folder / REGIONS
    write_regions(found.regions, path)
    notes = [printable(_as_of_page(note)) for note in found.warnings]
    answer = {"regions": read_collection(path), "warnings": notes}
    return answer, {path.name: path}
