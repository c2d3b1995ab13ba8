"""Ranges that `suggest` proposes without a sample: the first one, and the best of the first three.

    python -m benchmarks.ranges [FOLDER]

Each method proposes ranges in an order, and each is extracted with the defaults. A picture's score is the
intersection over union of its truth with the first range, and with the best of the first three; where every
class of a scene is a truth, their mean. *Best there is* tries all ranges between 24 quantiles.

FOLDER holds pairs `name.tif` and `name_truth.tif` (1 wanted, 0 not); names that differ in their number are
one kind. A list is *bad* where the best of three is below 0.5, and *silent* where no warning says so.
"""

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import rasterio
from affine import Affine
from numpy.typing import NDArray
from scipy import ndimage
from skimage.filters import threshold_li

from benchmarks import classscenes, table
from benchmarks.quality import scenes
from uavseg.jobs.source.source import Raster
from uavseg.jobs.suggest import Suggestions, suggest
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import TilePass, Window
from uavseg.raster.intensity.stretch import parse_stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.blocks.leaves import histogram_of_means
from uavseg.segmentation.in_memory import block_map_of_array, label_regions
from uavseg.segmentation.params.segment import IntensityRange, SegmentParams
from uavseg.segmentation.range_choice import propose_ranges
from uavseg.units import GREY_MAX

SIDE = 512
SEEDS = range(100, 103)
FINE, BAD = 0.8, 0.5  # intersection over union of pictures that need no warning, and that need one
STEPS, LIGHT, NOISE = (0.25, -0.25), 0.12, (0.05, 0.1)
SHARES = ((0.003, 8), (0.01, 6), (0.01, 12), (0.03, 16))  # of the picture, and mean radius in pixels

Ends = tuple[float, float]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Picture:
    """A picture and what is wanted in it: one mask, or one of each class."""

    family: str
    grey: NDArray[np.uint16]
    valid: Mask
    truths: Sequence[Mask]

    @property
    def blocks(self) -> BlockMap:
        """Its block map."""
        return block_map_of_array(self.grey, self.valid)

    def extracted(self, ends: Ends) -> Mask:
        """Pixels of the regions of a range."""
        return np.asarray(label_regions(self.grey, IntensityRange(*ends), self.valid) > 0)

    def overlaps(self, ends: Ends) -> list[float]:
        """Intersection over union of the regions of a range with each truth."""
        found = self.extracted(ends)
        return [float((found & truth).sum() / max((found | truth).sum(), 1)) for truth in self.truths]


def _drawn(family: str, v: NDArray[np.float64], truths: Sequence[Mask]) -> Picture:
    grey = np.floor(np.nan_to_num(np.clip(v, 0, 1)) * 65535 + 0.5).astype(np.uint16)
    return Picture(family, grey, np.isfinite(v), truths)


def small_things(seed: int) -> Iterator[Picture]:
    """Discs brighter or darker than one ground or two, with and without slow light."""
    rng = np.random.default_rng(seed)
    rows, cols = np.indices((SIDE, SIDE))
    for step in STEPS:
        for (share, radius), grounds in ((one, two) for one in SHARES for two in (1, 2)):
            field = ndimage.gaussian_filter(rng.normal(size=(SIDE, SIDE)), 40, mode="wrap")
            v = 0.45 + 0.12 * (grounds == 2) * (field > 0.2 * field.std())
            v = v + rng.choice([0, LIGHT]) * (cols / SIDE - 0.5)
            truth = np.zeros((SIDE, SIDE), bool)
            while truth.mean() < share:
                size = rng.uniform(0.6, 1.4) * radius
                row, col = rng.uniform(size, SIDE - size, 2)
                truth |= (rows - row) ** 2 + (cols - col) ** 2 < size**2
            v = v + step * truth + rng.normal(0, rng.choice(NOISE), v.shape)
            yield _drawn(f"small things, {grounds} ground{'s' * (grounds > 1)}", v, [truth])


def pictures(folder: Path | None) -> Iterator[Picture]:
    """Real pictures if there are any, then all drawn ones."""
    for path in sorted(folder.glob("*_truth.tif")) if folder is not None else ():
        grey = Raster(Dataset.open(path.with_name(path.name.replace("_truth", "")))).grey(TilePass(()))
        tile = grey.read(Window(0, 0, *grey.shape), 0)
        inside = np.s_[: grey.shape[0], : grey.shape[1]]
        with rasterio.open(path) as file:
            truth = file.read(1) == 1
        kind = path.stem.removesuffix("_truth").rstrip("0123456789")
        yield Picture(
            f"real, {kind}", np.ascontiguousarray(tile.grey[inside]), tile.valid[inside] > 0, [truth]
        )
    for seed in SEEDS:
        yield from small_things(seed)
        for make in (*classscenes.FAMILIES.values(), *classscenes.HELD_OUT.values()):
            scene = make(seed)
            truths = [scene.truth == k for k in range(int(scene.truth.max()) + 1)]
            yield _drawn(f"{min(len(truths), 4)} classes{' or more' * (len(truths) > 3)}", scene.v, truths)
        for family in scenes.FAMILIES.values():
            if not family.equal_means:
                drawn = scenes.draw(family, seed, SIDE)
                yield _drawn("things of the quality scenes", drawn.v, [drawn.truth])


def _classes(edges: Sequence[float]) -> list[Ends]:
    return list(pairwise((0.0, *edges, 1.0)))


def by_otsu(picture: Picture, number: int | None = None) -> list[Ends]:
    """Otsu's classes, the darkest first; as many as valleys separate, or two."""
    return _classes(propose_ranges(_histogram(picture), number).edges)


def by_li(picture: Picture) -> list[Ends]:
    """scikit-image's threshold of least cross entropy, the brighter side first."""
    return _classes([float(threshold_li(picture.grey[picture.valid] / 65535))])[::-1]


def suggested(picture: Picture) -> Suggestions:
    """What `suggest` answers."""
    v = np.where(picture.valid, picture.grey / GREY_MAX, np.nan)
    dataset = Dataset.of_values(v, GeoBox(v.shape, Affine.identity(), None), picture.family)
    return suggest(Raster(dataset, parse_stretch("none")))


def by_suggest(picture: Picture) -> list[Ends]:
    """The ranges of `suggest`, in its order."""
    return [one.range for one in suggested(picture).ranges]


def best_there_is(picture: Picture) -> list[Ends]:
    """All ranges between quantiles of the leaf means."""
    shares = np.cumsum(_histogram(picture)) / picture.blocks.counts.sum()
    quantiles = np.concatenate([[0.003, 0.01, 0.02], np.linspace(0.05, 0.95, 18), [0.98, 0.99, 0.997]])
    edges = np.unique(np.round(np.searchsorted(shares, quantiles) / 65535, 4))
    inside = [float(edge) for edge in edges if 0 < edge < 1]
    return list(combinations((0.0, *inside, 1.0), 2))[:-1] if inside else [(0.0, 1.0)]


def _histogram(picture: Picture) -> NDArray[np.int64]:
    return histogram_of_means(picture.blocks, SegmentParams().division)


METHODS: dict[str, Callable[[Picture], list[Ends]]] = {
    "uavseg suggest": by_suggest,
    "Otsu's classes": by_otsu,
    "three of Otsu": lambda picture: by_otsu(picture, 3),
    "threshold_li": by_li,
}


def scores(picture: Picture, ranges: Sequence[Ends]) -> tuple[float, float]:
    """Overlap of the first range with the truth that it fits best, and of the best of three with each."""
    overlaps = np.array([picture.overlaps(ends) for ends in ranges[:3]])
    return float(overlaps[0].max()), float(overlaps.max(axis=0).mean())


def main(folder: Path | None) -> None:
    """Print the tables: the first range, and the best of three."""
    rows: dict[str, list[list[float]]] = {}
    warned: list[tuple[str, bool, float]] = []
    for picture in pictures(folder):
        row: list[float] = []
        for method in METHODS.values():
            row += scores(picture, method(picture))
        if picture.family.startswith("real"):
            listed = (by_suggest(picture), by_otsu(picture, 2), best_there_is(picture))
            row += [max(max(picture.overlaps(ends)) for ends in ranges) for ranges in listed]
        rows.setdefault(picture.family, []).append(row)
        warned.append((picture.family, bool(suggested(picture).warnings), row[1]))
    heads = ["", "pictures", *METHODS]
    lines: list[list[str]] = []
    for family, found in rows.items():
        mean = np.mean(np.array(found), axis=0)
        pairs = [f"{mean[2 * k]:.3f}, {mean[2 * k + 1]:.3f}" for k in range(len(METHODS))]
        lines.append([family, str(len(found)), *pairs])
        if len(mean) > 2 * len(METHODS):
            print(
                "{}: all listed {:.3f}, Otsu's better half {:.3f}, best there is {:.3f}".format(
                    family, *mean[-3:]
                )
            )
    print("The first range, and the best of the first three\n")
    print(table.rows(heads, lines))
    for family in rows:
        own = [one[1:] for one in warned if one[0] == family]
        poor = [not doubtful for doubtful, score in own if score < BAD]
        fine = [doubtful for doubtful, score in own if score >= FINE]
        silent, warned_of = f"{sum(poor)} of {len(poor)}", f"{sum(fine)} of {len(fine)}"
        print(f"{family}: silent where {silent} are bad, warned where {warned_of} are fine")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
