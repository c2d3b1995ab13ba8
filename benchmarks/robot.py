"""Incremental occupancy mapping: scans are merged into a large map, and its segments are updated.

    python -m benchmarks.robot

A map of 2000 x 2000 cells of 5 cm, scans of 720 beams with a range of 30 m; medians of 200 scans. The
processor time of one thread is measured, so other load on the machine does not count.
"""

import json
import math
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from benchmarks.competitors import with_project

SIDE = 2000
CELL_M = 0.05
RUNS = 200
WARM_UP = 20  # scans before the measurement, which load the kernels and fill the map


@dataclass(frozen=True, slots=True)
class Step:
    """One row of the table.

    Parameters
    ----------
    title : str
    ms : float
        Median.
    merging_ms : float
        Median time of merging alone; 0 if nothing is merged.
    blocks : float
        Median number of blocks that were measured or divided again, out of 1024.
    remark : str
    """

    title: str
    ms: float
    merging_ms: float
    blocks: float
    remark: str = ""


def steps() -> list[Step]:
    """All rows, measured in a child process, on one core."""
    command = [sys.executable, "-m", "benchmarks.robot"]
    output = subprocess.run(
        command, env=with_project(os.environ), check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    return [Step(*row) for row in json.loads(output)]


def room() -> Any:
    """A furnished room of 26 x 18 m: from near its centre, walls are 3 to 20 m away."""
    from uavseg.occupancy.simulation.simulate import Scene

    walls = [(36, 41, 37, 61), (63, 41, 64, 61), (37, 41, 63, 42), (37, 60, 63, 61)]
    boxes = [(42, 45, 44, 47), (55, 55, 58, 57)]
    polygons = [[(x0, y0), (x1, y0), (x1, y1), (x0, y1)] for x0, y0, x1, y1 in walls + boxes]
    return Scene(polygons, [(47.0, 55.0, 1.0), (58.0, 46.0, 0.5)])


def scans(scene: Any, count: int) -> list[Any]:
    """Scans of a robot that drives 4 cm and turns slightly between scans."""
    import numpy as np

    from uavseg.occupancy.mapping.scan import Pose
    from uavseg.occupancy.simulation.simulate import RangeFinder

    sensor = RangeFinder(sigma_m=0.03, max_range_m=30.0, fov_deg=360.0, step_deg=0.5)
    poses = [
        Pose(46.013 + 0.04 * k, 50.987 + math.sin(0.05 * k), heading_rad=math.radians(0.7 * k))
        for k in range(count)
    ]
    return [sensor.scan(scene, pose, np.random.default_rng([7, k])) for k, pose in enumerate(poses)]


def _grid() -> Any:
    from uavseg.occupancy.mapping.grid import OccupancyGrid

    return OccupancyGrid.empty((SIDE, SIDE), CELL_M)


def _median_ms(call: Callable[[], Any], before: Callable[[], Any] | None = None) -> float:
    taken = []
    for _ in range(RUNS):
        if before is not None:
            before()
        start = time.thread_time()
        call()
        taken.append(time.thread_time() - start)
    return 1e3 * statistics.median(taken)


def _update(title: str, scene: Any, forget: bool, remark: str) -> Step:
    """Consecutive updates along one drive; merging alone is measured on a second map."""
    drive = scans(scene, WARM_UP + RUNS)
    updated, merged = _grid(), _grid()
    for scan in drive[:WARM_UP]:
        updated.update(scan)
        merged.merge(scan)
    updated.refit()
    to_update = iter(drive[WARM_UP:])
    blocks: list[int] = []

    def reset() -> None:
        if forget:
            updated.reset()
            _ = updated.segmentation.intervals

    ms = _median_ms(lambda: blocks.append(int(updated.update(next(to_update)).blocks.sum())), reset)
    to_merge = iter(drive[WARM_UP:])
    merging_ms = _median_ms(lambda: merged.merge(next(to_merge)), merged.reset if forget else None)
    return Step(title, ms, merging_ms, statistics.median(blocks), remark)


def _whole_map(scene: Any) -> Iterator[Step]:
    """Segmentation of the whole map, with only the R that states need and with all R."""
    from uavseg.occupancy.map_file import stretch_of
    from uavseg.raster.grid.tiling import TilePass, tiles
    from uavseg.segmentation.params.segment import SegmentParams, StateLimits
    from uavseg.segmentation.pipeline import measure_block_map, measure_block_map_for
    from uavseg.segmentation.source import GreySource

    grid = _grid()
    for scan in scans(scene, WARM_UP):
        grid.merge(scan)
    dataset = grid.dataset()
    source, windows = GreySource(dataset, stretch_of(dataset)), tiles((SIDE, SIDE), 512)
    paper = SegmentParams(method="paper")
    ms = _median_ms(lambda: measure_block_map_for(source, StateLimits(), paper, TilePass(windows)))
    yield Step("segmentation of the whole map", ms, 0.0, 1024, "for states")
    ms = _median_ms(lambda: measure_block_map(source, TilePass(windows)))
    yield Step("segmentation of the whole map", ms, 0.0, 1024, "all R, for any range")
    live = grid.segmentation
    yield Step(
        "`refit`", _median_ms(live.refit), 0.0, 1024, "bin edges fitted again, all blocks divided again"
    )


def _measure() -> Iterator[Step]:
    from uavseg.occupancy.simulation.simulate import Scene

    yield _update("update in a room", room(), False, "walls at 3 to 20 m, known map")
    yield _update("update in a room, new map", room(), True, "map reset before each scan")
    yield _update("update in empty space", Scene(), False, "no returns; most cells are free already")
    yield _update(
        "update in empty space, new map",
        Scene(),
        True,
        "worst case: all beams 30 m long, all cells change",
    )
    yield from _whole_map(room())


if __name__ == "__main__":
    rows = [(row.title, row.ms, row.merging_ms, row.blocks, row.remark) for row in _measure()]
    print(json.dumps(rows))
