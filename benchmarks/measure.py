"""Wall time, processor time and peak memory of child processes, from the system's accounting."""

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
    """Resources used by one run.

    Parameters
    ----------
    wall_s : float
    cpu_s : float
        User and system time of the process and of the children that it waited for.
    peak_bytes : int
        Peak resident memory of the largest of these processes.
    """

    wall_s: float
    cpu_s: float
    peak_bytes: int

    def then(self, other: "Cost") -> "Cost":
        """Total of two consecutive runs."""
        peak = max(self.peak_bytes, other.peak_bytes)
        return Cost(self.wall_s + other.wall_s, self.cpu_s + other.cpu_s, peak)


def median(costs: Sequence[Cost]) -> Cost:
    """The median of each number on its own."""
    walls, cpus, peaks = zip(*((c.wall_s, c.cpu_s, c.peak_bytes) for c in costs), strict=True)
    return Cost(statistics.median(walls), statistics.median(cpus), int(statistics.median(peaks)))


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of a competitor on a scene.

    Parameters
    ----------
    competitor : Competitor
    scene : Scene
    costs : tuple of Cost
        One for each round; empty if it did not run.
    stats : tuple of numbers, optional
        Number of polygons, their area in m², and number of invalid polygons.
    remark : str
        Why it did not run, or its error message.
    """

    competitor: Competitor
    scene: Scene
    costs: tuple[Cost, ...] = ()
    stats: tuple[int, float, int] | None = None
    remark: str = ""

    def median(self) -> Cost:
        """The median of each number on its own."""
        return median(self.costs)


class CommandError(RuntimeError):
    """A measured command ended with a non-zero exit code."""


def cost(
    command: Sequence[str],
    environment: Mapping[str, str],
    folder: Path | None = None,
    errors: Path | None = None,
) -> Cost:
    """Run a command and measure it.

    Parameters
    ----------
    command : sequence of str
    environment : mapping
    folder : Path, optional
        Working directory.
    errors : Path, optional
        File for its output; by default only the error message is kept.

    Raises
    ------
    CommandError
        If it fails; the message holds the last line of its output.
    """
    with tempfile.TemporaryFile() if errors is None else errors.open("w+b") as log:
        start = time.perf_counter()
        child = subprocess.Popen(
            command, env=dict(environment), cwd=folder, stdin=subprocess.DEVNULL, stdout=log, stderr=log
        )
        _, status, usage = os.wait4(child.pid, 0)
        wall = time.perf_counter() - start
        child.returncode = os.waitstatus_to_exitcode(status)
        if child.returncode:
            log.seek(0)
            lines = log.read().decode(errors="replace").strip().splitlines() or [""]
            raise CommandError(f"{Path(command[0]).name} ended with {_exit(child.returncode)}: {lines[-1]}")
    return Cost(wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * KIB)


def _exit(code: int) -> str:
    return f"code {code}" if code >= 0 else signal.Signals(-code).name


def run_competitors(
    scene: Scene,
    raster: Path,
    competitors: Sequence[Competitor],
    rounds: int,
    inspect: Callable[[Path], tuple[int, float, int]],
    report: Callable[[str], None],
) -> list[Outcome]:
    """Run the competitors in turn, round by round, so that other load on the machine affects all alike.

    Parameters
    ----------
    scene : Scene
    raster : Path
        Its file.
    competitors : sequence of Competitor
    rounds : int
        Number of runs of each competitor.
    inspect : callable
        Number of polygons, area and number of invalid polygons of a GeoPackage.
    report : callable
        Receives a line about each run.
    """
    remarks = {c.name: c.skip_reason(scene) or "" for c in competitors}
    costs: dict[str, list[Cost]] = {c.name: [] for c in competitors}
    stats: dict[str, tuple[int, float, int]] = {}
    _warm_page_cache(raster)
    for number in range(rounds):
        for competitor in competitors:
            if remarks[competitor.name]:
                continue
            with tempfile.TemporaryDirectory(prefix="uavseg-benchmark-") as folder:
                job = Job(scene, raster, Path(folder) / "regions.gpkg")
                try:
                    spent = _run(competitor, job)
                except CommandError as error:
                    remarks[competitor.name] = str(error)
                    report(f"{scene.title} {competitor.name}: {error}")
                    continue
                costs[competitor.name].append(spent)
                report(f"{scene.title} round {number + 1} {competitor.name}: {spent.wall_s:.2f} s")
                if competitor.name not in stats:
                    stats[competitor.name] = inspect(job.output)
    return [Outcome(c, scene, tuple(costs[c.name]), stats.get(c.name), remarks[c.name]) for c in competitors]


def _run(competitor: Competitor, job: Job) -> Cost:
    first, *others = competitor.commands(job)
    spent = cost(first, competitor.child_environment(), job.output.parent)
    for command in others:
        spent = spent.then(cost(command, competitor.child_environment(), job.output.parent))
    return spent


def _warm_page_cache(path: Path) -> None:
    """Read a file once, so that the first run finds it in the page cache like the others."""
    with path.open("rb") as file:
        while file.read(1 << 20):
            pass
