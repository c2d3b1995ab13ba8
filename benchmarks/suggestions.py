"""How well ranges that are proposed fit scenes whose classes are known: multi-Otsu against valleys.

    python -m benchmarks.suggestions

All look at the same histogram of leaf means, of 256 bins over what is there. Once they are told how many
classes there are, once they find that out themselves. A class is scored by the intersection over union of its
pixels with those of the range that fits it best, at the edges of leaves.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from benchmarks.classscenes import FAMILIES, HELD_OUT, Labels, Scene
from uavseg.raster.intensity.otsu import Classes, multi_otsu, select_classes
from uavseg.segmentation.blocks.leaf_means import histogram_of_means
from uavseg.segmentation.blocks.leaves import cell_intervals
from uavseg.segmentation.in_memory import block_map_of_array
from uavseg.segmentation.params import DivisionParams

SEEDS, BINS, MOST = 5, 256, 6
X, TAU = 1.2, 0.05

Histogram = NDArray[np.float64]
Finder = Callable[[Histogram, int | None], list[float]]


@dataclass(frozen=True, slots=True)
class Score:
    """Of one method on one family of scenes, the mean over its seeds.

    Parameters
    ----------
    family, who : str
    told, found : float
        Overlap with the number of classes told, and with the number that was found.
    right : float
        Share of the scenes of which the number of classes was found.
    """

    family: str
    who: str
    told: float
    found: float
    right: float


def by_otsu(histogram: Histogram, classes: int | None) -> list[float]:
    """Cuts, in bins, as `uavseg suggest` finds them."""
    found = multi_otsu(histogram, classes or MOST)
    chosen = select_classes(histogram, found) if classes is None else found[-1]
    return _middles(chosen)


def by_marriott(histogram: Histogram, classes: int | None) -> list[float]:
    """The same cuts, as many as make k² times the variance within least (Biometrics 27 (1971) 501-514)."""
    found = multi_otsu(histogram, classes or MOST)
    chosen = (
        min(found[1:], key=lambda one: one.count**2 * (1 - one.explained)) if classes is None else found[-1]
    )
    return _middles(chosen)


def by_explained(share: float, histogram: Histogram, classes: int | None) -> list[float]:
    """The same cuts, as many as explain a share of the variance."""
    found = multi_otsu(histogram, classes or MOST)
    enough = [k for k, one in enumerate(found) if k and one.explained >= share] or [len(found) - 1]
    chosen = found[enough[0] if classes is None else -1]
    return _middles(chosen)


def _middles(chosen: Classes) -> list[float]:
    return [(end + start + 1) / 2 for end, start in zip(chosen.ends, chosen.starts, strict=True)]


def by_valleys(sigma: float, depth: float, histogram: Histogram, classes: int | None) -> list[float]:
    """Valleys of the smoothed histogram.

    With the number of classes told: smoothed as little as leaves as many peaks (Silverman, JRSS B 43 (1981)
    97-99). Else smoothed by `sigma` bins, and a valley counts where it is lower than `depth` times the lower
    of the peaks beside it.
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
        if rises[worst] < depth and len(peaks) <= MOST:
            break
        peaks.pop(worst if smooth[peaks[worst]] < smooth[peaks[worst + 1]] else worst + 1)
    return [low + 0.5 for low in _valleys(smooth, peaks)]


def _smoothed(histogram: Histogram, sigma: float) -> Histogram:
    return np.asarray(ndimage.gaussian_filter1d(np.pad(histogram, BINS), sigma, mode="constant"))[BINS:-BINS]


def _peaks(smooth: Histogram) -> list[int]:
    edges = np.pad(smooth, 1, constant_values=-1)
    return np.flatnonzero((edges[1:-1] > edges[:-2]) & (edges[1:-1] >= edges[2:]) & (smooth > 0)).tolist()


def _valleys(smooth: Histogram, peaks: list[int]) -> list[int]:
    """The middle of the lowest bins between peaks."""
    lows = []
    for one, other in pairwise(peaks):
        between = smooth[one : other + 1]
        lows.append(one + int(np.flatnonzero(between <= between.min() * (1 + 1e-9)).mean()))
    return lows


METHODS: dict[str, Finder] = {
    "multi-Otsu, number by valleys (kept)": by_otsu,
    "multi-Otsu, k² within": by_marriott,
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
    """Intersection over union of each class with the range that fits it best, the mean over classes."""
    count, most = int(truth.max()) + 1, int(intervals.max()) + 1
    both = np.bincount((truth * most + intervals).reshape(-1), minlength=count * most).reshape(count, most)
    either = both.sum(axis=1, keepdims=True) + both.sum(axis=0, keepdims=True) - both
    return float((both / np.maximum(either, 1)).max(axis=1).mean())


def scores(families: Mapping[str, Callable[[int], Scene]], seeds: Iterable[int]) -> Iterator[Score]:
    """Every method on every family."""
    for family, make in families.items():
        rows: dict[str, list[tuple[float, float, bool]]] = {who: [] for who in METHODS}
        for seed in seeds:
            scene = make(seed)
            for who, row in _scored(scene):
                rows[who].append(row)
        for who, found in rows.items():
            yield Score(family, who, *np.mean(np.array(found, float), axis=0).tolist())


def _scored(scene: Scene) -> Iterator[tuple[str, tuple[float, float, bool]]]:
    blocks = block_map_of_array(np.floor(scene.v * 65535 + 0.5).astype(np.uint16))
    histogram = histogram_of_means(blocks, DivisionParams(X, TAU))
    held = np.flatnonzero(histogram)
    width = -(-(held[-1] - held[0] + 1) // BINS)
    bins = np.add.reduceat(
        histogram[held[0] : held[-1] + 1], np.arange(0, held[-1] - held[0] + 1, width)
    ).astype(np.float64)
    classes = int(scene.truth.max()) + 1
    for who, find in METHODS.items():
        answers = []
        for wanted in (classes, None):
            edges = [(held[0] + cut * width - 0.5) / 65535 for cut in find(bins, wanted)]
            cells = cell_intervals(blocks, edges, DivisionParams(X, TAU))
            answers.append((overlap(np.kron(cells, np.ones((8, 8), np.uint8)), scene.truth), len(edges) + 1))
        (told, _), (found, count) = answers
        yield who, (told, found, count == classes)


def table(found: list[Score]) -> str:
    """The means over all families, then each family with the two that are best."""
    lines = ["| | number told | number found | number right |", "|---|---:|---:|---:|"]
    for who in METHODS:
        own = [(row.told, row.found, row.right) for row in found if row.who == who]
        told, alone, right = np.mean(own, axis=0)
        lines.append(f"| {who} | {told:.3f} | {alone:.3f} | {right:.0%} |")
    names = list(METHODS)
    best = max(names[5:], key=lambda who: np.mean([row.found for row in found if row.who == who]))
    lines += ["", f"| family | {names[0]} | {best} |", "|---|---|---|"]
    for family in dict.fromkeys(row.family for row in found):
        cells = [
            f"{row.told:.3f} / {row.found:.3f} / {row.right:.0%}"
            for who in (names[0], best)
            for row in found
            if (row.family, row.who) == (family, who)
        ]
        lines.append(f"| {family} | {' | '.join(cells)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    for title, families, first in (("Chosen by", FAMILIES, 0), ("Held out", HELD_OUT, 100)):
        print(f"\n### {title}\n\n{table(list(scores(families, range(first, first + SEEDS))))}")
