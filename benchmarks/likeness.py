"""Regions like one small disc, on real pictures with hand-drawn truth.

    python -m benchmarks.likeness [FOLDER]

FOLDER holds pairs `name.tif` and `name_truth.tif` (1 wanted, 0 not). Discs with a radius of 8, 16 and 32
pixels lie at random places inside of what is wanted; every method gets the same discs, and nothing else.

Without a folder scenes are drawn in which what is wanted differs from one neighbour by its texture alone and
from the other by its color alone, and scenes whose light more than doubles from one side to the other, with
a disc in the widest place.
"""

import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks import table
from benchmarks.match import overlap
from benchmarks.textures import RADIUS, SIDE, texture

RADII = (8, 16, 32)
PLACES = 3  # discs of each radius in each picture

PAIRS = (("rows", "meadow"), ("forest", "sand"), ("meadow", "rows"), ("glint", "meadow"), ("sand", "meadow"))
DRAWS = 2  # scenes of each pair
LIT = 4  # scenes under slow light
LIGHT = (0.6, 1.5)  # least and most
COLORS = ((0.40, 0.34, 0.36), (0.42, 0.48, 0.42), (0.30, 0.30, 0.36))  # red, green and blue of three kinds
SHIFTS = (0.2, -0.08, -0.12)  # of red, green and blue: another color of the same luminance, nearly


@dataclass(frozen=True)
class Query:
    """A picture, what is wanted in it, and a disc within that: row, column and radius."""

    path: Path
    image: Any
    truth: Any
    disc: tuple[float, float, float]

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


def drawn(folder: Path) -> Iterator[Query]:
    """Scenes of color with texture and scenes of color under slow light, written to a folder."""
    from scipy.ndimage import gaussian_filter

    for seed, (wanted, other) in enumerate(PAIRS * DRAWS):
        rng = np.random.default_rng([seed, 1])
        fields = gaussian_filter(rng.normal(size=(3, SIDE, SIDE)), (0, SIDE / 14, SIDE / 14))
        kind = fields.argmax(0)  # the wanted one, another texture, another color
        grey = np.where(kind == 1, texture(rng, other, SIDE), texture(rng, wanted, SIDE))
        planes = [grey + np.where(kind == 2, shift, 0) + rng.normal(0, 0.02, grey.shape) for shift in SHIFTS]
        yield query(folder / f"{wanted} beside {other} {seed}.tif", np.stack(planes), kind == 0)
    for seed in range(LIT):
        rng = np.random.default_rng([seed, 2])
        fields = gaussian_filter(rng.normal(size=(4, SIDE, SIDE)), (0, SIDE / 14, SIDE / 14))
        kind, slow = fields[:3].argmax(0), gaussian_filter(fields[3], SIDE / 7)
        light = np.interp(slow, [slow.min(), slow.max()], LIGHT)
        planes = [light * np.array(shades)[kind] for shades in COLORS]
        yield query(
            folder / f"slow light {seed}.tif",
            np.stack(planes) + rng.normal(0, 0.02, (3, SIDE, SIDE)),
            kind == 0,
        )


def query(path: Path, planes: Any, truth: Any, radius: int = RADIUS) -> Query:
    """A scene as a file, with a disc of at most a radius in the widest place of what is wanted."""
    import rasterio
    from scipy.ndimage import distance_transform_edt

    image = np.rint(255 * np.clip(planes, 0, 1)).astype(np.uint8)
    room = distance_transform_edt(np.pad(truth, 1))[1:-1, 1:-1]
    row, col = np.unravel_index(int(room.argmax()), room.shape)
    height, width = truth.shape
    profile = {"driver": "GTiff", "count": 3, "height": height, "width": width, "dtype": "uint8"}
    place = {"crs": "EPSG:32633", "transform": rasterio.Affine(1, 0, 0, 0, -1, height)}
    with rasterio.open(path, "w", **profile, **place, photometric="RGB") as file:
        file.write(image)
    return Query(path, image, truth, (row + 0.5, col + 0.5, min(int(room.max()) - 2, radius)))


def by_match(query: Query, by: str = "auto") -> Any:
    """`uavseg match`, or that by color or texture alone; nothing is found where it refuses the disc."""
    from uavseg.errors import SampleError
    from uavseg.jobs.match.match import match
    from uavseg.jobs.match.request import MatchRequest
    from uavseg.jobs.source.open_source import open_raster
    from uavseg.raster.grid.tiling import Window
    from uavseg.regions.outline.rings import rasterise
    from uavseg.regions.sample.place import Disc

    source = open_raster(str(query.path))
    try:
        found = match(source, MatchRequest(Disc(*_on_map(query)), by=by))
    except SampleError:
        return np.zeros_like(query.truth)
    return rasterise(found.found.rings, Window(0, 0, *query.truth.shape)) > 0


def by_range(query: Query) -> Any:
    """The first line that `uavseg suggest --like` proposes: `extract` of a band, an index or a sum."""
    from uavseg import extract, suggest

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        ranges: list[Any] = [*suggest(str(query.path), like=_on_map(query))]
        if not ranges:
            return np.zeros_like(query.truth)
        regions = extract(str(query.path), values=ranges[0].values, **ranges[0].words)
    return _drawn(query, regions)


def by_percentiles(query: Query) -> Any:
    """`extract` of what the middle 98 % of the disc's intensity are."""
    from uavseg import extract

    own = _grey(query.image)[query.inside]
    low, high = np.quantile(own, (0.01, 0.99))
    return _drawn(query, extract(str(query.path), values=(float(low), float(high))))


def _on_map(query: Query) -> tuple[float, float, float]:
    import rasterio

    with rasterio.open(query.path) as file:
        x, y = file.transform * (query.disc[1], query.disc[0])
        return x, y, query.disc[2] * abs(file.transform.a)


def _drawn(query: Query, regions: Any) -> Any:
    import rasterio
    from rasterio.features import rasterize

    if regions.empty:
        return np.zeros_like(query.truth)
    with rasterio.open(query.path) as file:
        return rasterize(((shape, 1) for shape in regions.geometry), file.shape, transform=file.transform) > 0


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
    "suggest --like, extract": by_range,
    "extract, 1 to 99 %": by_percentiles,
    "grey ± 3 deviations": by_deviations,
    "GrabCut": by_grabcut,
}


def _grey(image: Any) -> Any:
    return image[0].astype(float) if len(image) < 3 else np.tensordot([0.2126, 0.7152, 0.0722], image[:3], 1)


def main() -> None:
    """Print a row for each picture and radius, and the means."""
    found: dict[str, list[list[float]]] = {}
    with TemporaryDirectory() as made:
        folder = Path(sys.argv[1]) if len(sys.argv) > 1 else None
        for requested in drawn(Path(made)) if folder is None else queries(folder):
            values = [overlap(find(requested), requested.truth) for find in METHODS.values()]
            stem, radius = requested.path.stem, f"radius {requested.disc[2]}"
            for name in (stem.rstrip(" 0123456789"), "all") if folder is None else (stem, radius, "all"):
                found.setdefault(name, []).append(values)
    print(table.mean_rows(found, ["", "discs", *METHODS]))


if __name__ == "__main__":
    main()
