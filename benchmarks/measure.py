"""What a process costs: wall time, processor time and peak memory, as the system counts them."""

import os
import signal
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.competitors import Competitor, Job
from benchmarks.scenes import Scene

KIB = 1024 if os.uname().sysname != "Darwin" else 1  # unit of ru_maxrss in bytes


@dataclass(frozen=True, slots=True)
class Cost:
    """What one run took.

    Parameters
    ----------
    wall_s : float
    cpu_s : float
        User and system time of the process and of all it waited for.
    peak_bytes : int
        Largest resident memory of any one process among them.
    """

    wall_s: float
    cpu_s: float
    peak_bytes: int

    def then(self, other: "Cost") -> "Cost":
        """One run after another."""
        peak = max(self.peak_bytes, other.peak_bytes)
        return Cost(self.wall_s + other.wall_s, self.cpu_s + other.cpu_s, peak)


def median(costs: Sequence[Cost]) -> Cost:
    """The median of each number on its own."""
    walls, cpus, peaks = zip(*((c.wall_s, c.cpu_s, c.peak_bytes) for c in costs), strict=True)
    return Cost(statistics.median(walls), statistics.median(cpus), int(statistics.median(peaks)))


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a competitor made of a scene.

    Parameters
    ----------
    competitor : Competitor
    scene : Scene
    costs : tuple of Cost
        Of each round; empty where it did not run.
    answer : tuple of numbers, optional
        Polygons, their area in m², and how many are invalid.
    remark : str
        Why it did not run, or how it failed.
    """

    competitor: Competitor
    scene: Scene
    costs: tuple[Cost, ...] = ()
    answer: tuple[int, float, int] | None = None
    remark: str = ""

    def median(self) -> Cost:
        """The median of each number on its own."""
        return median(self.costs)


class CommandError(RuntimeError):
    """A measured command ended with another exit code than 0."""


def cost(
    command: Sequence[str],
    environment: Mapping[str, str],
    folder: Path | None = None,
    errors: Path | None = None,
) -> Cost:
    """Run a command and tell what it took.

    Parameters
    ----------
    command : sequence of str
    environment : mapping
    folder : Path, optional
        Where it runs.
    errors : Path, optional
        Where its stderr goes; kept for the error message only, if left out.

    Raises
    ------
    CommandError
        If it fails; the last line of its stderr is in the message.
    """
    with tempfile.TemporaryFile() if errors is None else errors.open("w+b") as said:
        start = time.perf_counter()
        child = subprocess.Popen(
            command, env=dict(environment), cwd=folder, stdin=subprocess.DEVNULL, stdout=said, stderr=said
        )
        _, status, usage = os.wait4(child.pid, 0)
        wall = time.perf_counter() - start
        child.returncode = os.waitstatus_to_exitcode(status)
        if child.returncode:
            said.seek(0)
            lines = said.read().decode(errors="replace").strip().splitlines() or [""]
            raise CommandError(f"{Path(command[0]).name} ended with {_exit(child.returncode)}: {lines[-1]}")
    return Cost(wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * KIB)


def _exit(code: int) -> str:
    return f"code {code}" if code >= 0 else signal.Signals(-code).name


def outcomes(
    scene: Scene,
    raster: Path,
    competitors: Sequence[Competitor],
    rounds: int,
    judge: Callable[[Path], tuple[int, float, int]],
    tell: Callable[[str], None],
) -> list[Outcome]:
    """Let each competitor run once, then each again: what else the machine does meets all of them.

    Parameters
    ----------
    scene : Scene
    raster : Path
        Its file.
    competitors : sequence of Competitor
    rounds : int
        How often; the numbers are medians.
    judge : callable
        Says of a GeoPackage how many polygons it holds, their area, and how many are invalid.
    tell : callable
        Takes a line about each run.
    """
    remarks = {c.name: c.why_not(scene) or "" for c in competitors}
    costs: dict[str, list[Cost]] = {c.name: [] for c in competitors}
    answers: dict[str, tuple[int, float, int]] = {}
    _warm(raster)
    for number in range(rounds):
        for competitor in competitors:
            if remarks[competitor.name]:
                continue
            with tempfile.TemporaryDirectory(prefix="uavseg-benchmark-") as folder:
                job = Job(scene, raster, Path(folder) / "regions.gpkg")
                try:
                    taken = _run(competitor, job)
                except CommandError as error:
                    remarks[competitor.name] = str(error)
                    tell(f"{scene.title} {competitor.name}: {error}")
                    continue
                costs[competitor.name].append(taken)
                tell(f"{scene.title} round {number + 1} {competitor.name}: {taken.wall_s:.2f} s")
                if competitor.name not in answers:
                    answers[competitor.name] = judge(job.output)
    return [
        Outcome(c, scene, tuple(costs[c.name]), answers.get(c.name), remarks[c.name]) for c in competitors
    ]


def _run(competitor: Competitor, job: Job) -> Cost:
    first, *others = competitor.commands(job)
    taken = cost(first, competitor.variables(), job.output.parent)
    for command in others:
        taken = taken.then(cost(command, competitor.variables(), job.output.parent))
    return taken


def _warm(path: Path) -> None:
    """Read a file bit by bit, so that the first to run finds it in memory as the others do."""
    with path.open("rb") as file:
        while file.read(1 << 20):
            pass
