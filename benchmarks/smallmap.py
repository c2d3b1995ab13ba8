"""Milliseconds to segment a map of 320 x 320 cells and plan over it, beside a segmentation of scikit-image.

    python -m benchmarks.smallmap

One thread, maps in memory, everything compiled; medians of many runs, of everybody in turn.
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
    who : str
        And what is done.
    lens_ms, circles_ms : float
        Medians on the two maps.
    """

    who: str
    lens_ms: float
    circles_ms: float


def tasks() -> list[Task]:
    """All rows, measured in a process of its own so that the caller stays small."""
    command = [sys.executable, "-m", "benchmarks.smallmap"]
    told = subprocess.run(
        command, env=with_project(os.environ), check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    return [Task(*row) for row in json.loads(told)]


def measured(runs: int = RUNS) -> list[Task]:
    """Medians of every task on both maps."""
    from uavseg.occupancy.simulation.paper_scenes import BUILT_IN

    found = [_medians(_calls(BUILT_IN[scene]().run(), *ENDS[scene]), runs) for scene in ("lens", "circles")]
    return [Task(who, 1e3 * found[0][who], 1e3 * found[1][who]) for who in found[0]]


def _medians(calls: dict[str, Callable[[], Any]], runs: int) -> dict[str, float]:
    times: dict[str, list[float]] = {who: [] for who in calls}
    for _ in range(runs + 1):
        for who, call in calls.items():
            begun = time.perf_counter()
            call()
            times[who].append(time.perf_counter() - begun)
    return {who: statistics.median(every[1:]) for who, every in times.items()}  # the first one compiles


def _calls(grid: Any, start: tuple[float, float], goal: tuple[float, float]) -> dict[str, Callable[[], Any]]:
    """What is timed on a map."""
    from skimage.segmentation import felzenszwalb

    import uavseg
    from uavseg.jobs.classify import ClassifyRequest, classify
    from uavseg.jobs.open_source import ProbabilityMap
    from uavseg.jobs.path import PathRequest, free_cells
    from uavseg.occupancy.paths.find_path import find_way
    from uavseg.occupancy.probability_map import stretch_of
    from uavseg.segmentation.intervals import IntensityRange
    from uavseg.segmentation.params import SegmentParams

    dataset, interval = grid.dataset(), IntensityRange(*RANGE)
    source = ProbabilityMap(dataset, stretch_of(dataset))
    request = PathRequest(interval, start, goal, segment=SegmentParams())
    free = free_cells(source, request)
    return {
        "uavseg: segment by a range, and plan": lambda: uavseg.path(grid, RANGE, start, goal, threads=1),
        "uavseg: segment by a range": lambda: free_cells(source, request),
        "uavseg: plan": lambda: find_way(free, start, goal),
        "uavseg: states, refined": lambda: classify(source, ClassifyRequest(objects=False)),
        "uavseg: states, refined, and objects": lambda: classify(source),
        "scikit-image: felzenszwalb, no plan": lambda: felzenszwalb(
            grid.probabilities, scale=100, sigma=0.5, min_size=64
        ),
    }


if __name__ == "__main__":
    print(json.dumps([astuple(row) for row in measured()]))
