"""Milliseconds to segment a map of 320 x 320 cells and plan a path, compared with scikit-image.

    python -m benchmarks.smallmap

One thread, maps in memory, kernels compiled; medians of many runs, with the tasks in turn.
"""

import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import astuple, dataclass
from typing import Any

from benchmarks.competitors import with_project

RUNS = 101
RANGE = (0.0, 0.45)
ENDS = {"lens": ((1.605, 2.805), (2.105, 0.605)), "circles": ((0.705, 2.005), (2.505, 1.105))}


@dataclass(frozen=True, slots=True)
class Task:
    """One row of the table.

    Parameters
    ----------
    title : str
        Library and task.
    lens_ms, circles_ms : float
        Medians on the two maps.
    """

    title: str
    lens_ms: float
    circles_ms: float


def tasks() -> list[Task]:
    """All rows, measured in a child process so that the caller needs little memory."""
    command = [sys.executable, "-m", "benchmarks.smallmap"]
    output = subprocess.run(
        command, env=with_project(os.environ), check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    return [Task(*row) for row in json.loads(output)]


def measured(runs: int = RUNS) -> list[Task]:
    """Medians of every task on both maps."""
    from uavseg.occupancy.simulation.scenes import BUILT_IN_SCENES

    found = [
        _medians(_calls(BUILT_IN_SCENES[scene]().run(), *ENDS[scene]), runs) for scene in ("lens", "circles")
    ]
    return [Task(title, 1e3 * found[0][title], 1e3 * found[1][title]) for title in found[0]]


def _medians(calls: dict[str, Callable[[], Any]], runs: int) -> dict[str, float]:
    times: dict[str, list[float]] = {title: [] for title in calls}
    for _ in range(runs + 1):
        for title, call in calls.items():
            begun = time.perf_counter()
            call()
            times[title].append(time.perf_counter() - begun)
    return {title: statistics.median(runs[1:]) for title, runs in times.items()}  # the first run compiles


def _calls(grid: Any, start: tuple[float, float], goal: tuple[float, float]) -> dict[str, Callable[[], Any]]:
    """The timed calls for one map."""
    from skimage.segmentation import felzenszwalb

    import uavseg
    from uavseg.jobs.maps.classify import ClassifyRequest, classify
    from uavseg.jobs.maps.path import PathRequest, free_cells
    from uavseg.jobs.source.source import ProbabilityMap
    from uavseg.occupancy.map_file import stretch_of
    from uavseg.occupancy.paths.find_path import find_path
    from uavseg.segmentation.params.segment import IntensityRange, SegmentParams

    dataset, interval = grid.dataset(), IntensityRange(*RANGE)
    source = ProbabilityMap(dataset, stretch_of(dataset))
    request = PathRequest(interval, start, goal, segment=SegmentParams())
    free = free_cells(source, request)
    return {
        "uavseg: segment by a range, and plan a path": lambda: uavseg.path(
            grid, RANGE, start, goal, threads=1
        ),
        "uavseg: segment by a range": lambda: free_cells(source, request),
        "uavseg: plan a path": lambda: find_path(free, start, goal),
        "uavseg: states, refined": lambda: classify(source, ClassifyRequest(objects=False)),
        "uavseg: states, refined, and objects": lambda: classify(source),
        "scikit-image: felzenszwalb, no path": lambda: felzenszwalb(
            grid.probabilities, scale=100, sigma=0.5, min_size=64
        ),
    }


if __name__ == "__main__":
    print(json.dumps([astuple(row) for row in measured()]))
