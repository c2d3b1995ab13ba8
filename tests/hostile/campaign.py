"""A campaign: so many cases, each from its own seed, by as many processes as are given."""

import gc
import importlib
import json
import os
import sys
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from random import Random

from tests.hostile import seeds
from tests.hostile.case import Case
from tests.hostile.judging import Finding, judge
from tests.hostile.sandbox import Outcome, Sandbox

KINDS = {  # share of the cases
    "rasters": 6,
    "formats": 2,
    "vectors": 5,
    "block_maps": 3,
    "ros_maps": 2,
    "missions": 2,
    "scenes": 1,
    "photographs": 2,
    "equipment": 1,
    "bags": 1,
    "options": 4,
    "arguments": 4,
    "references": 1,
    "checkpoints": 1,
}
LIBRARIES = (
    "rasterio",
    "pyogrio",
    "geopandas",
    "shapely",
    "pyproj",
    "pyarrow.parquet",
    "yaml",
    "PIL.TiffImagePlugin",
    "defusedxml.ElementTree",
    "matplotlib.pyplot",
    "rosbags.rosbag1",
    "rosbags.rosbag2",
    "rosbags.typesys.stores.ros1_noetic",
    "rosbags.typesys.stores.ros2_humble",
)
MODULES = (
    *(
        "uavseg.jobs.extract",
        "uavseg.jobs.flights.plan",
        "uavseg.plot.preview",
        "uavseg.regions.formats.export",
    ),
    "uavseg.api.pages",
)
BATCH = 200
BATCHES_A_PROCESS = 20  # then a fresh one; max_tasks_per_child of the pool itself was seen to wait for ever

Found = dict[tuple[str, str], tuple[int, str, Finding]]
Batch = tuple[Counter[str], list[tuple[Finding, str]]]


def make(kind: str, seed: int, number: int, address: str = "127.0.0.1:9") -> Case:
    """The case of a kind with this number: always the same (but for the address)."""
    module = importlib.import_module(f"tests.hostile.{kind}")
    rng = Random(f"{seed} {kind} {number}")
    made: Case = module.case(rng, address) if kind == "references" else module.case(rng)
    return made


def plan_kinds(classes: dict[str, int]) -> list[str]:
    """The kinds in the order in which they take turns."""
    turns = [((n + 0.5) / share, kind) for kind, share in classes.items() for n in range(share)]
    return [kind for _, kind in sorted(turns)]


def run(
    cases: int,
    seed: int = 0,
    processes: int = 1,
    classes: dict[str, int] = KINDS,
    seconds: float = float("inf"),
    batch: Callable[..., Batch] | None = None,
    started: Callable[[int], ProcessPoolExecutor] | None = None,
) -> tuple[Counter[str], Found]:
    """Run cases; returns how many of each kind, and the findings with how often and the first case.

    Parameters
    ----------
    cases : int
    seed : int
    processes : int
    classes : dict of str to int
    seconds : float
        After which no new batch is begun.
    batch, started : callable, optional
        What runs some cases, and the processes in which it does: those of another campaign.
    """
    batch, started = batch or _batch, started or started_with_seeds
    start, count, found = time.monotonic(), Counter[str](), Found()
    batches = [(first, min(first + BATCH, cases)) for first in range(0, cases, BATCH)]
    for turn in range(0, len(batches), BATCHES_A_PROCESS * processes):
        with started(processes) as pool:
            these = batches[turn : turn + BATCHES_A_PROCESS * processes]
            waiting = {pool.submit(batch, *part, seed, classes, start + seconds) for part in these}
            for done in as_completed(waiting):
                counted, findings = done.result()
                count += counted
                for finding, name in findings:
                    key = (finding.kind, finding.signature)
                    times, first, kept = found.get(key, (0, name, finding))
                    found[key] = (times + 1, min(first, name), kept)
    return count, found


def started_with_seeds(processes: int = 1) -> ProcessPoolExecutor:
    """Processes from which cases are forked: fresh ones, without threads, which do not survive a fork."""
    os.environ["PROJ_DEBUG"] = "0"  # for the new processes: PROJ reads it once, when it is loaded
    drawn = {"initializer": seeds.use, "initargs": (seeds.everything(),)}
    return ProcessPoolExecutor(processes, get_context("spawn"), **drawn)


def judged(case: Case) -> list[Finding]:
    """Findings of one case, run from this process, which is one of those that `started_with_seeds` gives."""
    return judge(case, outcomes_of(case))


def outcomes_of(case: Case) -> list[Outcome]:
    """What one case did, run from this process as in `judged`."""
    prepare()
    sandbox = Sandbox()
    try:
        return sandbox.run(case)
    finally:
        sandbox.close()


def _batch(first: int, end: int, seed: int, classes: dict[str, int], until: float) -> Batch:
    if time.monotonic() > until:
        return Counter(), []
    prepare()
    turns, count, found = plan_kinds(classes), Counter[str](), []
    sandbox = Sandbox()
    try:
        for number in range(first, end):
            kind = turns[number % len(turns)]
            case = make(kind, seed, number, sandbox.address)
            count[kind] += 1
            found += [(finding, f"{kind}:{number}") for finding in judge(case, sandbox.run(case))]
    finally:
        sandbox.close()
    return count, found


@cache
def prepare() -> None:
    """Import what cases need, once; forked processes have it then."""
    os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
    if os.environ.get("MPLBACKEND") is None:
        os.environ["MPLBACKEND"] = "agg"
    for name in (*LIBRARIES, *MODULES):
        importlib.import_module(name)
    import click

    from uavseg import cli
    from uavseg._jit.kernels import Kernel
    from uavseg._jit.object_cache import cache_folder

    for command in cli._COMMANDS:
        cli.main.get_command(click.Context(cli.main), command)
    for path in sorted(Path(cli.__file__).parents[1].rglob("*.py")):
        if "kernel" in path.read_text(encoding="utf-8"):
            importlib.import_module(
                ".".join(("uavseg", *path.relative_to(Path(cli.__file__).parents[1]).with_suffix("").parts))
            )
    folder = cache_folder()
    if folder is not None and folder.name == "kernels":
        os.environ["UAVSEG_CACHE"] = str(folder.parent)  # cases have other homes
    for kernel in [found for found in gc.get_objects() if type(found) is Kernel]:  # weak proxies may be dead
        kernel.load()


def report(count: Counter[str], found: Found, seconds: float) -> str:
    """Findings by kind, and how many cases of each kind there were."""
    lines = []
    for (kind, signature), (times, name, finding) in sorted(
        found.items(), key=lambda item: (item[0][0], -item[1][0])
    ):
        lines.append(f"{kind:<10} {times:>5} x  {name:<20} {signature}")
        lines += [f"      | {line}" for line in ascii(finding.detail).replace("\\n", "\n").splitlines()[-8:]]
    classes = ", ".join(f"{kind} {number}" for kind, number in sorted(count.items()))
    total = f"{count.total()} cases in {seconds:.0f} s ({classes}); {len(found)} findings"
    return "\n".join([*lines, total])


def save(folder: Path, name: str, seed: int) -> Case:
    """Write the files of a case, and its commands, to a folder in which one can run it by hand."""
    kind, _, number = name.partition(":")
    case = make(kind, seed, int(number))
    folder.mkdir(parents=True, exist_ok=True)
    for file, content in case.files.items():
        (folder / file).write_bytes(content)
    if case.stdin:
        (folder / "stdin").write_bytes(case.stdin)
    if case.call is not None:
        print(json.dumps(asdict(case.call)))
    for command in case.commands:
        print("uavseg", *map(ascii, command), file=sys.stderr)
    return case
