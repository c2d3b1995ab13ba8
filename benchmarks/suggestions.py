"""Histogram thresholding for proposed ranges, on scenes with known classes: multi-Otsu against valleys.

    python -m benchmarks.suggestions

All methods use the same histogram of leaf means, with 256 bins over the occupied part. Each runs once with
the number of classes given and once with the number estimated. The score of a class is the intersection
over union of its pixels with those of the best fitting range, at leaf resolution.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from benchmarks.classscenes import FAMILIES, HELD_OUT, Labels, Scene
from uavseg.raster.intensity.thresholds import Classes, multi_otsu, select_classes
from uavseg.segmentation.blocks.leaves import cell_intervals, histogram_of_means
from uavseg.segmentation.in_memory import block_map_of_array
from uavseg.segmentation.params.segment import DivisionParams

SEEDS, BINS, MAX_CLASSES = 5, 256, 6
X, TAU = 1.2, 0.05

Histogram = NDArray[np.float64]
Finder = Callable[[Histogram, int | None], list[float]]


@dataclass(frozen=True, slots=True)
class Score:
    """Score of one method on one family of scenes, mean over the seeds.

    Parameters
    ----------
    family, method : str
    given, estimated : float
        Overlap with the number of classes given, and with the number estimated.
    correct : float
        Share of scenes with the correct number of classes.
    """

    family: str
    method: str
    given: float
    estimated: float
    correct: float


def by_otsu(histogram: Histogram, classes: int | None) -> list[float]:
    """Thresholds, in bins, as in `uavseg suggest`."""
    estimated = multi_otsu(histogram, classes or MAX_CLASSES)
    chosen = select_classes(histogram, estimated) if classes is None else estimated[-1]
    return _middles(chosen)


def by_marriott(histogram: Histogram, classes: int | None) -> list[float]:
    """Multi-Otsu; the number of classes k minimises k² times the variance within the classes.

    Marriott, Biometrics 27 (1971) 501-514.
    """
    estimated = multi_otsu(histogram, classes or MAX_CLASSES)
    chosen = (
        min(estimated[1:], key=lambda one: one.count**2 * (1 - one.explained))
        if classes is None
        else estimated[-1]
    )
    return _middles(chosen)


def by_explained(share: float, histogram: Histogram, classes: int | None) -> list[float]:
    """Multi-Otsu; the smallest number of classes that explains a share of the variance."""
    estimated = multi_otsu(histogram, classes or MAX_CLASSES)
    enough = [k for k, one in enumerate(estimated) if k and one.explained >= share] or [len(estimated) - 1]
    chosen = estimated[enough[0] if classes is None else -1]
    return _middles(chosen)


def _middles(chosen: Classes) -> list[float]:
    return [(end + start + 1) / 2 for end, start in zip(chosen.ends, chosen.starts, strict=True)]


def by_valleys(sigma: float, depth: float, histogram: Histogram, classes: int | None) -> list[float]:
    """Valleys of the smoothed histogram.

    With the number of classes given, the smallest bandwidth that leaves this number of peaks (Silverman,
    JRSS B 43 (1981) 97-99). Otherwise smoothed by `sigma` bins; a valley counts if it is lower than `depth`
    times the lower of the adjacent peaks.
    """
    if classes is not None:
        smooth = histogram
        for wider in np.geomspace(0.5, BINS, 120):
            smooth = _smoothed(histogram, wider)
            if len(_peaks(smooth)) <= classes:
                break
        return [low + 0.5 for low in _valleys(smooth, _peaks(smooth))]
    smooth = _smoothed(histogram, sigma)
    peaks = _peaks(smooth)
    while len(peaks) > 1:
        lows = _valleys(smooth, peaks)
        rises = [
            smooth[low] / min(smooth[a], smooth[b])
            for low, a, b in zip(lows, peaks[:-1], peaks[1:], strict=True)
        ]
        worst = int(np.argmax(rises))
        if rises[worst] < depth and len(peaks) <= MAX_CLASSES:
            break
        peaks.pop(worst if smooth[peaks[worst]] < smooth[peaks[worst + 1]] else worst + 1)
    return [low + 0.5 for low in _valleys(smooth, peaks)]


def _smoothed(histogram: Histogram, sigma: float) -> Histogram:
    return np.asarray(ndimage.gaussian_filter1d(np.pad(histogram, BINS), sigma, mode="constant"))[BINS:-BINS]


def _peaks(smooth: Histogram) -> list[int]:
    edges = np.pad(smooth, 1, constant_values=-1)
    return np.flatnonzero((edges[1:-1] > edges[:-2]) & (edges[1:-1] >= edges[2:]) & (smooth > 0)).tolist()


def _valleys(smooth: Histogram, peaks: list[int]) -> list[int]:
    """Centre of the lowest bins between adjacent peaks."""
    lows = []
    for one, other in pairwise(peaks):
        between = smooth[one : other + 1]
        lows.append(one + int(np.flatnonzero(between <= between.min() * (1 + 1e-9)).mean()))
    return lows


METHODS: dict[str, Finder] = {
    "multi-Otsu, number by valleys (selected)": by_otsu,
    "multi-Otsu, k² x variance within": by_marriott,
    "multi-Otsu, 85 % explained": partial(by_explained, 0.85),
    "multi-Otsu, 90 % explained": partial(by_explained, 0.9),
    "multi-Otsu, 95 % explained": partial(by_explained, 0.95),
    **{
        f"valleys, sigma {sigma}, depth {depth}": partial(by_valleys, sigma, depth)
        for sigma in (4, 8, 12)
        for depth in (0.33, 0.5, 0.65, 0.8)
    },
}


def overlap(intervals: NDArray[np.uint8], truth: Labels) -> float:
    """Intersection over union of each class with its best fitting range, mean over the classes."""
    count, most = int(truth.max()) + 1, int(intervals.max()) + 1
    both = np.bincount((truth * most + intervals).reshape(-1), minlength=count * most).reshape(count, most)
    either = both.sum(axis=1, keepdims=True) + both.sum(axis=0, keepdims=True) - both
    return float((both / np.maximum(either, 1)).max(axis=1).mean())


def scores(families: Mapping[str, Callable[[int], Scene]], seeds: Iterable[int]) -> Iterator[Score]:
    """Every method on every family."""
    for family, make in families.items():
        rows: dict[str, list[tuple[float, float, bool]]] = {method: [] for method in METHODS}
        for seed in seeds:
            scene = make(seed)
            for method, row in _scored(scene):
                rows[method].append(row)
        for method, scored in rows.items():
            yield Score(family, method, *np.mean(np.array(scored, float), axis=0).tolist())


def _scored(scene: Scene) -> Iterator[tuple[str, tuple[float, float, bool]]]:
    blocks = block_map_of_array(np.floor(scene.v * 65535 + 0.5).astype(np.uint16))
    histogram = histogram_of_means(blocks, DivisionParams(X, TAU))
    occupied = np.flatnonzero(histogram)
    first, last = occupied[0], occupied[-1]
    width = -(-(last - first + 1) // BINS)
    bins = np.add.reduceat(histogram[first : last + 1], np.arange(0, last - first + 1, width)).astype(
        np.float64
    )
    classes = int(scene.truth.max()) + 1
    for method, find in METHODS.items():
        answers = []
        for number in (classes, None):
            edges = [(first + threshold * width - 0.5) / 65535 for threshold in find(bins, number)]
            cells = cell_intervals(blocks, edges, DivisionParams(X, TAU))
            answers.append((overlap(np.kron(cells, np.ones((8, 8), np.uint8)), scene.truth), len(edges) + 1))
        (given, _), (estimated, count) = answers
        yield method, (given, estimated, count == classes)


def table(rows: list[Score]) -> str:
    """Means over all families, then each family with the two best methods."""
    lines = ["| | number given | number estimated | number correct |", "|---|---:|---:|---:|"]
    for method in METHODS:
        own = [(row.given, row.estimated, row.correct) for row in rows if row.method == method]
        given, estimated, correct = np.mean(own, axis=0)
        lines.append(f"| {method} | {given:.3f} | {estimated:.3f} | {correct:.0%} |")
    names = list(METHODS)
    best = max(names[5:], key=lambda method: np.mean([row.estimated for row in rows if row.method == method]))
    lines += ["", f"| family | {names[0]} | {best} |", "|---|---|---|"]
    for family in dict.fromkeys(row.family for row in rows):
        cells = [
            f"{row.given:.3f} / {row.estimated:.3f} / {row.correct:.0%}"
            for method in (names[0], best)
            for row in rows
            if (row.family, row.method) == (family, method)
        ]
        lines.append(f"| {family} | {' | '.join(cells)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    for title, families, first in (("Families used for selection", FAMILIES, 0), ("Held out", HELD_OUT, 100)):
        print(f"\n### {title}\n\n{table(list(scores(families, range(first, first + SEEDS))))}")
