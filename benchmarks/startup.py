"""Start-up time: the interpreter, `uavseg --help`, and one small tile."""

import os
import statistics
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from benchmarks.competitors import LOW, with_project
from benchmarks.measure import Cost, cost
from benchmarks.scenes import Scene, ensure_raster

TILE = Scene(512)
RUNS = 5


@dataclass(frozen=True, slots=True)
class Start:
    """Start-up time of one command, medians of several runs.

    Parameters
    ----------
    title : str
    wall_s, cpu_s : float
    imports_s : float
        Sum of the self times of all modules in ``-X importtime``, from separate runs.
    """

    title: str
    wall_s: float
    cpu_s: float
    imports_s: float


def starts(runs: int = RUNS) -> list[Start]:
    """Start-up of `python -c pass`, `uavseg --help` and `uavseg extract` on a tile of 512 x 512.

    Parameters
    ----------
    runs : int
        Number of runs of each.
    """
    tile = str(ensure_raster(TILE))
    extract = [
        "-m",
        "uavseg",
        "extract",
        tile,
        "--range",
        f"{LOW},1",
        "-q",
        "--overwrite",
        "-o",
        "regions.gpkg",
    ]
    with tempfile.TemporaryDirectory(prefix="uavseg-benchmark-") as folder:
        work = Path(folder)
        _once(extract, work)  # compiles the kernels
        return [
            _start("`python -c pass`", ["-c", "pass"], work, runs),
            _start("`uavseg --help`", ["-m", "uavseg", "--help"], work, runs),
            _start(f"`uavseg extract`, {TILE.side} x {TILE.side}", extract, work, runs),
        ]


def _start(title: str, arguments: list[str], folder: Path, runs: int) -> Start:
    costs = [_once(arguments, folder) for _ in range(runs)]
    imports = statistics.median(_importing(arguments, folder) for _ in range(runs))
    wall = statistics.median(taken.wall_s for taken in costs)
    return Start(title, wall, statistics.median(taken.cpu_s for taken in costs), imports)


def _once(arguments: list[str], folder: Path) -> Cost:
    return cost([sys.executable, *arguments], with_project(os.environ), folder)


def _importing(arguments: list[str], folder: Path) -> float:
    log = folder / "importtime.txt"
    cost([sys.executable, "-X", "importtime", *arguments], with_project(os.environ), folder, log)
    return imports_s(log.read_text())


def imports_s(log: str) -> float:
    """Seconds spent in imports, from the output of ``-X importtime``.

    Examples
    --------
    >>> imports_s("import time: self [us] | cumulative | imported\\nimport time:  1500 |  1500 | os")
    0.0015
    """
    total = 0
    for line in log.splitlines():
        words = line.replace("|", " ").split()
        if line.startswith("import time:") and words[2].isdigit():
            total += int(words[2])
    return total / 1e6
