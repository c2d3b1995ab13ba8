"""Jobs of the local server: their files are those of the command line, byte for byte."""

import json
import math
import re
import threading
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import rasterio
import shapely
from click.testing import CliRunner
from rasterio.enums import Resampling
from rasterio.vrt import WarpedVRT
from rasterio.warp import transform_bounds

import uavseg
from tests.server.asking import fetch, run_job, surveyed
from uavseg.api.pages import MapServer
from uavseg.cli import main
from uavseg.errors import ParameterError
from uavseg.execution.executors import Progress
from uavseg.jobs.web_map.content import has_map_tiles
from uavseg.plot.web import field_map
from uavseg.server.local_server import KEPT, BusyError, Tasks
from uavseg.server.site import FIELDS

SAMPLE = Path(uavseg.__file__).parents[1] / "samples" / "quarry.tif"
TILES = has_map_tiles(uavseg.Dataset.open(SAMPLE))
ZONE = [[49.4605, -122.829], [49.4605, -122.8285], [49.4601, -122.8285]]


@pytest.fixture(scope="module")
def server() -> Iterator[MapServer]:
    if TILES:
        found = uavseg.serve(SAMPLE, size=300)
    else:
        with pytest.warns(UserWarning, match="rio-tiler"):
            found = uavseg.serve(SAMPLE, size=300)
    with found:
        yield found


def run(*words: object) -> None:
    result = CliRunner().invoke(main, [str(word) for word in words], catch_exceptions=False)
    assert result.exit_code == 0, result.output


def saved(server: MapServer, report: dict[str, Any], name: str) -> bytes:
    assert report["state"] == "done", report
    status, content = fetch(f"{server.url}jobs/{report['job']}/files/{name}")
    assert status == 200
    return content


@pytest.mark.slow
def test_exact_regions_are_those_of_extract(server: MapServer, tmp_path: Path) -> None:
    report = run_job(server.url, "extract", {"low": 0.55, "high": 0.9, "min_area": 300})
    expected = tmp_path / "regions.gpkg"
    run("extract", SAMPLE, "--range", "0.55,0.9", "--min-area", "300", "-o", expected, "-q")
    assert saved(server, report, "regions.gpkg") == expected.read_bytes()
    assert report["done"] == report["total"] > 0
    assert len(report["answer"]["regions"]["features"]) > 1


@pytest.mark.slow
def test_regions_like_a_sample_are_those_of_match(server: MapServer, tmp_path: Path) -> None:
    regions = uavseg.extract(SAMPLE, (0.55, 1), min_area=1000)
    center = regions.geometry.iloc[1].representative_point()
    x, y, radius = round(center.x, 1), round(center.y, 1), 25.0
    places = geopandas.GeoSeries([shapely.Point(x, y), shapely.Point(x + radius, y)], crs=regions.crs).to_crs(
        4326
    )
    ends = [[place.y, place.x] for place in places]
    report = run_job(server.url, "match", {"center": ends[0], "edge": ends[1], "min_area": 100})
    like = report["answer"]["like"]
    assert like == pytest.approx([x, y, radius], abs=1e-3)
    expected = tmp_path / "regions.gpkg"
    run("match", SAMPLE, f"--like={like[0]},{like[1]},{like[2]}", "--min-area", "100", "-o", expected, "-q")
    assert saved(server, report, "regions.gpkg") == expected.read_bytes()


@pytest.mark.slow
def test_answers_about_a_place_are_samples_of_match(server: MapServer, tmp_path: Path) -> None:
    """The place is that of `ask=`, the answers are --like and --unlike; the place after them is the next."""
    with rasterio.open(SAMPLE) as file:
        x, y = file.xy(file.height // 2, file.width // 2)
    places = geopandas.GeoSeries([shapely.Point(x, y), shapely.Point(x + 25, y)], crs=file.crs).to_crs(4326)
    body: dict[str, Any] = {
        name: [one.y, one.x] for name, one in zip(("center", "edge"), places, strict=True)
    }
    first = run_job(server.url, "match", body)["answer"]
    (question,) = first["ask"]
    asked: list[Any] = []

    def ask(disc: Any) -> bool | None:
        asked.append([disc.x, disc.y, disc.radius])
        return False if len(asked) == 1 else None

    with warnings.catch_warnings(action="ignore"):
        uavseg.match(SAMPLE, tuple(first["like"]), ask=ask)
    assert question["disc"] == asked[0]
    ring = shapely.Polygon(np.array(question["ring"])[:, ::-1])
    disc = geopandas.GeoSeries([shapely.Point(asked[0][:2]).buffer(asked[0][2], 64)], crs=file.crs)
    (expected,) = disc.to_crs(4326)
    assert ring.intersection(expected).area > 0.99 * ring.union(expected).area
    report = run_job(server.url, "match", body | {"like": [], "unlike": [question["disc"]]})
    assert [one["disc"] for one in report["answer"]["ask"]] == asked[1:]
    target = tmp_path / "regions.gpkg"
    like, unlike = (",".join(map(str, one)) for one in (first["like"], asked[0]))
    run("match", SAMPLE, f"--like={like}", f"--unlike={unlike}", "-o", target, "-q")
    assert saved(server, report, "regions.gpkg") == target.read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("home", [pytest.param("auto", marks=pytest.mark.slow), [49.4586, -122.8276]])
def test_missions_are_those_of_plan(home: Any, server: MapServer, tmp_path: Path) -> None:
    regions = run_job(server.url, "extract", {"low": 0.55, "high": 1, "min_area": 200})
    question = {"job": regions["job"], "ids": [1, 3], "home": home, "altitude": 70, "pattern": "survey"}
    report = run_job(server.url, "plan", {**question, "camera": "DJI Mavic 3", "speed": 6, "zones": [ZONE]})
    zones, file, expected = (tmp_path / name for name in ("zones.geojson", "regions.gpkg", "mission.plan"))
    file.write_bytes(saved(server, regions, "regions.gpkg"))
    ring = [corner[::-1] for corner in [*ZONE, ZONE[0]]]
    zones.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    words = [
        "--home",
        home if home == "auto" else ",".join(map(str, home)),
        "--altitude",
        70,
        "--pattern",
        "survey",
    ]
    more = ["--camera", "DJI Mavic 3", "--speed", 6, "--avoid", zones, "--raster", SAMPLE, "--ids", "1,3"]
    run("plan", file, *words, *more, "-o", expected, "-q")
    ours, theirs = (
        json.loads(text) for text in (saved(server, report, "mission.plan"), expected.read_bytes())
    )
    assert places_of(ours) == pytest.approx(places_of(theirs), abs=2e-7)  # degrees: regions are rounded first
    assert len(ours["mission"]["items"]) == len(theirs["mission"]["items"])
    assert report["answer"]["missions"][0]["footprints"]


@pytest.mark.slow
def test_gaps_of_photographs_are_those_of_check(tmp_path: Path) -> None:
    mission, photographs = surveyed(tmp_path)
    gaps = tmp_path / "gaps.geojson"
    words = ["check", mission, "--photos", photographs, "--gaps", gaps, "-q"]
    assert CliRunner().invoke(main, list(map(str, words))).exit_code == 1
    with warnings.catch_warnings(action="ignore"):
        server = uavseg.serve(SAMPLE, size=300, photos=photographs, mission=mission)
    with server:
        assert fetch(f"{server.url}jobs/gaps", {"low": 1})[0] == 400
        report = run_job(server.url, "gaps", {})
        (tmp_path / "regions.gpkg").write_bytes(saved(server, report, "regions.gpkg"))
        question = {"job": report["job"], "home": "auto", "altitude": 60, "pattern": "survey"}
        planned = run_job(server.url, "plan", {**question, "camera": "DJI Mavic 3", "allow_edge": True})
        assert planned["state"] == "done", planned
    found, expected = (geopandas.read_file(tmp_path / name) for name in ("regions.gpkg", "gaps.geojson"))
    assert len(found) == len(expected) > 0
    assert found.area_m2.to_numpy() == pytest.approx(expected.area_m2.to_numpy())


@pytest.mark.slow
def test_photographs_without_a_mission_have_footprints_and_no_gaps(tmp_path: Path) -> None:
    _, photographs = surveyed(tmp_path)
    with warnings.catch_warnings(action="ignore"):
        server = uavseg.serve(SAMPLE, size=300, photos=photographs)
    with server:
        page = fetch(server.url)[1].decode()
        assert fetch(f"{server.url}jobs/gaps", {})[0] == 404
    data = json.loads(page.split('id="data">')[1].split("</script>")[0])
    shown = data["server"]["footprints"]
    assert len(shown) == len(list(photographs.iterdir())) and data["server"]["gaps"] is False
    with pytest.raises(uavseg.UavsegError, match="--photos"):
        uavseg.serve(SAMPLE, mission=tmp_path / "survey.plan")


def places_of(plan: Any) -> Any:
    """Latitudes and longitudes of the items of a mission."""
    return [n for item in plan["mission"]["items"] for n in item.get("params", [])[4:6] if n is not None]


@pytest.mark.parametrize(
    ("kind", "body", "words"),
    [
        ("extract", {"low": 0.9, "high": 0.1}, "low < high"),
        ("extract", {"low": "0", "high": 1}, "low is a number"),
        ("extract", {"low": 0, "high": 1, "output": "/tmp/x"}, "object with the names"),
        ("extract", [], "object with the names"),
        ("match", {"center": "/etc/passwd", "edge": [0, 0]}, "[lat, lon]"),
        ("match", {"center": [0, 0], "edge": [0, 1], "like": [[1, 2]]}, "[x, y, radius]"),
        ("match", {"center": [0, 0], "edge": [0, 1], "unlike": "a"}, "[x, y, radius]"),
        ("match", {"center": [0, 0], "edge": [0, 1], "unlike": [[1, 2, "3"]]}, "r is a number"),
        ("match", {"center": [0, 0], "edge": [0, 1], "unlike": [[1, 2, 3]] * 101}, "at most 100"),
        ("match", {"center": [0, 0], "edge": [0, 1], "unlike": [[1, 2, -3]]}, "a radius above 0"),
        ("plan", {"job": 1, "altitude": 60, "camera": str(SAMPLE)}, "camera is one of"),
        (
            "plan",
            {"job": 1, "altitude": 60, "pattern": "survey", "spacing": 20, "zones": [[[0, 0]]]},
            "corners",
        ),
        ("plan", {"job": 1, "altitude": 60, "ids": ["1"]}, "whole numbers"),
        ("plan", {"job": 10**8, "altitude": 60, "pattern": "visit"}, "not there any more"),
        ("plan", {"job": 1.5, "altitude": 60, "pattern": "visit"}, "whole number"),
    ],
)
def test_wrong_questions_are_refused_in_a_sentence(
    kind: str, body: Any, words: str, server: MapServer
) -> None:
    status, content = fetch(f"{server.url}jobs/{kind}", body)
    assert status in (400, 404)
    assert words in json.loads(content)["error"]


@pytest.mark.slow
def test_what_a_plan_advises_is_a_field_of_the_page(server: MapServer) -> None:
    regions = run_job(server.url, "extract", {"low": 0, "high": 1})
    ids = [one["properties"]["id"] for one in regions["answer"]["regions"]["features"]]
    question = {"job": regions["job"], "ids": ids, "altitude": 60, "pattern": "visit", "home": ZONE[0]}
    refused = run_job(server.url, "plan", question)
    assert refused["state"] == "failed" and "--" not in refused["error"]
    assert refused["error"].endswith('over them all the same ("Regions at the edge of the raster too")')
    assert run_job(server.url, "plan", question | {"allow_edge": True})["state"] == "done"


def test_fields_that_messages_name_are_on_the_page() -> None:
    program = (Path(field_map.__file__).parent / "assets" / "served.js").read_text(encoding="utf-8")
    for label in FIELDS.values():
        assert re.search(rf'"(?:\\u00a0)?{label}[":,]', program), label
    assert "allow_edge: edge.checked" in program


def test_a_job_that_fails_says_why(server: MapServer) -> None:
    report = run_job(server.url, "match", {"center": [0, 0], "edge": [0, 0.001]})
    assert report["state"] == "failed"
    assert "sample" in report["error"]


@pytest.mark.parametrize(
    "path", ["jobs/999", "jobs/1/files/other.gpkg", "nothing", "tiles/30/0/0", "jobs/1/stop"]
)
def test_what_is_not_there_is_404(path: str, server: MapServer) -> None:
    assert fetch(server.url + path)[0] == 404


@pytest.mark.slow
@pytest.mark.skipif(not TILES, reason="needs rio-tiler")
def test_tiles_show_the_raster(server: MapServer) -> None:
    with rasterio.open(SAMPLE) as file:
        west, south, east, north = transform_bounds(file.crs, 4326, *file.bounds)
    lon, lat, zoom = (west + east) / 2, (south + north) / 2, 18
    x = int((lon + 180) / 360 * 2**zoom)
    y = int((1 - math.asinh(math.tan(math.radians(lat))) / math.pi) / 2 * 2**zoom)
    status, content = fetch(f"{server.url}tiles/{zoom}/{x}/{y}")
    assert status == 200
    with (
        warnings.catch_warnings(action="ignore"),  # it has no georeference
        rasterio.MemoryFile(content) as memory,
        memory.open() as tile,
    ):
        found = tile.read()
    assert found.shape in {(3, 256, 256), (4, 256, 256)}  # without alpha where all is valid
    inside = found[3] == 255 if len(found) == 4 else np.ones((256, 256), bool)
    assert inside.mean() > 0.5
    side = 2 * math.pi * 6378137 / 2**zoom
    corner = x * side - math.pi * 6378137, math.pi * 6378137 - y * side
    with rasterio.open(SAMPLE) as file, WarpedVRT(file, crs=3857, resampling=Resampling.nearest) as warped:
        bounds = corner[0], corner[1] - side, corner[0] + side, corner[1]
        expected = warped.read(1, window=warped.window(*bounds), out_shape=(256, 256), boundless=False)
    error = np.abs(found[0].astype(int) - expected)[inside]
    assert np.median(error) < 8  # resampling and WebP
    assert fetch(f"{server.url}tiles/{zoom}/0/0")[0] == 204


def test_one_job_runs_at_a_time_and_can_be_stopped(tmp_path: Path) -> None:
    tasks, begun = Tasks(tmp_path), threading.Event()

    def endless(folder: Path, progress: Progress) -> tuple[Any, dict[str, Path]]:
        while True:
            progress(1, 2)
            begun.set()
            time.sleep(0.01)

    first = tasks.begin(endless)
    assert begun.wait(10)
    with pytest.raises(BusyError):
        tasks.begin(endless)
    assert first.report()["state"] == "running"
    first.stop.set()
    wait_for(first)
    assert first.state == "stopped"
    second = tasks.begin(lambda folder, progress: ("answer", {}))
    wait_for(second)
    assert second.report()["answer"] == "answer"


def wait_for(task: Any) -> None:
    deadline = time.monotonic() + 30
    while task.state == "running":
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_the_files_of_old_jobs_are_deleted(tmp_path: Path) -> None:
    tasks = Tasks(tmp_path)
    for _ in range(KEPT + 3):
        wait_for(tasks.begin(lambda folder, progress: (None, {})))
    assert tasks.find(1) is None
    assert tasks.find(KEPT + 3) is not None
    assert len(list(tmp_path.iterdir())) == KEPT


def test_a_port_in_use_is_refused(server: MapServer) -> None:
    port = int(server.url.split(":")[2].split("/")[0])
    with pytest.raises(ParameterError, match=f"port {port} cannot be used"):
        uavseg.serve(SAMPLE, size=100, port=port)


@pytest.mark.slow
def test_results_are_deleted_at_the_end() -> None:
    with warnings.catch_warnings(action="ignore"):
        server = uavseg.serve(SAMPLE, size=100)
    with server:
        run_job(server.url, "extract", {"low": 0.55, "high": 1})
        folder = Path(server._folder.name)
        assert list(folder.rglob("regions.gpkg"))
    assert not folder.exists()
