"""Three discs for and three against, on real pictures with hand-drawn truth, beside a random forest.

    python -m benchmarks.samples FOLDER

FOLDER is that of `benchmarks.likeness`. Discs with a radius of 8 and 16 pixels lie at random places inside
and outside of what is wanted; every method gets the same.
"""

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import table
from benchmarks.match import overlap

RADII = (8, 16)
EACH = 3  # discs for, and against
DRAWS = 3

Place = tuple[float, float, float]  # row, column, radius


@dataclass(frozen=True)
class Samples:
    """A picture, what is wanted in it, and discs within that and outside of it."""

    path: Path
    image: Any
    truth: Any
    like: list[Place]
    unlike: list[Place]


def samples(folder: Path) -> Iterator[Samples]:
    """Draws of discs in every picture of a folder; a picture without room for them is left out."""
    import rasterio

    rng = np.random.default_rng(1)
    for truth_path in sorted(folder.glob("*_truth.tif")):
        path = truth_path.with_name(truth_path.name.replace("_truth", ""))
        with rasterio.open(path) as file, rasterio.open(truth_path) as drawn:
            image, truth = file.read(), drawn.read(1) == 1
        for radius in RADII:
            for _ in range(DRAWS):
                like, unlike = (places(mask, radius, rng, EACH) for mask in (truth, ~truth))
                if len(like) == len(unlike) == EACH:
                    yield Samples(path, image, truth, like, unlike)


def places(mask: Any, radius: int, rng: np.random.Generator, count: int) -> list[Place]:
    """So many discs at random places within a mask, or fewer where there is no room."""
    from scipy.ndimage import distance_transform_edt

    room = np.argwhere(distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1] > radius + 1)
    return [(row + 0.5, col + 0.5, radius) for row, col in rng.permutation(room)[:count]]


def by_match(requested: Samples, bands: tuple[int, ...] = ()) -> Any:
    """`uavseg match` with all discs."""
    return _matched(requested, requested.unlike, bands)


def by_match_without(requested: Samples, bands: tuple[int, ...] = ()) -> Any:
    """`uavseg match` with the discs of what is wanted."""
    return _matched(requested, [], bands)


def _matched(requested: Samples, against: list[Place], bands: tuple[int, ...]) -> Any:
    from uavseg.jobs.match.match import match
    from uavseg.jobs.match.request import MatchRequest
    from uavseg.jobs.source.open_source import open_all_bands
    from uavseg.raster.grid.tiling import Window
    from uavseg.regions.outline.rings import rasterise
    from uavseg.regions.sample.place import Disc

    source = open_all_bands(str(requested.path))
    transform = source.geobox.transform

    def disc(place: Place) -> Disc:
        x, y = transform * (place[1], place[0])
        return Disc(x, y, place[2] * abs(transform.a))

    like, unlike = (tuple(map(disc, within)) for within in (requested.like, against))
    found = match(source, MatchRequest(like, by="color", unlike=unlike, bands=bands)).found
    return rasterise(found.rings, Window(0, 0, *requested.truth.shape)) > 0


def by_forest(requested: Samples) -> Any:
    """scikit-image's example of trainable segmentation: features at several scales, and a random forest."""
    from sklearn.ensemble import RandomForestClassifier

    features = _features(requested.path)
    inside, outside = (_within(discs, requested.truth.shape) for discs in (requested.like, requested.unlike))
    forest = RandomForestClassifier(n_estimators=50, max_depth=10, max_samples=0.05, random_state=0)
    forest.fit(
        np.concatenate([features[inside], features[outside]]),
        np.arange(inside.sum() + outside.sum()) < inside.sum(),
    )
    return forest.predict(features.reshape(-1, features.shape[-1])).reshape(requested.truth.shape)


@lru_cache(1)
def _features(path: Path) -> Any:
    import rasterio
    from skimage.feature import multiscale_basic_features

    with rasterio.open(path) as file:
        planes = np.moveaxis(file.read().astype(float), 0, -1)
    return multiscale_basic_features(planes, sigma_min=1, sigma_max=16, channel_axis=-1)


def _within(discs: list[Place], shape: tuple[int, int]) -> Any:
    rows, cols = np.indices(shape) + 0.5
    return np.any([(rows - row) ** 2 + (cols - col) ** 2 <= radius**2 for row, col, radius in discs], axis=0)


METHODS: dict[str, Callable[[Samples], Any]] = {
    "--like and --unlike": by_match,
    "--like alone": by_match_without,
    "random forest": by_forest,
}


def main() -> None:
    """Print a row for each picture and radius, and the means."""
    found: dict[str, list[list[float]]] = {}
    for requested in samples(Path(sys.argv[1])):
        values = [overlap(find(requested), requested.truth) for find in METHODS.values()]
        for name in (requested.path.stem, f"radius {requested.like[0][2]}", "all"):
            found.setdefault(name, []).append(values)
    print(table.mean_rows(found, ["", "draws", *METHODS]))


if __name__ == "__main__":
    main()
