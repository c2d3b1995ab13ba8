"""An I/O error at reads of a file: one clear line and nothing left, or the same bytes as without.

A library that is loaded before the C library lets reads fail (`failing_reads.c`).
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

from tests.hostile import campaign, seeds
from tests.hostile.case import Arguments, Case
from tests.hostile.judging import Finding, judge
from tests.hostile.sandbox import Outcome, Sandbox

RUNS = 12  # of each case; as many reads fail, spread over all
NEVER = 1 << 30
LIBTIFF = b"_TIFFFetchStrileValue: Assertion"  # libtiff aborts where it cannot read the index of blocks
ONE = ("--threads", "1")
EXTRACT = ("--range", "0.4,1", "-o", "out.gpkg", *ONE)
FLIGHT = ("-o", "out.plan", "--altitude", "50", "--home", "auto")
PREVIEW = ("-o", "out.png", "--width", "300")
SHAPEFILE = ("r.shp", "r.shx", "r.dbf", "r.prj", "r.cpg")
RASTERS = ("deflate.tif", "overviews.tif", "alpha.tif", "lzw.tif", "jpeg.tif", "sparse.tif", "picture.png")
REGIONS = ("r.geojson", "r.gpkg", "r.fgb", "r.parquet", "r.kml")
DRAWN = (("--mission", "a.plan"), ("--mission", "a.waypoints"), ("--path", "p.geojson"))
COMMANDS: dict[str, tuple[str, tuple[str, ...], Arguments]] = {
    **{name: ("rasters", (name,), ("extract", name, *EXTRACT)) for name in RASTERS},
    "bad blocks": ("rasters", ("deflate.tif",), ("extract", "deflate.tif", "--skip-bad-tiles", *EXTRACT)),
    "block map": ("block_map", ("b.tif", "x.tif"), ("extract", "b.tif", *EXTRACT)),
    **{name: ("vectors", (name,), ("plan", name, *FLIGHT)) for name in REGIONS},
    "r.shp": ("vectors", SHAPEFILE, ("plan", "r.shp", *FLIGHT)),
    "ROS map": ("ros_maps", ("m.yaml", "m.pgm"), ("classify", "m.yaml", "-o", "out.tif", *ONE)),
    **{name: ("missions", (name, "x.tif"), ("preview", "x.tif", how, name, *PREVIEW)) for how, name in DRAWN},
}


@pytest.fixture(scope="module")
def pool(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ProcessPoolExecutor]:
    """Processes in which reads can fail."""
    compiler = shutil.which("cc")
    if compiler is None or not sys.platform.startswith("linux"):
        pytest.skip("there is no C compiler, or this is not Linux")
    library = tmp_path_factory.mktemp("library") / "failing_reads.so"
    source = Path(__file__).with_name("failing_reads.c")
    subprocess.run([compiler, "-shared", "-fPIC", "-o", str(library), str(source), "-ldl"], check=True)
    seeds.everything()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LD_PRELOAD", str(library))
        with campaign.started_with_seeds() as pool:
            pool.submit(os.getpid).result()  # starts it while the variable is set
            yield pool


def ran(case: Case) -> tuple[Outcome, list[Finding]]:
    """What a case did, and what is wrong with that."""
    campaign.prepare()
    sandbox = Sandbox()
    try:
        outcomes = sandbox.run(case)
    finally:
        sandbox.close()
    return outcomes[0], judge(case, outcomes)


def with_failure(case: Case, log: Path, at: int, count: int) -> Case:
    """The case, with so many reads that fail from one of them on; all that follow if `count` is 0."""
    how = {"FAIL_AT": str(at), "FAIL_COUNT": str(count), "FAIL_IN": "/hostile.", "FAIL_LOG": str(log)}
    return replace(case, environment=how)


def reads_of(pool: ProcessPoolExecutor, case: Case, log: Path) -> int:
    """How many reads there are until one fails for good."""
    low, high = 0, 1
    while _fires(pool, case, log, high):
        low, high = high, 2 * high
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if _fires(pool, case, log, middle) else (low, middle)
    return low


def _fires(pool: ProcessPoolExecutor, case: Case, log: Path, at: int) -> bool:
    log.unlink(missing_ok=True)
    pool.submit(ran, with_failure(case, log, at, 1)).result()
    return log.exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [one if k % 3 == 0 else pytest.param(one, marks=pytest.mark.thorough) for k, one in enumerate(COMMANDS)],
)
def test_a_disk_that_fails_for_good(pool: ProcessPoolExecutor, tmp_path: Path, name: str) -> None:
    kind, names, command = COMMANDS[name]
    drawn = getattr(seeds, kind)()
    case = Case({one: drawn[one] for one in names}, (command,))
    log = tmp_path / "failed"
    undisturbed, found = pool.submit(ran, with_failure(case, log, NEVER, 0)).result()
    assert undisturbed.code == 0 and not found and not log.exists()
    count = reads_of(pool, case, log)
    assert count > 3
    refused = 0
    for at in sorted({1 + n * (count - 1) // (RUNS - 1) for n in range(RUNS)}):
        outcome, found = pool.submit(ran, with_failure(case, log, at, 0)).result()
        if LIBTIFF in outcome.err:
            continue
        assert not found, (at, found)
        refused += outcome.code != 0
        assert outcome.code != 0 or outcome.digests == undisturbed.digests, (at, outcome)
    assert refused > 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["deflate.tif", "r.shp", "r.gpkg"])
def test_one_read_that_fails_loses_nothing_in_silence(
    pool: ProcessPoolExecutor, tmp_path: Path, name: str
) -> None:
    kind, names, command = COMMANDS[name]
    drawn = getattr(seeds, kind)()
    case = Case({one: drawn[one] for one in names}, (command,))
    log = tmp_path / "failed"
    undisturbed, _ = pool.submit(ran, case).result()
    count = reads_of(pool, case, log)
    for at in sorted({1 + n * (count - 1) // (2 * RUNS - 1) for n in range(2 * RUNS)}):
        outcome, found = pool.submit(ran, with_failure(case, log, at, 1)).result()
        assert LIBTIFF in outcome.err or not found, (at, found)
        same = outcome.digests == undisturbed.digests
        assert outcome.code != 0 or same or b"warning: " in outcome.err, (at, outcome)
