"""Texture segmentation by sample, compared with texture features and a random forest.

    python -m benchmarks.match

Scenes have two or more textures with equal mean and equal standard deviation of grey; a disc inside the
ground truth is the sample. The random forest also gets a sample of the background, of the same size;
`uavseg` does not.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass
from typing import Any

from benchmarks import table
from benchmarks.competitors import with_project
from benchmarks.textures import DEVIATION, FAMILIES, MEAN, SIDE, Scene, scene

SEEDS = (1, 2, 3)


@dataclass(frozen=True, slots=True)
class Score:
    """Accuracy of one method on one family.

    Parameters
    ----------
    method, family : str
    overlap : float
        Intersection over union with the ground truth, mean over the seeds.
    seconds : float
        Mean time for one scene.
    """

    method: str
    family: str
    overlap: float
    seconds: float


def measure_matches() -> list[Score]:
    """All rows, computed in a child process so that the caller needs little memory."""
    command = [sys.executable, "-m", "benchmarks.match"]
    output = subprocess.run(
        command, env=with_project(os.environ), check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    return [Score(*row) for row in json.loads(output)]


def table_by_family(scores: Sequence[Score]) -> str:
    """A row for each family, a column for each method."""
    methods = list(dict.fromkeys(score.method for score in scores))
    by_name = {(score.family, score.method): score for score in scores}
    families = list(dict.fromkeys(score.family for score in scores))
    cells = [[family, *(f"{by_name[family, name].overlap:.3f}" for name in methods)] for family in families]
    for title, value in (("mean", "overlap"), ("seconds per scene", "seconds")):
        every = [[getattr(by_name[family, name], value) for family in families] for name in methods]
        cells.append([title, *(f"{sum(column) / len(column):.3f}" for column in every)])
    caption = (
        f"{SIDE}² pixels, grey of mean {MEAN:g} and standard deviation {DEVIATION:g} in every texture, "
        f"{len(SEEDS)} seeds; intersection over union with the ground truth."
    )
    return f"{caption}\n\n{table.rows(['', *methods], cells)}"


def scores(seeds: Sequence[int] = SEEDS) -> Iterator[Score]:
    """Every method on every family."""
    for family in FAMILIES:
        scenes = [scene(family, seed) for seed in seeds]
        for method, find in METHODS.items():
            begun = time.perf_counter()
            found = [find(one) for one in scenes]
            spent = (time.perf_counter() - begun) / len(scenes)
            overlaps = [overlap(mask, one.truth) for mask, one in zip(found, scenes, strict=True)]
            yield Score(method, family, sum(overlaps) / len(overlaps), spent)


def overlap(found: Any, truth: Any) -> float:
    """Intersection over union of two masks.

    Examples
    --------
    >>> import numpy as np
    >>> overlap(np.array([True, True, False]), np.array([True, False, False]))
    0.5
    """
    return float((found & truth).sum() / max((found | truth).sum(), 1))


def by_match(refine: str = "pixel") -> Callable[[Scene], Any]:
    """`uavseg match` with a refinement."""

    def find(scene: Scene) -> Any:
        from affine import Affine

        from uavseg.jobs.match.match import match
        from uavseg.jobs.match.request import MatchRequest
        from uavseg.jobs.source.source import Raster
        from uavseg.raster.grid.geobox import GeoBox
        from uavseg.raster.grid.tiling import Window
        from uavseg.raster.read.dataset import Dataset
        from uavseg.regions.outline.rings import rasterise
        from uavseg.regions.sample.place import Disc

        box = GeoBox(scene.image.shape, Affine.identity(), None)
        row, col, radius = scene.sample
        source = Raster(Dataset.of_values(scene.image, box, "scene"))
        found = match(source, MatchRequest(Disc(col, row, radius), refine=refine))
        return rasterise(found.found.rings, Window(0, 0, *box.shape)) > 0

    return find


def by_threshold(scene: Scene) -> Any:
    """Gaussian blur, then a range of two standard deviations around the mean of the sample."""
    from skimage.filters import gaussian

    blurred = gaussian(scene.image, 2)
    own = blurred[disc_of(scene.image.shape, scene.sample)]
    return abs(blurred - own.mean()) <= 2 * own.std()


def by_best_range(scene: Scene) -> Any:
    """Best possible result of a blur and a range, both selected with the ground truth."""
    import numpy as np
    from skimage.filters import gaussian

    best = np.zeros_like(scene.truth)
    for sigma in (1, 2, 4, 8):
        blurred = gaussian(scene.image, sigma)
        steps = np.quantile(blurred, np.linspace(0, 1, 17))
        for k, low in enumerate(steps[:-1]):
            for high in steps[k + 1 :]:
                found = (blurred >= low) & (blurred <= high)
                if overlap(found, scene.truth) > overlap(best, scene.truth):
                    best = found
    return best


def by_cooccurrence(scene: Scene) -> Any:
    """Grey level co-occurrence features of windows of 32 pixels, and a random forest."""
    return _random_forest(cooccurrence(scene.image, 16), scene)


def cooccurrence(image: Any, half: int, step: int = 8) -> Any:
    """Grey level co-occurrence features of windows around each pixel, the same within a step.

    Parameters
    ----------
    image : (M, N) uint8 array
    half : int
        Half of the side of a window.
    step : int

    Returns
    -------
    features : (M', N', 48) array
        M' and N' are M and N, rounded down to whole steps.
    """
    import numpy as np
    from skimage.feature import graycomatrix, graycoprops

    grey = np.pad(image // 16, half, mode="reflect")
    rows, cols = (length // step for length in image.shape)
    names = ("contrast", "dissimilarity", "homogeneity", "energy", "correlation", "ASM")
    features = np.empty((rows, cols, len(names) * 8))
    for row in range(rows):
        for col in range(cols):
            top, left = row * step + step // 2, col * step + step // 2
            counts = graycomatrix(
                grey[top : top + 2 * half, left : left + 2 * half],
                (1, 3),
                np.arange(4) * np.pi / 4,
                levels=16,
                symmetric=True,
                normed=True,
            )
            features[row, col] = np.concatenate([graycoprops(counts, name).ravel() for name in names])
    return features.repeat(step, 0).repeat(step, 1)


def by_features(scene: Scene) -> Any:
    """Multiscale basic features of scikit-image, and a random forest."""
    from skimage.feature import multiscale_basic_features

    return _random_forest(multiscale_basic_features(scene.image, sigma_max=16), scene)


def _random_forest(features: Any, scene: Scene) -> Any:
    """Pixels that a random forest, trained on both discs, assigns to the class of the sample."""
    import numpy as np
    from sklearn.ensemble import RandomForestClassifier

    own, other = (disc_of(scene.truth.shape, disc) for disc in (scene.sample, scene.other))
    forest = RandomForestClassifier(n_estimators=50, max_depth=10, max_samples=0.2, random_state=0)
    forest.fit(
        np.concatenate([features[own], features[other]]),
        np.repeat([True, False], [own.sum(), other.sum()]),
    )
    return forest.predict(features.reshape(-1, features.shape[-1])).reshape(scene.truth.shape)


def disc_of(shape: tuple[int, int], disc: tuple[float, float, float]) -> Any:
    """The pixels of a disc: row, column and radius."""
    import numpy as np

    row, col, radius = disc
    rows, cols = np.ogrid[: shape[0], : shape[1]]
    return (rows + 0.5 - row) ** 2 + (cols + 0.5 - col) ** 2 <= radius**2


METHODS: dict[str, Callable[[Scene], Any]] = {
    "**uavseg match**": by_match(),
    "cells only": by_match("none"),
    "blur, sample's range": by_threshold,
    "blur, best possible range": by_best_range,
    "GLCM, random forest": by_cooccurrence,
    "multiscale features, random forest": by_features,
}


if __name__ == "__main__":
    print(json.dumps([astuple(row) for row in scores()]))
