"""Regions like one small disc, on real pictures with hand-drawn truth.

    python -m benchmarks.likeness FOLDER

FOLDER holds pairs `name.tif` and `name_truth.tif` (1 wanted, 0 not). Discs with a radius of 8, 16 and 32
pixels lie at random places inside of what is wanted; every method gets the same discs, and nothing else.
"""

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import table
from benchmarks.match import overlap

RADII = (8, 16, 32)
PLACES = 3  # discs of each radius in each picture


@dataclass(frozen=True)
class Query:
    """A picture, what is wanted in it, and a disc within that: row, column and radius."""

    path: Path
    image: Any
    truth: Any
    disc: tuple[float, float, int]

    @property
    def inside(self) -> Any:
        """The pixels of the disc."""
        row, col = np.indices(self.truth.shape) + 0.5
        return (row - self.disc[0]) ** 2 + (col - self.disc[1]) ** 2 <= self.disc[2] ** 2


def queries(folder: Path) -> Iterator[Query]:
    """Discs in every picture of a folder."""
    import rasterio
    from scipy.ndimage import distance_transform_edt

    rng = np.random.default_rng(0)
    for truth_path in sorted(folder.glob("*_truth.tif")):
        path = truth_path.with_name(truth_path.name.replace("_truth", ""))
        with rasterio.open(path) as file, rasterio.open(truth_path) as drawn:
            image, truth = file.read(), drawn.read(1) == 1
        depths = distance_transform_edt(np.pad(truth, 1))[1:-1, 1:-1]
        for radius in RADII:
            places = np.argwhere(depths > radius + 1)
            for row, col in rng.permutation(places)[:PLACES]:
                yield Query(path, image, truth, (row + 0.5, col + 0.5, radius))


def by_match(query: Query, by: str = "auto") -> Any:
    """`uavseg match`, or that by color or texture alone; nothing is found where it refuses the disc."""
    from uavseg.errors import SampleError
    from uavseg.jobs.like.request import MatchRequest
    from uavseg.jobs.match import match
    from uavseg.jobs.open_source import open_raster
    from uavseg.raster.tiling import Window
    from uavseg.regions.outline.rasterise import rasterise
    from uavseg.regions.sample.place import Disc

    source = open_raster(str(query.path))
    row, col, radius = query.disc
    x, y = source.geobox.transform * (col, row)
    try:
        found = match(source, MatchRequest(Disc(x, y, radius * abs(source.geobox.transform.a)), by=by))
    except SampleError:
        return np.zeros_like(query.truth)
    return rasterise(found.found.rings, Window(0, 0, *query.truth.shape)) > 0


def by_deviations(query: Query) -> Any:
    """Grey within three deviations of the disc's, after a Gaussian blur of two pixels."""
    from skimage.filters import gaussian

    blurred = gaussian(_grey(query.image), 2)
    own = blurred[query.inside]
    return abs(blurred - own.mean()) <= 3 * own.std()


def by_grabcut(query: Query) -> Any:
    """OpenCV's GrabCut, with the disc as certain and the rest as probable background."""
    import cv2

    mask = np.where(query.inside, cv2.GC_FGD, cv2.GC_PR_BGD).astype(np.uint8)
    colors = query.image[:3] if len(query.image) >= 3 else np.repeat(query.image[:1], 3, 0)
    models = np.zeros((1, 65)), np.zeros((1, 65))
    cv2.setRNGSeed(0)
    cv2.grabCut(
        np.ascontiguousarray(colors.transpose(1, 2, 0)), mask, None, *models, 5, cv2.GC_INIT_WITH_MASK
    )
    return (mask == cv2.GC_FGD) | (mask == cv2.GC_PR_FGD)


METHODS: dict[str, Callable[[Query], Any]] = {
    "uavseg match": by_match,
    "--by color": partial(by_match, by="color"),
    "--by texture": partial(by_match, by="texture"),
    "grey ± 3 deviations": by_deviations,
    "GrabCut": by_grabcut,
}


def _grey(image: Any) -> Any:
    return image[0].astype(float) if len(image) < 3 else np.tensordot([0.2126, 0.7152, 0.0722], image[:3], 1)


def main() -> None:
    """Print a row for each picture and radius, and the means."""
    found: dict[str, list[list[float]]] = {}
    for query in queries(Path(sys.argv[1])):
        values = [overlap(find(query), query.truth) for find in METHODS.values()]
        for name in (query.path.stem, f"radius {query.disc[2]}", "all"):
            found.setdefault(name, []).append(values)
    print(table.mean_rows(found, ["", "discs", *METHODS]))


if __name__ == "__main__":
    main()
