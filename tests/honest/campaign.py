"""A differential campaign: honest inputs, each answered by us and by plain code that shares none of ours."""

import importlib
import os
import shutil
import signal
import tempfile
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from random import Random
from types import FrameType

from tests.honest.findings import findings_of
from tests.hostile import campaign as hostile
from tests.hostile.judging import Finding

KINDS = {  # share of the cases
    "files": 8,
    "forms": 5,
    "arrays": 5,
    "bands": 2,
    "ranges": 4,
    "segments": 3,
    "outputs": 4,
    "turns": 2,
    "missions": 1,
    "summaries": 2,
    "commands": 3,
    "things": 2,
}
PATIENCE_S = 60


def run(
    cases: int,
    seed: int = 0,
    processes: int = 1,
    classes: dict[str, int] = KINDS,
    seconds: float = float("inf"),
) -> tuple[Counter[str], hostile.Found]:
    """Run cases as the hostile campaign does."""
    return hostile.run(cases, seed, processes, classes, seconds, batch=batch, started=started)


def run_here(cases: int, seed: int) -> tuple[Counter[str], hostile.Found]:
    """Run cases in this process."""
    count, found = batch(0, cases, seed, KINDS, float("inf"))
    return count, {(finding.kind, finding.signature): (1, name, finding) for finding, name in found}


def started(processes: int = 1) -> ProcessPoolExecutor:
    """Fresh processes, which see nothing of this one."""
    return ProcessPoolExecutor(processes, get_context("spawn"))


def batch(
    first: int, end: int, seed: int, classes: dict[str, int], until: float
) -> tuple[Counter[str], list[tuple[Finding, str]]]:
    """Some cases in a row, in this process."""
    turns, count, found = hostile.plan_kinds(classes), Counter[str](), []
    folder = Path(tempfile.mkdtemp(prefix="honest.", dir="/dev/shm" if Path("/dev/shm").is_dir() else None))
    try:
        for number in range(first, end):
            if time.monotonic() > until:
                break
            kind = turns[number % len(turns)]
            count[kind] += 1
            found += [(finding, f"{kind}:{number}") for finding in one(kind, seed, number, folder / "case")]
    finally:
        shutil.rmtree(folder)
    return count, found


def one(kind: str, seed: int, number: int, folder: Path) -> list[Finding]:
    """The findings of one case, whose files are left in a folder."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    module = importlib.import_module(f"tests.honest.{kind}")
    before, handler = Path.cwd(), signal.signal(signal.SIGALRM, _give_up)
    os.chdir(folder)
    signal.alarm(PATIENCE_S)
    try:
        return findings_of(module.case, Random(f"{seed} {kind} {number}"), folder)
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, handler)
        os.chdir(before)


def _give_up(_number: int, _frame: FrameType | None) -> None:
    raise TimeoutError(f"no answer in {PATIENCE_S} s")
