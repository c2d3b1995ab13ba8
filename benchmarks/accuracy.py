"""Accuracy of states on the two simulated maps, and thin walls classified as free on real maps.

    python -m benchmarks.accuracy

The ground truth comes from the scene: free and occupied where a cell is visible to the sensor, unknown
elsewhere.
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
REAL = {  # image of a map -> metres per cell, occupied and free threshold, as in its YAML file
    "depot.pgm": (0.05, 0.65, 0.25),
    "tb3_sandbox.pgm": (0.05, 0.65, 0.196),
    "turtlebot3_map.pgm": (0.05, 0.65, 0.196),
    "willow-full.pgm": (0.1, 0.65, 0.196),
}
STATES = (1, 2, 3)


@dataclass(frozen=True, slots=True)
class Score:
    """Accuracy of the states of one method on one simulated map.

    Parameters
    ----------
    scene, method : str
    free, unknown, occupied : float
        Intersection over union of each state with the ground truth, mean over the seeds.
    noise : float
        Number of objects that touch no occupied cell of the ground truth, mean over the seeds.
    """

    scene: str
    method: str
    free: float
    unknown: float
    occupied: float
    noise: float


@dataclass(frozen=True, slots=True)
class Hazard:
    """Cells of a real map that are occupied by their own value, and how many of them are classified as free.

    Parameters
    ----------
    map : str
    cells : int
        Number of cells with v above 0.502.
    before, after : float
        Share of them that is classified as free, before and after refinement.
    """

    map: str
    cells: int
    before: float
    after: float


def accuracy() -> tuple[list[Score], list[Hazard]]:
    """All rows, computed in a child process so that the caller needs little memory."""
    command = [sys.executable, "-m", "benchmarks.accuracy"]
    output = subprocess.run(
        command, env=with_project(os.environ), check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    scores, hazards = json.loads(output)
    return [Score(*row) for row in scores], [Hazard(*row) for row in hazards]


def scores(seeds: int = SEEDS) -> Iterator[Score]:
    """Every method on both maps."""
    import numpy as np

    from uavseg.occupancy.simulation.scenes import BUILT_IN_SCENES

    for scene, build in BUILT_IN_SCENES.items():
        simulation = build()
        truth = simulation.truth().states
        maps = [simulation.run(seed) for seed in range(seeds)]
        for method, find in METHODS.items():
            found = [find(grid) for grid in maps]
            ious = np.mean([overlaps(states, truth) for states in found], axis=0)
            noise = np.mean([noise_objects(states, truth) for states in found])
            free, unknown, occupied = ious.tolist()
            yield Score(scene, method, free, unknown, occupied, float(noise))


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


def noise_objects(states: Any, truth: Any) -> int:
    """4-connected occupied components without an occupied cell of the ground truth.

    Examples
    --------
    >>> import numpy as np
    >>> noise_objects(np.array([[3, 3, 1, 3]]), np.array([[1, 3, 1, 1]]))
    1
    """
    import numpy as np
    from scipy import ndimage

    labels, count = ndimage.label(states == 3)
    return int(count - len(np.setdiff1d(np.unique(labels[truth == 3]), [0])))


def by_threshold(grid: Any) -> Any:
    """Threshold each cell by its own v."""
    from uavseg.segmentation.params.segment import StateLimits

    return StateLimits().of(grid.probabilities)


def by_lbpc(grid: Any) -> Any:
    """The original LBP/C; it has no states, so each segment is classified by its mean v."""
    import numpy as np

    from uavseg.segmentation.lbpc import segment_lbpc
    from uavseg.segmentation.params.segment import StateLimits

    labels = segment_lbpc(np.floor(65535 * grid.probabilities.astype(np.float64) + 0.5).astype(np.uint16))
    sums = np.bincount(labels.ravel(), grid.probabilities.ravel())
    means = sums / np.maximum(np.bincount(labels.ravel()), 1)
    return StateLimits().of(means)[labels]


def by_segments(method: str, refine: str) -> Callable[[Any], Any]:
    """The states that `uavseg classify` finds."""

    def find(grid: Any) -> Any:
        from uavseg.occupancy.map_file import stretch_of

        dataset = grid.dataset()
        return classified(dataset, stretch_of(dataset), method, refine).image.read()

    return find


METHODS = {
    "threshold per cell": by_threshold,
    "original LBP/C, segments classified by their mean": by_lbpc,
    "uavseg, division and creation": by_segments("paper", "none"),
    "uavseg, refined": by_segments("paper", "scan"),
    "uavseg adaptive, division and creation": by_segments("adaptive", "none"),
    "uavseg adaptive, refined": by_segments("adaptive", "scan"),
}


def hazards(folder: Path = MAPS) -> Iterator[Hazard]:
    """Thin walls of the real maps that are available."""
    for name in REAL:
        if (folder / name).exists():
            yield _hazard(folder / name)


def opened_map(picture: Path) -> tuple[Any, Any]:
    """Dataset and stretch of a real map, from its picture and the numbers of its YAML file."""
    import tempfile

    from uavseg.access import allowing
    from uavseg.occupancy.map_file import open_map

    metres, occupied, free = REAL[picture.name]
    with tempfile.TemporaryDirectory() as folder:
        described = Path(folder) / "map.yaml"
        described.write_text(
            f"image: {picture}\nresolution: {metres}\norigin: [0, 0, 0]\nnegate: 0\n"
            f"occupied_thresh: {occupied}\nfree_thresh: {free}\n"
        )
        with allowing(picture.parent):
            return open_map(described)


def _hazard(picture: Path) -> Hazard:
    from uavseg.raster.grid.tiling import Window

    dataset, stretch = opened_map(picture)
    values, _ = dataset.read(Window(0, 0, *dataset.geobox.shape))
    cells = int((values > 0.502).sum())
    shares = [
        classified(dataset, stretch, "paper", refine).occupied_in_free / max(cells, 1)
        for refine in ("none", "scan")
    ]
    return Hazard(picture.stem, cells, *shares)


def classified(dataset: Any, stretch: Any, method: str, refine: str) -> Any:
    """`uavseg classify` with a method and a refinement."""
    from uavseg.jobs.maps.classify import ClassifyRequest, classify
    from uavseg.jobs.source.source import ProbabilityMap
    from uavseg.segmentation.params.segment import SegmentParams

    segment = SegmentParams(method, refine=refine)  # type: ignore[arg-type]
    return classify(
        ProbabilityMap(dataset, stretch),
        ClassifyRequest(segment=segment, objects=False, allow_lost_obstacles=True),
    )


if __name__ == "__main__":
    print(json.dumps([[astuple(row) for row in scores()], [astuple(row) for row in hazards()]]))
