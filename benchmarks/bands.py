"""`match` over 4, 16 and 64 bands in drawn scenes, beside classifiers that learn from the same discs.

    python -m benchmarks.bands [SCENES]

SCENES is the number of scenes of each family and number of bands, 3 by default. One disc lies within what is
wanted and three on other ground, or three in each. Classifiers see bands that are blurred by a pixel, as
`match` does; of one disc, `match` gets that alone, and all others get the three on other ground too.
"""

import os
import subprocess
import sys
import warnings
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from benchmarks import table
from benchmarks.discs.methods import by_one_class, or_nothing
from benchmarks.match import disc_of, overlap
from benchmarks.samples import EACH, Samples, by_match, by_match_without, places

SEEDS = 3
SIDE = 256
LARGE = 2048
COUNTS = (4, 16, 64)
KINDS = 6
RADIUS = 8  # pixels
_LATENT = 8  # dimensions in which the means of kinds differ

Stack = NDArray[Any]
Kinds = NDArray[np.int64]


def embedding(rng: np.random.Generator, kind: Kinds, bands: int) -> Stack:
    """Features of unit length: means in a space of few dimensions, noise that bands have in common."""
    latent = min(_LATENT, bands)
    basis = rng.normal(size=(latent, bands))
    means = rng.normal(size=(KINDS, latent)) @ basis / np.sqrt(latent)
    shared = gaussian_filter(rng.normal(size=(latent, *kind.shape)), (0, 1.5, 1.5))
    shared *= 0.5 / shared.std()
    noise = np.tensordot(rng.normal(size=(latent, bands)).T / np.sqrt(latent), shared, 1)
    planes = np.moveaxis(means[kind], -1, 0) + noise + rng.normal(0, 0.5, noise.shape)
    return np.asarray((planes / np.linalg.norm(planes, axis=0)).astype(np.float32))


def quantised(rng: np.random.Generator, kind: Kinds, bands: int) -> Stack:
    """The same as int8."""
    return np.asarray(np.rint(127 * embedding(rng, kind, bands)).astype(np.int8))


def scaled(rng: np.random.Generator, kind: Kinds, bands: int) -> Stack:
    """The same in half of the bands and noise in the others, each band of another unit."""
    planes = embedding(rng, kind, bands)
    planes[1::2] = rng.normal(0, planes.std(), planes[1::2].shape)
    units = 10.0 ** rng.uniform(-2, 3, (bands, 1, 1))
    return np.asarray((planes * units + units * rng.normal(size=units.shape)).astype(np.float32))


def dates(rng: np.random.Generator, kind: Kinds, bands: int) -> Stack:
    """Four bands at several dates, with a season of each kind, and light of each date."""
    times = np.arange(bands // 4) / max(bands // 4, 1)
    base, swing = rng.uniform(0.2, 0.5, (KINDS, 4)), rng.uniform(0.02, 0.12, (KINDS, 4))
    phase = rng.uniform(0, 1, (KINDS, 1, 1))
    means = base[:, None] + swing[:, None] * np.sin(2 * np.pi * (times[:, None] - phase))
    light = gaussian_filter(rng.normal(size=(len(times), *kind.shape)), (0, 20, 20))
    light = 1 + 0.08 * light / light.std()
    planes = np.moveaxis(means.reshape(KINDS, -1)[kind], -1, 0) * np.repeat(light, 4, 0)
    noisy = np.clip(planes + rng.normal(0, 0.05, planes.shape), 0, 1)
    return np.asarray(np.rint(10000 * noisy).astype(np.uint16))


def indices(rng: np.random.Generator, kind: Kinds, bands: int) -> Stack:
    """Normalised differences of pairs of twelve bands of reflectance."""
    means = rng.uniform(0.1, 0.5, (KINDS, 12))
    planes = np.moveaxis(means[kind], -1, 0) * rng.uniform(0.8, 1.2, kind.shape)
    planes = np.clip(planes + rng.normal(0, 0.06, planes.shape), 0.01, 1)
    pairs = [(a, b) for a in range(12) for b in range(a)]
    chosen = [pairs[k] for k in rng.permutation(len(pairs))[:bands]]
    ratios = [(planes[a] - planes[b]) / (planes[a] + planes[b]) for a, b in chosen]
    return np.asarray(np.stack(ratios).astype(np.float32))


FAMILIES: dict[str, Callable[[np.random.Generator, Kinds, int], Stack]] = {
    "embedding, float": embedding,
    "embedding, int8": quantised,
    "units differ, half noise": scaled,
    "dates": dates,
    "indices": indices,
}


def scene(family: str, bands: int, seed: int, each: int, folder: Path, side: int = SIDE) -> Samples:
    """A reproducible scene of a family, written to a folder; `each` discs lie in what is wanted."""
    rng = np.random.default_rng([seed, list(FAMILIES).index(family), bands])
    kind = gaussian_filter(rng.normal(size=(KINDS, side, side)), (0, side / 16, side / 16)).argmax(0)
    planes = FAMILIES[family](rng, kind, bands)
    path = folder / f"{family} {bands} {seed}.tif"
    write(path, planes)
    truth = kind == 0
    like, unlike = places(truth, RADIUS, rng, each), places(~truth, RADIUS, rng, EACH)
    return Samples(path, planes, truth, like, unlike)


def write(path: Path, planes: Stack, interleave: str = "band") -> None:
    """A GeoTIFF of a stack of bands, which are interleaved by band or by pixel."""
    import rasterio

    count, height, width = planes.shape
    size = {"count": count, "height": height, "width": width, "dtype": planes.dtype.name}
    place = {"crs": "EPSG:32633", "transform": rasterio.Affine(1, 0, 0, 0, -1, height)}
    how = {"tiled": True, "interleave": interleave, "photometric": "MINISBLACK"}
    with rasterio.open(path, "w", "GTiff", **size, **place, **how) as file:
        file.write(planes)


def _write_tiled(path: Path, planes: Stack, times: int, interleave: str) -> None:
    write(path, np.tile(planes, (1, times, times)), interleave)


def by_classifier(make: Callable[[], Any], asked: Samples) -> Any:
    """A classifier of scikit-learn on standardised bands."""
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    planes = gaussian_filter(asked.image.astype(float), (0, 1, 1))
    colors = np.moveaxis(planes, 0, -1)
    inside, outside = (
        np.any([disc_of(asked.truth.shape, disc) for disc in discs], axis=0)
        for discs in (asked.like, asked.unlike)
    )
    model = make_pipeline(StandardScaler(), make())
    kinds = np.arange(inside.sum() + outside.sum()) < inside.sum()
    model.fit(np.concatenate([colors[inside], colors[outside]]), kinds)
    return model.predict(colors.reshape(-1, len(planes))).reshape(asked.truth.shape)


def _forest() -> Any:
    from sklearn.ensemble import RandomForestClassifier

    return RandomForestClassifier(100, class_weight="balanced", random_state=0)


def _discriminant() -> Any:
    from sklearn.discriminant_analysis import LinearDiscriminantAnalysis

    return LinearDiscriminantAnalysis(solver="lsqr", shrinkage="auto", priors=[0.5, 0.5])


def _nearest_mean() -> Any:
    from sklearn.neighbors import NearestCentroid

    return NearestCentroid()


def _all_bands(find: Callable[..., Any]) -> Callable[[Samples], Any]:
    return or_nothing(lambda asked: find(asked, tuple(range(1, len(asked.image) + 1))))


METHODS: dict[str, Callable[[Samples], Any]] = {
    "match": _all_bands(by_match_without),
    "match --unlike*": _all_bands(by_match),
    "forest*": partial(by_classifier, _forest),
    "discriminant*": partial(by_classifier, _discriminant),
    "nearest mean*": partial(by_classifier, _nearest_mean),
    "one-class SVM": by_one_class,
}
"""By title; those with a star get the discs on other ground too."""


def report(seeds: int) -> str:
    """The tables of means: of one disc in what is wanted, and of three."""
    parts = []
    for each in (1, EACH):
        found: dict[str, list[list[float]]] = {}
        for family, bands, seed in product(FAMILIES, COUNTS, range(seeds)):
            with TemporaryDirectory() as folder, warnings.catch_warnings(action="ignore"):
                asked = scene(family, bands, seed, each, Path(folder))
                values = [overlap(find(asked), asked.truth) for find in METHODS.values()]
            for row in (f"{family}, {bands}", "all"):
                found.setdefault(row, []).append(values)
        parts.append(f"{each} in what is wanted:\n\n{table.mean_rows(found, ['', 'scenes', *METHODS])}")
    return "\n\n".join(parts)


def costs(side: int) -> str:
    """Seconds of the processor and peak memory of `uavseg match` on rasters of so many pixels squared."""
    cells = []
    for interleave, bands in product(("band", "pixel"), COUNTS):
        with TemporaryDirectory() as folder:
            path = Path(folder) / "stack.tif"
            small = scene("embedding, float", bands, 0, 1, Path(folder))
            row, col, radius = small.like[0]
            with ProcessPoolExecutor(1) as pool:  # of its memory a new process would seem to use as much
                pool.submit(_write_tiled, path, small.image, side // SIDE, interleave).result()
            place = f"{col},{side - row},{radius}"
            numbers = ",".join(str(band + 1) for band in range(bands))
            words = ["match", str(path), "--like", place, "--by", "color", "--bands", numbers]
            command = [sys.executable, "-m", "uavseg", *words, "-q", "-o", f"{folder}/found.gpkg"]
            process = subprocess.Popen(command)
            _, status, used = os.wait4(process.pid, 0)
            assert status == 0
            seconds = used.ru_utime + used.ru_stime
            cells.append([interleave, str(bands), f"{seconds:.1f}", f"{used.ru_maxrss / 1024:.0f}"])
    return table.rows(["interleaved by", "bands", "CPU s", "MB"], cells)


if __name__ == "__main__":
    print(report(int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS))
    print(f"\n`match` on {LARGE}² pixels:\n\n{costs(LARGE)}")
