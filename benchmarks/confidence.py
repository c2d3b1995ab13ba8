"""Confidence of regions: weights fitted on real pictures and drawn scenes, and how well they hold on others.

    python -m benchmarks.confidence [--fit] [FOLDER]

A region is right where its intersection over union with one connected region of the truth exceeds one half.
FOLDER holds real pictures with their truth, pairs `name.tif` and `name_truth.tif`; names that differ by a
number are pictures of one kind. Each is extracted with nine ranges, around the threshold of Otsu, the middle
of the two means of the truth, and the thresholds of three classes. The drawn scenes are all families of
`benchmarks.quality`, each as drawn and resampled (a Gaussian blur of 0.7 pixels, as orthophotos have), each
extracted with a range that begins where it should and with two that do not. For `match` by color pictures and
scenes are searched with discs within the truth, and for `match --classes` divided by one disc within and one
beside. For `match` by texture the scenes are those of `benchmarks.textures`.

The lines of numbers are of folds: all regions of a sixth of the pictures and scenes, or of one kind of
pictures, get their confidence from weights that were fitted without them. Pictures and families have the
same weight each. With `--fit` the weights of `uavseg.regions.confidence` are fitted on all of them and
printed; the tables are of other seeds of the drawn scenes.
"""

import sys
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, product
from pathlib import Path

import numpy as np
from affine import Affine
from numpy.typing import NDArray
from scipy import ndimage

from benchmarks import table
from benchmarks.quality.scenes import FAMILIES, Scene, draw
from benchmarks.textures import FAMILIES as FAMILIES_OF_TEXTURE, scene
from uavseg.jobs.match.by_classes import alike, learn_classes, outlines_by_classes
from uavseg.jobs.match.by_texture import outlines_by_texture, parting_of, search_texture
from uavseg.jobs.match.match import learn, outlines_by_color, similarity_of
from uavseg.jobs.match.ranges_of_sample import color_sources
from uavseg.jobs.match.request import MatchRequest
from uavseg.jobs.source.open_source import open_raster
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
from uavseg.segmentation.source import Statistics, with_statistics
from uavseg.units import GREY_MAX

FIT_SEEDS, CHECK_SEEDS = (10,), (20,)
LOWS = (0.5, 0.55, 0.6)  # of the range; objects have 0.68, the background 0.42
SHIFTS = (-0.06, 0.0, 0.06)  # of the ends of ranges of real pictures
BLUR = 0.7  # pixels, of resampled scenes
LEAST_IOU = 0.5
RADII, CLASS_RADII, TEXTURE_RADII = (8, 16, 32), (8, 16), (16, 32)  # pixels, of discs in real pictures
DRAWN_RADII = (5, 16)
OWN_SHARES, BLOBS = (1, 0.5, 0.25), (12, 24)  # of scenes of texture
FOLDS = 6
INVERSE_PENALTY = 0.03  # of scikit-learn's logistic regression
# The first seven terms of matches, fitted without penalty on drawn scenes of seeds 10 to 12 alone: fitted
# again on real pictures they rank other kinds of pictures worse. Two of the sample and the raster follow.
DRAWN_MATCHES = (1.501, -3.291, -3.4, 0.378, 0.759, 10.398, 10.835)
OF_MATCHES = np.column_stack(
    [[*DRAWN_MATCHES, 0, 0], np.eye(9)[:, 7:]]
)  # combinations of terms that are fitted
OF_CLASSES = np.delete(np.eye(11), (2, 3, 7), axis=1)


@dataclass(frozen=True, eq=False)
class Picture:
    """A raster with its truth; pictures of one kind, or scenes of one family, have one name."""

    name: str
    kind: str
    source: Raster
    truth: NDArray[np.bool_]
    valid: NDArray[np.bool_]
    seed: int
    is_real: bool

    def discs(self, within: NDArray[np.bool_], radii: Sequence[int], rng: np.random.Generator) -> list[Disc]:
        """Return a disc of each radius at a random place within a mask, where there is room."""
        room, transform = (
            ndimage.distance_transform_edt(np.pad(within, 1))[1:-1, 1:-1],
            self.source.geobox.transform,
        )
        found = []
        for radius in radii:
            for row, col in rng.permutation(np.argwhere(room > radius + 1))[:1]:
                x, y = transform * (col + 0.5, row + 0.5)
                found.append(Disc(x, y, radius * abs(transform.a)))
        return found


@dataclass(frozen=True, eq=False)
class Found:
    """Regions of one picture: what their confidence is computed from, and whether they are right."""

    picture: Picture
    terms: NDArray[np.float64]
    right: NDArray[np.bool_]


def drawn(seeds: Sequence[int], families: Sequence[str] = tuple(FAMILIES)) -> Iterator[Picture]:
    """Scenes with these seeds, each as drawn and resampled."""
    for seed, family in product(seeds, families):
        made = draw(FAMILIES[family], seed)
        for v in (made.v, resampled(made)):
            yield Picture(
                name=f"{family}{seed}",
                kind=family,
                source=raster_of(v),
                truth=made.truth,
                valid=made.valid,
                seed=seed,
                is_real=False,
            )


def drawn_textures(
    seeds: Sequence[int], families: Sequence[str] = tuple(FAMILIES_OF_TEXTURE)
) -> Iterator[Picture]:
    """Scenes of texture with these seeds, large and small, clear and faint ones."""
    for family, seed, own, blobs in product(families, seeds, OWN_SHARES, BLOBS):
        made = scene(family, seed, own=own, blobs=blobs)
        yield Picture(
            name=f"{family}{seed}",
            kind=family,
            source=Raster(
                Dataset.of_values(made.image, GeoBox(made.image.shape, Affine.identity(), None), "scene")
            ),
            truth=made.truth,
            valid=np.ones_like(made.truth),
            seed=seed,
            is_real=False,
        )


def real(folder: Path) -> Iterator[Picture]:
    """Pictures of a folder."""
    import rasterio

    for truth_path in sorted(folder.glob("*_truth.tif")):
        name = truth_path.name.removesuffix("_truth.tif")
        source = open_raster(str(folder / f"{name}.tif"))
        with rasterio.open(truth_path) as file:
            truth = file.read(1) == 1
        yield Picture(
            name=name,
            kind=name.rstrip("0123456789"),
            source=source,
            truth=truth,
            valid=read_grey(source)[1],
            seed=zlib.crc32(name.encode()),
            is_real=True,
        )


def read_grey(source: Raster) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """The whole of a raster in v, and where it is valid."""
    grey = source.grey(SERIAL.begun().over(source).stages(2)[0])
    rows, cols = grey.shape
    tile = grey.read(Window(0, 0, rows, cols), 0)
    return tile.grey[:rows, :cols] / GREY_MAX, tile.valid[:rows, :cols] > 0


def regions(picture: Picture, refine: Refinement = "tv") -> Iterator[Found]:
    """Regions of several ranges."""
    for low, high in ranges(picture) if picture.is_real else [(low, 1.0) for low in LOWS]:
        outlined, statistics = outlines(picture.source, IntensityRange(low, high), refine)
        terms = confidence.region_terms(outlined, statistics)
        yield Found(picture, terms, best_iou(outlined.rings, picture.truth) > LEAST_IOU)


def ranges(picture: Picture) -> Iterator[tuple[float, float]]:
    """Ranges that one might try on a real picture."""
    from skimage.filters import threshold_multiotsu, threshold_otsu

    v, valid = read_grey(picture.source)
    inside, outside = v[valid & picture.truth].mean(), v[valid & ~picture.truth].mean()
    for middle, shift in product((threshold_otsu(v[valid]), (inside + outside) / 2), SHIFTS):
        end = round(float(np.clip(middle + shift, 0.02, 0.98)), 3)
        yield (end, 1.0) if inside > outside else (0.0, end)
    first, second = (round(float(end), 3) for end in threshold_multiotsu(v[valid], 3))
    yield from ((first, second), (second, 1.0), (0.0, first))


def matches(picture: Picture) -> Iterator[Found]:
    """Regions by color, of discs of several radii in the truth."""
    rng = np.random.default_rng(picture.seed)
    for disc in picture.discs(picture.truth, RADII if picture.is_real else DRAWN_RADII, rng):
        terms, rings = matched(picture.source, disc)
        yield Found(picture, terms, best_iou(rings, picture.truth) > LEAST_IOU)


def matched(source: Raster, disc: Disc) -> tuple[NDArray[np.float64], Rings]:
    """Terms and outlines of `uavseg match --by color`."""
    passes = SERIAL.begun().over(source).stages(4)
    place, grey = sample_mask(disc, source.geobox), source.grey(passes[0])
    similarity = learn(color_sources(source, grey, (), passes[0].silent), (place,), [], passes[1])
    outlined, _ = outlines_by_color(similarity, MatchRequest(disc, by="color"), [place], passes[2:])
    own, statistics = similarity.table.sample_mean, with_statistics(grey, passes[0]).statistics
    similar, parting = similarity_of(outlined, own), own - similarity.table.raster_mean
    return confidence.match_terms(outlined, similar, own, parting, statistics), outlined.rings


def class_maps(picture: Picture) -> Iterator[Found]:
    """Regions of maps of objects and ground, each with one disc."""
    rng, sides = np.random.default_rng(picture.seed), (picture.truth, picture.valid & ~picture.truth)
    radii = CLASS_RADII if picture.is_real else DRAWN_RADII
    for discs in zip(*(picture.discs(side, radii, rng) for side in sides), strict=False):
        terms, rings, kind = mapped(picture.source, discs)
        ious = np.stack([best_iou(rings, side) for side in sides])
        yield Found(picture, terms, ious[kind, np.arange(len(kind))] > LEAST_IOU)


def mapped(source: Raster, discs: Sequence[Disc]) -> tuple[NDArray[np.float64], Rings, NDArray[np.int64]]:
    """Terms, outlines and classes of `uavseg match --classes`, with one disc for each class."""
    passes = SERIAL.begun().over(source).stages(4)
    grey = with_statistics(source.grey(passes[0]), passes[0])
    places = {str(k): [sample_mask(disc, source.geobox)] for k, disc in enumerate(discs)}
    bands = BlurredBands(color_sources(source, grey, (), passes[0].silent))
    likenesses = learn_classes(bands, places, passes[1])
    outlined, classes = outlines_by_classes(grey, likenesses, SegmentParams(), passes[2:])
    kind = classes.at(outlined.sums.firsts) - 1
    return confidence.class_terms(outlined, *alike(likenesses, kind), grey.statistics), outlined.rings, kind


def textures(picture: Picture) -> Iterator[Found]:
    """Regions by texture, of discs in the objects, and in the ground where that is of one texture."""
    rng = np.random.default_rng(picture.seed)
    several = not picture.is_real and len(FAMILIES_OF_TEXTURE[picture.kind][1]) > 1
    for truth in [picture.truth, ~picture.truth][: 1 if several else 2]:
        for disc in picture.discs(truth, TEXTURE_RADII, rng):
            terms, rings = textured(picture.source, disc)
            yield Found(picture, terms, best_iou(rings, truth) > LEAST_IOU)


def textured(source: Raster, disc: Disc) -> tuple[NDArray[np.float64], Rings]:
    """Terms and outlines of `uavseg match --by texture`."""
    passes = SERIAL.begun().over(source).stages(5)
    grey, place = source.grey(passes[0]), sample_mask(disc, source.geobox)
    search = search_texture(grey, (), place, MatchRequest(disc, by="texture"), passes[1:3])
    outlined, _ = outlines_by_texture(search, passes[3:])
    return confidence.texture_terms(outlined, parting_of(search), search.grey.statistics), outlined.rings


def resampled(scene: Scene) -> NDArray[np.float64]:
    """A scene after a slight blur, of valid pixels alone."""
    weights = ndimage.gaussian_filter(scene.valid.astype(float), BLUR)
    values = ndimage.gaussian_filter(np.where(scene.valid, scene.v, 0), BLUR)
    return np.where(scene.valid, values / np.maximum(weights, 1e-9), np.nan)


def outlines(source: Raster, wanted: IntensityRange, refine: Refinement) -> tuple[RegionOutlines, Statistics]:
    """Outlines of `uavseg extract` with their sums, and the statistics of the raster."""
    params = SegmentParams(refine=refine)
    passes = SERIAL.begun().over(source).stages(3)
    grey = with_statistics(source.grey(passes[0]), passes[0])
    blocks = measure_block_map_for(grey, wanted, params, passes[1])
    return outline_regions(
        grey, cells_to_refine(blocks, wanted, params), wanted, refine, passes[2]
    ), grey.statistics


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


@dataclass(frozen=True, eq=False)
class Table:
    """Regions of all pictures, in rows."""

    terms: NDArray[np.float64]
    right: NDArray[np.bool_]
    pictures: NDArray[np.str_]
    kinds: NDArray[np.str_]
    is_real: NDArray[np.bool_]
    basis: NDArray[np.float64]  # (k, c): combinations of terms that are fitted

    @classmethod
    def of(cls, found: Sequence[Found], basis: NDArray[np.float64]) -> "Table":
        """Stack regions."""
        counts = [len(one.right) for one in found]
        columns = ([getattr(one.picture, name) for one in found] for name in ("name", "kind", "is_real"))
        pictures, kinds, is_real = (np.repeat(np.array(column), counts) for column in columns)
        terms, right = (
            np.concatenate([one.terms for one in found]),
            np.concatenate([one.right for one in found]),
        )
        return cls(terms=terms, right=right, pictures=pictures, kinds=kinds, is_real=is_real, basis=basis)

    def weights(self) -> NDArray[np.float64]:
        """Weights, 1 on average: as much for each real picture, and for each family; half of all for each."""
        weights = np.zeros(len(self.right))
        for side, names in ((self.is_real, self.pictures), (~self.is_real, self.kinds)):
            if side.any():
                _, place, counts = np.unique(names[side], return_inverse=True, return_counts=True)
                weights[side] = 1 / counts[place] / len(counts)
        return np.asarray(weights * len(weights) / weights.sum())

    def folds(self, by_kind: bool) -> NDArray[np.int64]:
        """The fold of each region: of its picture, or of its kind where that is real."""
        groups = np.where(self.is_real, self.kinds, self.pictures) if by_kind else self.pictures
        names, place = np.unique(groups, return_inverse=True)
        kinds = np.unique(self.kinds[self.is_real]).tolist()
        folds = np.empty(len(names), np.int64)
        for k, which in enumerate(np.random.default_rng(0).permutation(len(names))):
            name = str(names[which])
            folds[which] = (
                kinds.index(name) if by_kind and name in kinds else k % (len(kinds) if by_kind else FOLDS)
            )
        return np.asarray(folds[place])

    def held_out(self, by_kind: bool) -> NDArray[np.float64]:
        """The confidence of each region, by weights that were fitted without its fold."""
        folds, weights, said = self.folds(by_kind), self.weights(), np.zeros(len(self.right))
        for fold in np.unique(folds):
            own = folds == fold
            model = fitted(self.terms[~own], self.right[~own], weights[~own], self.basis)
            said[own] = model.probability(self.terms[own])
        return said

    def numbers(self, said: NDArray[np.float64]) -> list[str]:
        """Calibration error and AUC of real pictures of equal weight, of their regions, and of scenes."""
        from sklearn.metrics import roc_auc_score

        rows = []
        for side, weights in (
            (self.is_real, self.weights()),
            (self.is_real, np.ones(len(said))),
            (~self.is_real, self.weights()),
        ):
            if not side.any():
                rows += ["", ""]
                continue
            right, weight, own = self.right[side], weights[side], said[side]
            tenth = np.minimum((own * 10).astype(int), 9)
            error = sum(abs(((own - right) * weight)[tenth == k].sum()) for k in range(10)) / weight.sum()
            rows += [f"{error:.3f}", f"{roc_auc_score(right, own, sample_weight=weight):.3f}"]
        return rows


def fitted(
    terms: NDArray[np.float64],
    right: NDArray[np.bool_],
    weights: NDArray[np.float64],
    basis: NDArray[np.float64],
) -> Weights:
    """Weights of a regularised logistic regression, in thousandths."""
    from sklearn.linear_model import LogisticRegression

    terms = terms @ basis
    mean, deviation = np.average(terms, axis=0, weights=weights), terms.std(0) + 1e-9
    model = LogisticRegression(C=INVERSE_PENALTY, max_iter=5000)
    model.fit((terms - mean) / deviation, right, sample_weight=weights)
    slopes = model.coef_[0] / deviation
    intercept = float(model.intercept_[0] - slopes @ mean)
    return Weights(round(intercept, 3), tuple(map(float, (basis @ slopes).round(3))))


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
    for family in dict.fromkeys(one.picture.kind for one in found):
        said = np.concatenate([weights.probability(one.terms) for one in found if one.picture.kind == family])
        right = np.concatenate([one.right for one in found if one.picture.kind == family])
        sure = said >= 0.8
        of_sure = f"{right[sure].mean():.3f}" if sure.any() else ""
        numbers = [f"{len(said):,}", f"{said.mean():.3f}", f"{right.mean():.3f}"]
        rows.append([family, *numbers, f"{int(sure.sum()):,}", of_sure])
    heads = ["family", "regions", "mean confidence", "right", "at least 0.8", "right of these"]
    return table.rows(heads, rows)


def main() -> None:
    """Print numbers of folds, weights if they are to be fitted, and the tables."""
    folders = [Path(word) for word in sys.argv[1:] if word != "--fit"]
    requested = (
        (regions, drawn, confidence.OF_RANGES, np.eye(6)),
        (matches, drawn, confidence.OF_MATCHES, OF_MATCHES),
        (class_maps, drawn, confidence.OF_CLASSES, OF_CLASSES),
        (textures, drawn_textures, confidence.OF_TEXTURES, np.eye(5)),
    )
    heads = ["folds", "real: ECE", "AUC", "of regions: ECE", "AUC", "drawn: ECE", "AUC"]
    for find, draw_pictures, weights, basis in requested:
        print(find.__name__, "\n")
        if folders or "--fit" in sys.argv[1:]:
            pictures = [*chain(*map(real, folders)), *draw_pictures(FIT_SEEDS)]
            stacked = Table.of([one for picture in pictures for one in find(picture)], basis)
            confidences = {
                "as they are": weights.probability(stacked.terms),
                "of pictures": stacked.held_out(by_kind=False),
            }
            if folders:
                confidences["of kinds"] = stacked.held_out(by_kind=True)
            print(
                table.rows(heads, [[name, *stacked.numbers(said)] for name, said in confidences.items()]),
                "\n",
            )
            if "--fit" in sys.argv[1:]:
                weights = fitted(stacked.terms, stacked.right, stacked.weights(), basis)
                print(f"{weights}\n")
        found = [one for picture in draw_pictures(CHECK_SEEDS) for one in find(picture)]
        said = weights.probability(np.concatenate([one.terms for one in found]))
        print(reliability(said, np.concatenate([one.right for one in found])), "\n")
        print(families_table(found, weights), "\n", flush=True)


if __name__ == "__main__":
    main()
