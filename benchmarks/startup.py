"""Start-up time: the interpreter, the libraries that every run needs, `uavseg --help`, and one small tile."""

import os
import statistics
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.competitors import LOW, with_project
from benchmarks.measure import Cost, cost
from benchmarks.scenes import Scene, ensure_raster

TILE = Scene(512)
RUNS = 9
TILES = 200
LIBRARIES = "import rasterio, shapely"


@dataclass(frozen=True, slots=True)
class Start:
    """Start-up time of one command, medians of several runs.

    Parameters
    ----------
    title : str
    wall_s, cpu_s : float
    ratio : float
        Wall time as a multiple of importing rasterio and shapely, in the same round.
    imports_s : float
        Sum of the self times of all modules in ``-X importtime``, from a separate run.
    """

    title: str
    wall_s: float
    cpu_s: float
    ratio: float
    imports_s: float


@dataclass(frozen=True, slots=True)
class Imported:
    """Modules that a command imports from one package, and the sum of their self times."""

    package: str
    modules: int
    seconds: float


def starts(runs: int = RUNS) -> tuple[list[Start], list[Imported]]:
    """Start-up of several commands, and the packages that `uavseg extract` imports for GeoJSON.

    Parameters
    ----------
    runs : int
        Number of rounds; each runs every command once.
    """
    extract = [
        "-m",
        "uavseg",
        "extract",
        str(ensure_raster(TILE)),
        "--range",
        f"{LOW},1",
        "-q",
        "--overwrite",
    ]
    each = [*extract[:3], "tiles", "--each", *extract[4:]]
    commands = {
        "`python -c pass`": ["-c", "pass"],
        f'`python -c "{LIBRARIES}"`': ["-c", LIBRARIES],
        "`uavseg --help`": ["-m", "uavseg", "--help"],
        f"`uavseg extract` to GeoJSON, {TILE.side} x {TILE.side}": [*extract, "-o", "regions.geojson"],
        f"`uavseg extract` to GeoPackage, {TILE.side} x {TILE.side}": [*extract, "-o", "regions.gpkg"],
        f"{TILES} such tiles by one `uavseg extract --each`": [*each, "-o", "{stem}.gpkg"],
    }
    with tempfile.TemporaryDirectory(prefix="uavseg-benchmark-") as folder:
        work = Path(folder)
        (work / "tiles").mkdir()
        for number in range(TILES):
            (work / "tiles" / f"{number}.tif").symlink_to(ensure_raster(TILE).absolute())
        rounds = [[_once(command, work) for command in commands.values()] for _ in range(runs + 1)]
        logs = [_import_log(command, work) for command in commands.values()]
    measured = zip(commands, zip(*rounds[1:], strict=True), logs, strict=True)  # the first round compiles
    libraries = [taken[1].wall_s for taken in rounds[1:]]
    return [_start(title, costs, libraries, log) for title, costs, log in measured], imported(logs[3])


def _start(title: str, costs: Sequence[Cost], libraries: Sequence[float], log: str) -> Start:
    return Start(
        title,
        wall_s=statistics.median(taken.wall_s for taken in costs),
        cpu_s=statistics.median(taken.cpu_s for taken in costs),
        ratio=statistics.median(taken.wall_s / other for taken, other in zip(costs, libraries, strict=True)),
        imports_s=sum(one.seconds for one in imported(log)),
    )


def _once(arguments: list[str], folder: Path) -> Cost:
    return cost([sys.executable, *arguments], _environment(), folder)


def _import_log(arguments: list[str], folder: Path) -> str:
    log = folder / "importtime.txt"
    cost([sys.executable, "-X", "importtime", *arguments], _environment(), folder, log)
    return log.read_text()


def _environment() -> dict[str, str]:
    """Return the environment with the project, and with bytecode that is kept, as an installation has it."""
    return {
        name: value for name, value in with_project(os.environ).items() if name != "PYTHONDONTWRITEBYTECODE"
    }


def imported(log: str) -> list[Imported]:
    """Imports by package, the slowest first, from the output of ``-X importtime``.

    Examples
    --------
    >>> imported("import time: self [us] | cumulative | imported\\nimport time:  1500 |  1500 |   os.path")
    [Imported(package='os', modules=1, seconds=0.0015)]
    """
    times: dict[str, list[float]] = {}
    for line in log.splitlines():
        words = line.replace("|", " ").split()
        if line.startswith("import time:") and words[2].isdigit():
            times.setdefault(words[4].partition(".")[0], []).append(int(words[2]) / 1e6)
    found = [Imported(package, len(spent), sum(spent)) for package, spent in times.items()]
    return sorted(found, key=lambda one: -one.seconds)
