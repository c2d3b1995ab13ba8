"""How right states are on the two simulated maps, and how many thin walls real maps hide in free space.

    python -m benchmarks.accuracy

The truth is the scene's: free and occupied where the sensor could see a cell, unknown where it could not.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any

from benchmarks.competitors import with_project

SEEDS = 10
MAPS = Path(__file__).resolve().parents[2] / "shared" / "data" / "maps"
REAL = {  # picture of a map to its metres per cell and thresholds: those of its YAML file
    "depot.pgm": (0.05, 0.65, 0.25),
    "tb3_sandbox.pgm": (0.05, 0.65, 0.196),
    "turtlebot3_map.pgm": (0.05, 0.65, 0.196),
    "willow-full.pgm": (0.1, 0.65, 0.196),
}
STATES = (1, 2, 3)


@dataclass(frozen=True, slots=True)
class Score:
    """How well one method finds the states of one simulated map.

    Parameters
    ----------
    scene, who : str
    free, unknown, occupied : float
        Intersection over union of each state with the truth, the mean over the seeds.
    """

    scene: str
    who: str
    free: float
    unknown: float
    occupied: float


@dataclass(frozen=True, slots=True)
class Hazard:
    """Cells of a real map whose own v is that of an obstacle.

    Parameters
    ----------
    map : str
    cells : int
        With v above 0.502.
    unrefined, refined : float
        The share of them that is called free before and after refinement.
    """

    map: str
    cells: int
    unrefined: float
    refined: float


def accuracy() -> tuple[list[Score], list[Hazard]]:
    """All rows, found in a process of its own so that the caller stays small."""
    command = [sys.executable, "-m", "benchmarks.accuracy"]
    told = subprocess.run(
        command, env=with_project(os.environ), check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    scores, hazards = json.loads(told)
    return [Score(*row) for row in scores], [Hazard(*row) for row in hazards]


def scores(seeds: int = SEEDS) -> Iterator[Score]:
    """Every method on both maps."""
    import numpy as np

    from uavseg.occupancy.simulation.paper_scenes import BUILT_IN

    for scene, build in BUILT_IN.items():
        simulation = build()
        truth = simulation.truth().states
        maps = [simulation.run(seed) for seed in range(seeds)]
        for who, find in METHODS.items():
            found = np.mean([overlaps(find(grid), truth) for grid in maps], axis=0)
            yield Score(scene, who, *found.tolist())


def overlaps(states: Any, truth: Any) -> list[float]:
    """Intersection over union of each state.

    Examples
    --------
    >>> import numpy as np
    >>> overlaps(np.array([1, 1, 2, 3]), np.array([1, 2, 2, 3]))
    [0.5, 0.5, 1.0]
    """
    pairs = [(states == state, truth == state) for state in STATES]
    return [float((one & other).sum() / max((one | other).sum(), 1)) for one, other in pairs]


def by_threshold(grid: Any) -> Any:
    """Each cell by its own v."""
    from uavseg.segmentation.intervals import StateLimits

    return StateLimits().of(grid.probabilities)


def by_original(grid: Any) -> Any:
    """The original LBP/C, which knows no states: each of its segments by its mean v."""
    import numpy as np

    from uavseg.segmentation.baseline.lbpc import segment_lbpc
    from uavseg.segmentation.intervals import StateLimits

    labels = segment_lbpc(np.floor(65535 * grid.probabilities.astype(np.float64) + 0.5).astype(np.uint16))
    sums = np.bincount(labels.ravel(), grid.probabilities.ravel())
    means = sums / np.maximum(np.bincount(labels.ravel()), 1)
    return StateLimits().of(means)[labels]


def by_segments(method: str, refine: str) -> Callable[[Any], Any]:
    """`uavseg classify`."""

    def find(grid: Any) -> Any:
        from uavseg.occupancy.probability_map import stretch_of

        dataset = grid.dataset()
        return _classified(dataset, stretch_of(dataset), method, refine).image.read()

    return find


METHODS = {
    "thresholds, cell by cell": by_threshold,
    "original LBP/C, segments by their mean": by_original,
    "uavseg, division and creation": by_segments("paper", "none"),
    "uavseg, refined": by_segments("paper", "scan"),
    "uavseg adaptive, division and creation": by_segments("adaptive", "none"),
    "uavseg adaptive, refined": by_segments("adaptive", "scan"),
}


def hazards(folder: Path = MAPS) -> Iterator[Hazard]:
    """The real maps that are there."""
    for name in REAL:
        if (folder / name).exists():
            yield _hazard(folder / name)


def _hazard(picture: Path) -> Hazard:
    import tempfile

    from uavseg.occupancy.probability_map import open_map
    from uavseg.raster.tiling import Window

    metres, occupied, free = REAL[picture.name]
    with tempfile.TemporaryDirectory() as folder:
        described = Path(folder) / "map.yaml"
        described.write_text(
            f"image: {picture}\nresolution: {metres}\norigin: [0, 0, 0]\nnegate: 0\n"
            f"occupied_thresh: {occupied}\nfree_thresh: {free}\n"
        )
        dataset, stretch = open_map(described)
    values, _ = dataset.read(Window(0, 0, *dataset.geobox.shape))
    cells = int((values > 0.502).sum())
    shares = [
        _classified(dataset, stretch, "paper", refine).occupied_in_free / max(cells, 1)
        for refine in ("none", "scan")
    ]
    return Hazard(picture.stem, cells, *shares)


def _classified(dataset: Any, stretch: Any, method: str, refine: str) -> Any:
    from uavseg.jobs.classify import ClassifyRequest, classify
    from uavseg.jobs.open_source import ProbabilityMap
    from uavseg.segmentation.params import SegmentParams

    segment = SegmentParams(method, refine=refine)  # type: ignore[arg-type]
    return classify(ProbabilityMap(dataset, stretch), ClassifyRequest(segment=segment, objects=False))


if __name__ == "__main__":
    print(json.dumps([[astuple(row) for row in scores()], [astuple(row) for row in hazards()]]))
