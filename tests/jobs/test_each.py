"""One job over many sources: as if each had been alone, whatever runs beside it."""

import csv
import os
import threading
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from rasterio.errors import NotGeoreferencedWarning

from uavseg.errors import OutputError, OutputExistsError, ParameterError, RasterReadError
from uavseg.jobs.each import each
from uavseg.jobs.each.each import Outcome, OutputNames, SourceTask, grouped_warnings, plan_tasks, run_each
from uavseg.jobs.extract import ExtractRequest, extract
from uavseg.jobs.requests import RegionJob
from uavseg.jobs.result.result import Extraction
from uavseg.jobs.source.source import Source
from uavseg.jobs.source.work import Work
from uavseg.options.reading import ReadOptions
from uavseg.output.disk import recording_written
from uavseg.segmentation.params.segment import IntensityRange

REQUEST = ExtractRequest(IntensityRange(0.5, 1))


def find(source: Source, work: Work) -> Extraction:
    return extract(source, REQUEST, work)


JOB = RegionJob(ReadOptions(), find)


def write(path: str, seed: int, placed: bool = True, shape: tuple[int, int] = (70, 90)) -> None:
    rng = np.random.default_rng(seed)
    image = np.kron(rng.integers(1, 255, (4, 5)), np.ones((40, 40)))[: shape[0], : shape[1]].astype(np.uint8)
    place: dict[str, Any] = (
        {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6)} if placed else {}
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with rasterio.open(path, "w", "GTiff", shape[1], shape[0], 1, dtype="uint8", **place) as file:
            file.write(image, 1)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("tiles", "out", "alone"):
        Path(name).mkdir()
    for number in range(12):
        write(f"tiles/{number:02}.tif", number, placed=number % 3 > 0)
    write("tiles/wide.tif", 50, shape=(130, 140))


def content(folder: str) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(Path(folder).iterdir())}


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["gpkg", "fgb", "parquet", "geojson"])
@pytest.mark.parametrize("count", [1, 4])
def test_each_is_as_if_it_had_been_alone(suffix: str, count: int) -> None:
    names = OutputNames(f"out/{{stem}}.{suffix}", "out/{stem}.tif")
    tasks, _ = plan_tasks(["tiles"], names)
    found = run_each(tasks, JOB, names, Work(tile=64), count)
    assert [one.source for one in found] == [task.source for task in tasks]
    for task, outcome in zip(tasks, found, strict=True):
        own = replace(names, regions=f"alone/{{stem}}.{suffix}", labels="alone/{stem}.tif")
        single, _ = plan_tasks([task.source], own)
        assert run_each(single, JOB, own) == [replace(outcome, output=single[0].output)]
    assert content("out") == content("alone") and len(content("out")) == 26


@pytest.mark.slow
def test_what_fails_does_not_stop_the_others() -> None:
    Path("tiles/03.tif").write_bytes(b"no raster")
    Path("tiles/07.tif").write_bytes(Path("tiles/07.tif").read_bytes()[:3000])
    names = OutputNames("out/{stem}.gpkg", report="out/report.csv")
    tasks, _ = plan_tasks(["tiles"], names)
    found = run_each(tasks, JOB, names, count=3)
    failed = [one for one in found if one.error is not None]
    assert [one.source for one in failed] == ["tiles/03.tif", "tiles/07.tif"]
    assert all(one.regions is None and one.failure.startswith(one.source) for one in failed)
    assert sorted(content("out")) == [
        *(f"{number:02}.gpkg" for number in range(12) if number not in (3, 7)),
        *("report.csv", "wide.gpkg"),
    ]
    with Path("out/report.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["source"] for row in rows] == [task.source for task in tasks]
    assert [row["error"] for row in rows if row["error"]] == [one.error for one in failed]
    assert [float(row["area_m2"]) for row in rows if row["area_m2"]] == pytest.approx(
        [one.area_m2 for one in found if one.area_m2 is not None], rel=1e-11
    )


@pytest.mark.slow
def test_sources_of_many_tiles_have_them_side_by_side_after_the_others() -> None:
    here = os.getpid()

    def noted(source: Source, work: Work) -> Extraction:
        is_here = os.getpid() == here and threading.current_thread() is threading.main_thread()
        with Path("seen.txt").open("a") as file:  # of all threads and processes
            print(source.name, is_here, file=file)
        return find(source, work)

    names = OutputNames("out/{stem}.geojson")
    tasks, _ = plan_tasks(["tiles/wide.tif", "tiles/01.tif", "tiles/02.tif"], names)  # 9, 4 and 4 tiles
    steps: list[float] = []
    work = Work(64, progress=lambda done, total: steps.append(done / total))
    run_each(tasks, RegionJob(ReadOptions(), noted), names, work, 4)
    seen = Path("seen.txt").read_text().splitlines()
    assert seen[-1] == "wide.tif True"
    assert sorted(seen[:2]) == ["01.tif False", "02.tif False"]
    assert steps == sorted(steps) and steps[0] == pytest.approx(1 / 3) and steps[-1] == 1 and len(steps) > 5


def test_a_run_that_is_stopped_says_what_is_missing() -> None:
    def stopped(source: Source, work: Work) -> Extraction:
        if source.name == "04.tif":
            raise KeyboardInterrupt
        return find(source, work)

    names = OutputNames("out/{stem}.gpkg", report="report.csv")
    tasks, _ = plan_tasks(["tiles"], names)
    with recording_written() as written, pytest.raises(KeyboardInterrupt):
        run_each(tasks, RegionJob(ReadOptions(), stopped), names, count=1)
    assert sorted(content("out")) == [f"{number:02}.gpkg" for number in range(4)]
    assert str(written) == (
        "out/00.gpkg, out/01.gpkg, out/02.gpkg, out/03.gpkg, report.csv were written; 9 of 13 outputs were "
        "not: out/04.gpkg, out/05.gpkg ... out/wide.gpkg (9 files)"
    )
    with Path("report.csv").open(newline="") as file:
        errors = [row["error"] for row in csv.DictReader(file)]
    assert errors == [""] * 4 + [each.NOT_RUN] * 9
    tasks, skipped = plan_tasks(["tiles"], OutputNames("out/{stem}.gpkg", skip_existing=True))
    assert (len(tasks), skipped) == (9, 4)


def test_a_fault_of_the_program_is_not_swallowed() -> None:
    def faulty(source: Source, work: Work) -> Extraction:
        raise ZeroDivisionError

    names = OutputNames("out/{stem}.gpkg")
    tasks, _ = plan_tasks(["tiles"], names)
    with pytest.raises(ZeroDivisionError):
        run_each(tasks, RegionJob(ReadOptions(), faulty), names, count=2)


@pytest.mark.parametrize(
    ("names", "kind", "text"),
    [
        (OutputNames("out/{stem}.xyz"), OutputError, "regions are written to"),
        (OutputNames("none/{stem}.gpkg"), OutputError, "the folder none does not exist"),
        (OutputNames("out/all.gpkg"), OutputError, "would both be written to out/all.gpkg"),
        (OutputNames("out/{stem}.gpkg", "out/{stem}.gpkg"), ParameterError, "labels are written as GeoTIFF"),
        (OutputNames("out/{stem}.gpkg", "out/all.tif"), OutputError, "would both be written to out/all.tif"),
        (
            OutputNames("out/{stem}.gpkg", "tiles/{stem}.tif"),
            OutputExistsError,
            r"tiles/00\.tif exists \(13 of 13 outputs do\)",
        ),
        (OutputNames("out/{stem}.gpkg", "tiles/{stem}.tif", True), OutputError, "which is read for it"),
        (
            OutputNames("out/{stem}.gpkg", report="out/report.txt"),
            OutputError,
            r"a report is written to \.csv",
        ),
    ],
)
def test_what_cannot_be_written_is_refused_before_anything_is_computed(
    names: OutputNames, kind: type[Exception], text: str
) -> None:
    with pytest.raises(kind, match=text):
        plan_tasks(["tiles"], names)


@pytest.mark.parametrize("sources", [[], ["out"]])
def test_no_raster_is_an_error(sources: Sequence[str]) -> None:
    with pytest.raises(RasterReadError, match=r"no raster|without rasters"):
        plan_tasks(sources, OutputNames("out/{stem}.gpkg"))


def test_a_source_whose_outputs_are_there_in_part_is_not_left_out() -> None:
    Path("out/01.gpkg").touch()
    names = OutputNames("out/{stem}.gpkg", "out/{stem}.tif", skip_existing=True)
    with pytest.raises(OutputExistsError, match=r"out/01\.gpkg exists \(1 of 13 outputs do\)"):
        plan_tasks(["tiles"], names)


def test_equal_warnings_are_one() -> None:
    found = [
        Outcome(name, name, 0, 0.0, texts)
        for name, texts in (("a", ("x", "y")), ("b", ("x",)), ("c", ("x",)))
    ]
    assert grouped_warnings(found) == ["a and 2 others: x", "a: y"]


def test_tasks_are_their_outputs() -> None:
    assert SourceTask("a.tif", "a.gpkg").outputs == ("a.gpkg",)
    assert SourceTask("a.tif", "a.gpkg", "l.tif").outputs == ("a.gpkg", "l.tif")
