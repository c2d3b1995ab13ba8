"""How well regions like a sample are found where grey tells nothing, beside features and a random forest.

    python -m benchmarks.match

Scenes of two textures or more with equal mean and equal deviation of grey; a disc inside the truth is the
sample. What learns needs a sample of the other side too, and gets one of the same size; `uavseg` gets none.
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
    """How well one method does on one family.

    Parameters
    ----------
    who, family : str
    overlap : float
        Intersection over union with the truth, the mean over the seeds.
    seconds : float
        Of one scene, the mean.
    """

    who: str
    family: str
    overlap: float
    seconds: float


def matches() -> list[Score]:
    """All rows, found in a process of its own so that the caller stays small."""
    command = [sys.executable, "-m", "benchmarks.match"]
    told = subprocess.run(
        command, env=with_project(os.environ), check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    return [Score(*row) for row in json.loads(told)]


def table_of(scores: Sequence[Score]) -> str:
    """A row for each family, a column for each method."""
    who = list(dict.fromkeys(score.who for score in scores))
    by_name = {(score.family, score.who): score for score in scores}
    families = list(dict.fromkeys(score.family for score in scores))
    cells = [[family, *(f"{by_name[family, name].overlap:.3f}" for name in who)] for family in families]
    for title, value in (("mean", "overlap"), ("seconds a scene", "seconds")):
        every = [[getattr(by_name[family, name], value) for family in families] for name in who]
        cells.append([title, *(f"{sum(column) / len(column):.3f}" for column in every)])
    told = (
        f"{SIDE}² pixels, grey of mean {MEAN:g} and deviation {DEVIATION:g} on both sides, {len(SEEDS)} "
        "seeds; intersection over union with the truth."
    )
    return f"{told}\n\n{table.rows(['', *who], cells)}"


def scores(seeds: Sequence[int] = SEEDS) -> Iterator[Score]:
    """Every method on every family."""
    for family in FAMILIES:
        scenes = [scene(family, seed) for seed in seeds]
        for who, find in METHODS.items():
            begun = time.perf_counter()
            found = [find(one) for one in scenes]
            spent = (time.perf_counter() - begun) / len(scenes)
            overlaps = [overlap(mask, one.truth) for mask, one in zip(found, scenes, strict=True)]
            yield Score(who, family, sum(overlaps) / len(overlaps), spent)


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
    """`uavseg match`."""

    def find(scene: Scene) -> Any:
        from affine import Affine

        from uavseg.jobs.match import MatchRequest, match
        from uavseg.jobs.open_source import Raster
        from uavseg.raster.dataset import Dataset
        from uavseg.raster.geobox import GeoBox
        from uavseg.raster.tiling import Window
        from uavseg.regions.outline.rasterise import rasterise
        from uavseg.regions.sample.place import Disc

        box = GeoBox(scene.image.shape, Affine.identity(), None)
        row, col, radius = scene.sample
        source = Raster(Dataset.of_values(scene.image, box, "scene"))
        found = match(source, MatchRequest(Disc(col, row, radius), refine=refine))
        return rasterise(found.found.rings, Window(0, 0, *box.shape)) > 0

    return find


def by_threshold(scene: Scene) -> Any:
    """A blur, and the range of the sample's mean and deviation."""
    from skimage.filters import gaussian

    blurred = gaussian(scene.image, 2)
    own = blurred[_disc(scene.image.shape, scene.sample)]
    return abs(blurred - own.mean()) <= 2 * own.std()


def by_best_range(scene: Scene) -> Any:
    """The best that a blur and a range can do: both are chosen by the truth."""
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
    """Properties of grey level co-occurrence matrices of windows of 32 pixels, and a random forest."""
    import numpy as np
    from skimage.feature import graycomatrix, graycoprops

    half, step = 16, 8
    grey = np.pad(scene.image // 16, half, mode="reflect")
    rows, cols = (length // step for length in scene.image.shape)
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
    return _learnt(features.repeat(step, 0).repeat(step, 1), scene)


def by_features(scene: Scene) -> Any:
    """scikit-image's multiscale basic features, and a random forest."""
    from skimage.feature import multiscale_basic_features

    return _learnt(multiscale_basic_features(scene.image, sigma_max=16), scene)


def _learnt(features: Any, scene: Scene) -> Any:
    """Pixels that a random forest, which has seen both discs, takes for the sample's kind."""
    import numpy as np
    from sklearn.ensemble import RandomForestClassifier

    own, other = (_disc(scene.truth.shape, disc) for disc in (scene.sample, scene.other))
    forest = RandomForestClassifier(n_estimators=50, max_depth=10, max_samples=0.2, random_state=0)
    forest.fit(
        np.concatenate([features[own], features[other]]),
        np.repeat([True, False], [own.sum(), other.sum()]),
    )
    return forest.predict(features.reshape(-1, features.shape[-1])).reshape(scene.truth.shape)


def _disc(shape: tuple[int, int], disc: tuple[int, int, int]) -> Any:
    import numpy as np

    row, col, radius = disc
    rows, cols = np.ogrid[: shape[0], : shape[1]]
    return (rows + 0.5 - row) ** 2 + (cols + 0.5 - col) ** 2 <= radius**2


METHODS: dict[str, Callable[[Scene], Any]] = {
    "**uavseg match**": by_match(),
    "cells only": by_match("none"),
    "blur, sample's range": by_threshold,
    "blur, best range there is": by_best_range,
    "GLCM, forest": by_cooccurrence,
    "multiscale features, forest": by_features,
}


if __name__ == "__main__":
    print(json.dumps([astuple(row) for row in scores()]))
