"""Confidence of regions: weights fitted on drawn scenes, and how well they hold on others.

    python -m benchmarks.confidence [--fit]

A region is right where its intersection over union with one region of the truth exceeds one half. The scenes
are all families of `benchmarks.quality`, each as drawn and resampled (a Gaussian blur of 0.7 pixels, as
orthophotos have), each extracted with a range that begins where it should and with two that do not. With
`--fit` the weights of `uavseg.regions.confidence` are fitted on one half of the seeds and printed; the
tables are of the other half. For `match` by color the same scenes are searched with one disc in an object,
and for `match --classes` divided by one disc in an object and one beside the objects. For `match` by texture
the scenes are those of `benchmarks.textures`.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from affine import Affine
from numpy.typing import NDArray
from scipy import ndimage

from benchmarks import table
from benchmarks.quality.scenes import FAMILIES, Scene, draw
from benchmarks.textures import FAMILIES as FAMILIES_OF_TEXTURE
from benchmarks.textures import scene
from uavseg.jobs.match.by_classes import alike, learn_classes, outlines_by_classes
from uavseg.jobs.match.by_texture import outlines_by_texture, parting_of, search_texture
from uavseg.jobs.match.match import learn, outlines_by_color, similarity_of
from uavseg.jobs.match.request import MatchRequest
from uavseg.jobs.source.source import Raster
from uavseg.jobs.source.work import SERIAL
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window
from uavseg.raster.intensity.stretch import StretchSpec
from uavseg.raster.read.dataset import Dataset
from uavseg.regions import confidence
from uavseg.regions.confidence import Weights
from uavseg.regions.outline.rings import Rasteriser, RegionOutlines, Rings
from uavseg.regions.sample.place import Disc, sample_mask
from uavseg.regions.sample.similarity import BlurredBands
from uavseg.regions.tiles.range_tiles import outline_regions
from uavseg.segmentation.params.segment import IntensityRange, Refinement, SegmentParams
from uavseg.segmentation.pipeline import cells_to_refine, measure_block_map_for

FIT_SEEDS, CHECK_SEEDS = (10, 11, 12), (20, 21, 22)
LOWS = (0.5, 0.55, 0.6)  # of the range; objects have 0.68, the background 0.42
BLUR = 0.7  # pixels, of resampled scenes
LEAST_IOU = 0.5
RADII = (5, 8, 16)  # pixels, of discs
TEXTURE_RADII = (16, 24, 40)
OWN_SHARES, BLOBS = (1, 0.5, 0.25), (12, 24)  # of scenes of texture


@dataclass(frozen=True, eq=False)
class Found:
    """Regions of one family: what their confidence is computed from, and whether they are right."""

    family: str
    terms: NDArray[np.float64]
    right: NDArray[np.bool_]


def regions(
    seeds: Sequence[int], families: Sequence[str] = tuple(FAMILIES), refine: Refinement = "tv"
) -> Iterator[Found]:
    """Regions of all scenes with these seeds."""
    for family in families:
        for seed in seeds:
            scene = draw(FAMILIES[family], seed)
            for v in (scene.v, resampled(scene)):
                for low in LOWS:
                    wanted = IntensityRange(low, 1)
                    outlined = outlines(v, wanted, refine)
                    terms = confidence.region_terms(outlined, low, 1)
                    yield Found(family, terms, best_iou(outlined.rings, scene.truth) > LEAST_IOU)


def matches(seeds: Sequence[int], families: Sequence[str] = tuple(FAMILIES)) -> Iterator[Found]:
    """Regions by color of all scenes with these seeds, each with discs of several radii in the truth."""
    for family in families:
        for seed in seeds:
            scene, rng = draw(FAMILIES[family], seed), np.random.default_rng(seed)
            room = ndimage.distance_transform_edt(np.pad(scene.truth, 1))[1:-1, 1:-1]
            for v in (scene.v, resampled(scene)):
                for radius in RADII:
                    places = np.argwhere(room > radius + 1)
                    if len(places):
                        row, col = places[rng.integers(len(places))] + 0.5
                        terms, rings = matched(raster_of(v), Disc(col, row, radius))
                        yield Found(family, terms, best_iou(rings, scene.truth) > LEAST_IOU)


def matched(source: Raster, disc: Disc) -> tuple[NDArray[np.float64], Rings]:
    """Terms and outlines of `uavseg match --by color`."""
    passes = SERIAL.begun().over(source).stages(4)
    place, bands = sample_mask(disc, source.geobox), [source.grey(passes[0])]
    similarity = learn(bands, (place,), [], passes[1])
    outlined, _ = outlines_by_color(similarity, MatchRequest(disc, by="color"), [place], passes[2:])
    sample, raster = similarity.table.sample_mean, similarity.table.raster_mean
    return confidence.match_terms(outlined, similarity_of(outlined, sample), sample - raster), outlined.rings


def class_maps(seeds: Sequence[int], families: Sequence[str] = tuple(FAMILIES)) -> Iterator[Found]:
    """Regions of maps of all scenes with these seeds: objects and ground, each with one disc."""
    for family in families:
        for seed in seeds:
            scene, rng = draw(FAMILIES[family], seed), np.random.default_rng(seed)
            sides = scene.truth, scene.valid & ~scene.truth
            rooms = [ndimage.distance_transform_edt(np.pad(side, 1))[1:-1, 1:-1] for side in sides]
            for v in (scene.v, resampled(scene)):
                for radius in RADII:
                    places = [np.argwhere(room > radius + 1) for room in rooms]
                    if all(map(len, places)):
                        spots = [of_side[rng.integers(len(of_side))] + 0.5 for of_side in places]
                        terms, rings, kind = mapped(raster_of(v), [Disc(c, r, radius) for r, c in spots])
                        ious = np.stack([best_iou(rings, side) for side in sides])
                        yield Found(family, terms, ious[kind, np.arange(len(kind))] > LEAST_IOU)


def mapped(source: Raster, discs: Sequence[Disc]) -> tuple[NDArray[np.float64], Rings, NDArray[np.int64]]:
    """Terms, outlines and classes of `uavseg match --classes`, with one disc for each class."""
    passes = SERIAL.begun().over(source).stages(4)
    grey = source.grey(passes[0])
    places = {str(k): [sample_mask(disc, source.geobox)] for k, disc in enumerate(discs)}
    likenesses = learn_classes(BlurredBands([grey]), places, passes[1])
    outlined, classes = outlines_by_classes(grey, likenesses, SegmentParams(), passes[2:])
    kind = classes.at(outlined.sums.firsts) - 1
    return confidence.class_terms(outlined, *alike(likenesses, kind)), outlined.rings, kind


def textures(seeds: Sequence[int], families: Sequence[str] = tuple(FAMILIES_OF_TEXTURE)) -> Iterator[Found]:
    """Regions by texture of scenes of `benchmarks.textures`, large and small, clear and faint ones.

    Discs of several radii lie in the objects, or in the ground where that is of one texture.
    """
    for family, seed, own, blobs in product(families, seeds, OWN_SHARES, BLOBS):
        drawn, rng = scene(family, seed, own=own, blobs=blobs), np.random.default_rng(seed)
        for truth in [drawn.truth, ~drawn.truth][: 3 - len(FAMILIES_OF_TEXTURE[family][1])]:
            room = ndimage.distance_transform_edt(np.pad(truth, 1))[1:-1, 1:-1]
            for radius in TEXTURE_RADII:
                places = np.argwhere(room > radius + 1)
                if len(places):
                    row, col = places[rng.integers(len(places))] + 0.5
                    terms, rings = textured(drawn.image, Disc(col, row, radius))
                    yield Found(family, terms, best_iou(rings, truth) > LEAST_IOU)


def textured(image: NDArray[np.uint8], disc: Disc) -> tuple[NDArray[np.float64], Rings]:
    """Terms and outlines of `uavseg match --by texture`."""
    source = Raster(Dataset.of_values(image, GeoBox(image.shape, Affine.identity(), None), "scene"))
    passes = SERIAL.begun().over(source).stages(5)
    grey, place = source.grey(passes[0]), sample_mask(disc, source.geobox)
    search = search_texture(grey, (), place, MatchRequest(disc, by="texture"), passes[1:3])
    outlined, _ = outlines_by_texture(search, passes[3:])
    return confidence.texture_terms(outlined, parting_of(search)), outlined.rings


def resampled(scene: Scene) -> NDArray[np.float64]:
    """A scene after a slight blur, of valid pixels alone."""
    weights = ndimage.gaussian_filter(scene.valid.astype(float), BLUR)
    values = ndimage.gaussian_filter(np.where(scene.valid, scene.v, 0), BLUR)
    return np.where(scene.valid, values / np.maximum(weights, 1e-9), np.nan)


def outlines(v: NDArray[np.float64], wanted: IntensityRange, refine: Refinement) -> RegionOutlines:
    """Outlines of `uavseg extract`, with their sums."""
    source, params = raster_of(v), SegmentParams(refine=refine)
    passes = SERIAL.begun().over(source).stages(3)
    grey = source.grey(passes[0])
    blocks = measure_block_map_for(grey, wanted, params, passes[1])
    return outline_regions(grey, cells_to_refine(blocks, wanted, params), wanted, refine, passes[2])


def raster_of(v: NDArray[np.float64]) -> Raster:
    """A raster in memory, which is not stretched."""
    dataset = Dataset.of_values(v, GeoBox(v.shape, Affine.identity(), None), "scene")
    return Raster(dataset, StretchSpec("none"))


def best_iou(rings: Rings, truth: NDArray[np.bool_]) -> NDArray[np.float64]:
    """The largest intersection over union of each region with one connected region of the truth."""
    count = int(rings.labels.max(initial=0))
    best = np.zeros(count + 1)
    if count:
        true, _ = ndimage.label(truth)
        labels = Rasteriser(rings)(Window(0, 0, *truth.shape))
        both = (labels > 0) & (true > 0)
        pairs, common = np.unique(np.stack([labels[both], true[both]]), axis=1, return_counts=True)
        sizes, true_sizes = np.bincount(labels.ravel()), np.bincount(true.ravel())
        ious = common / (sizes[pairs[0]] + true_sizes[pairs[1]] - common)
        np.maximum.at(best, pairs[0].astype(int), ious)
    return best[1:]


def fitted(found: Sequence[Found]) -> Weights:
    """Weights with the largest likelihood, in thousandths."""
    from sklearn.linear_model import LogisticRegression

    terms = np.concatenate([one.terms for one in found])
    right = np.concatenate([one.right for one in found])
    mean, deviation = terms.mean(0), terms.std(0)
    model = LogisticRegression(C=1e4, max_iter=5000).fit((terms - mean) / deviation, right)
    weights = model.coef_[0] / deviation
    intercept = float(model.intercept_[0] - weights @ mean)
    return Weights(round(intercept, 3), tuple(map(float, weights.round(3))))


def reliability(said: NDArray[np.float64], right: NDArray[np.bool_]) -> str:
    """A row for each tenth of confidence: regions, their mean confidence, and the share that is right."""
    tenth = np.minimum((said * 10).astype(int), 9)
    rows = []
    for k in range(10):
        own = tenth == k
        parts = [f"{said[own].mean():.3f}", f"{right[own].mean():.3f}"] if own.any() else ["", ""]
        rows.append([f"{k / 10:.1f} to {(k + 1) / 10:.1f}", f"{int(own.sum()):,}", *parts])
    return table.rows(["confidence", "regions", "mean", "right"], rows)


def families_table(found: Sequence[Found], weights: Weights) -> str:
    """A row for each family: regions, mean confidence, share that is right, and that among the sure ones."""
    rows = []
    for family in dict.fromkeys(one.family for one in found):
        said = np.concatenate([weights.probability(one.terms) for one in found if one.family == family])
        right = np.concatenate([one.right for one in found if one.family == family])
        sure = said >= 0.8
        of_sure = f"{right[sure].mean():.3f}" if sure.any() else ""
        numbers = [f"{len(said):,}", f"{said.mean():.3f}", f"{right.mean():.3f}"]
        rows.append([family, *numbers, f"{int(sure.sum()):,}", of_sure])
    heads = ["family", "regions", "mean confidence", "right", "at least 0.8", "right of these"]
    return table.rows(heads, rows)


def main() -> None:
    """Print weights if they are to be fitted, and the tables."""
    requested = (
        (regions, confidence.OF_RANGES),
        (matches, confidence.OF_MATCHES),
        (class_maps, confidence.OF_CLASSES),
        (textures, confidence.OF_TEXTURES),
    )
    for draw_regions, weights in requested:
        if "--fit" in sys.argv[1:]:
            weights = fitted(list(draw_regions(FIT_SEEDS)))
            print(f"{draw_regions.__name__}: {weights}\n")
        found = list(draw_regions(CHECK_SEEDS))
        said = weights.probability(np.concatenate([one.terms for one in found]))
        print(reliability(said, np.concatenate([one.right for one in found])), "\n")
        print(families_table(found, weights), "\n")


if __name__ == "__main__":
    main()
