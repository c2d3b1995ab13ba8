"""A second disc where `match` proposes one, compared with one at a random place.

    python -m benchmarks.next_sample [FOLDER]
    python -m benchmarks.next_sample --ask [FOLDER]

FOLDER and the first discs are those of `benchmarks.likeness`. The second disc is as large as the proposed
one, and given as --like or --unlike by what most of it is in the truth; of random ones the mean of three is
taken. Those of *one kind* lie within what is wanted or outside of it as a whole, which a user who looks takes
care of; the proposed ones need not.

Without a folder scenes are drawn of seven kinds of ground, of which two with colors near each other are
wanted.

With --ask, the overlap after each of ten truthful answers, beginning with one disc in each scene, or in two
pictures of each kind: about the places of `uavseg match --ask`, about random ones, and that of a random
forest with the same random ones. They are compared by pixels alone, without refinement; where the questions
end, the last overlap stays. A disc is answered by what most of it is in the truth. Then how many answers it
took to 0.80, and to the best that the forest reached (11 where it was not reached), and how many were asked
for.
"""

import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks import table
from benchmarks.likeness import Query, queries
from benchmarks.match import overlap
from benchmarks.samples import Samples, by_forest

RANDOM = 3  # discs at random places, of each sort
SCENES, SIDE, KINDS = 10, 320, 7
RADII = (8, 16)  # of drawn scenes
ANSWERS, ENOUGH = 10, 0.8
SPREAD, NOISE = 0.09, 0.035  # of the colors of kinds, and within a kind

Place = tuple[float, float, float]  # row, column, radius


def drawn(folder: Path) -> Iterator[Query]:
    """Scenes of several kinds of ground, written to a folder, with discs at random places in one of them."""
    import rasterio
    from scipy.ndimage import distance_transform_edt, gaussian_filter

    for seed in range(SCENES):
        rng = np.random.default_rng([seed, 3])
        kind = gaussian_filter(rng.normal(size=(KINDS, SIDE, SIDE)), (0, SIDE / 16, SIDE / 16)).argmax(0)
        colors = rng.uniform(0.3, 0.7, 3) + rng.normal(0, SPREAD, (KINDS, 3))
        near = np.argsort(((colors - colors[0]) ** 2).sum(1))[:2]  # the first kind, and the nearest to it
        planes = (colors[kind] + rng.normal(0, NOISE, (SIDE, SIDE, 3))).transpose(2, 0, 1)
        image = np.rint(255 * np.clip(planes, 0, 1)).astype(np.uint8)
        path = folder / f"drawn {seed}.tif"
        place = {"crs": "EPSG:32633", "transform": rasterio.Affine(1, 0, 0, 0, -1, SIDE)}
        size = {"driver": "GTiff", "count": 3, "height": SIDE, "width": SIDE, "dtype": "uint8"}
        with rasterio.open(path, "w", **size, **place, photometric="RGB") as file:
            file.write(image)
        room = distance_transform_edt(np.pad(kind == 0, 1))[1:-1, 1:-1]
        for radius in RADII:
            places = np.argwhere(room > radius + 1)
            for row, col in rng.permutation(places)[:1]:
                yield Query(path, image, np.isin(kind, near), (row + 0.5, col + 0.5, radius))


def compared(query: Query) -> list[float] | None:
    """Overlap with one disc, with random ones, with random ones of one kind, and with what is proposed.

    None where nothing is proposed.
    """
    found, proposed = matched(query, [])
    if proposed is None:
        return None
    rng = np.random.default_rng([*map(int, query.disc)])
    sorts = [_random_places(query, rng, proposed[2], of_one_kind) for of_one_kind in (False, True)]
    tried = [[_with(query, place) for place in places] for places in sorts]
    means = [float(np.mean(values)) for values in tried]
    return [overlap(found, query.truth), *means, _with(query, proposed)]


def matched(query: Query, more: list[tuple[Place, bool]]) -> tuple[Any, Place | None]:
    """What `uavseg match --by color` finds with further discs, wanted or not, and the disc it proposes."""
    from uavseg.jobs.match.match import match
    from uavseg.jobs.match.request import MatchRequest
    from uavseg.jobs.source.open_source import open_raster
    from uavseg.raster.grid.tiling import Window
    from uavseg.regions.outline.rings import rasterise
    from uavseg.regions.sample.place import Disc

    source = open_raster(str(query.path))
    transform = source.geobox.transform

    def disc(place: Place) -> Disc:
        x, y = transform * (place[1], place[0])
        return Disc(x, y, place[2] * abs(transform.a))

    like = tuple(disc(place) for place, wanted in [(query.disc, True), *more] if wanted)
    unlike = tuple(disc(place) for place, wanted in more if not wanted)
    made = match(source, MatchRequest(like, by="color", unlike=unlike))
    found = rasterise(made.found.rings, Window(0, 0, *query.truth.shape)) > 0
    if made.next_sample is None:
        return found, None
    col, row = ~transform * (made.next_sample.x, made.next_sample.y)
    return found, (row, col, made.next_sample.radius / abs(transform.a))


def _with(query: Query, place: Place) -> float:
    """Overlap with a further disc, which is given as what most of it is."""
    wanted = bool(query.truth[_inside(query, place)].mean() >= 0.5)
    return overlap(matched(query, [(place, wanted)])[0], query.truth)


def _inside(query: Query, place: Place) -> Any:
    row, col = np.indices(query.truth.shape) + 0.5
    return (row - place[0]) ** 2 + (col - place[1]) ** 2 <= place[2] ** 2


def _random_places(query: Query, rng: np.random.Generator, radius: float, of_one_kind: bool) -> list[Place]:
    """Places for a disc of this radius, apart from the first one by as much as a proposed one."""
    from scipy.ndimage import distance_transform_edt

    classes = [query.truth, ~query.truth] if of_one_kind else [np.ones_like(query.truth)]
    rooms = [distance_transform_edt(np.pad(kind, 1))[1:-1, 1:-1] for kind in classes]
    row, col = np.indices(query.truth.shape) + 0.5
    apart = np.hypot(row - query.disc[0], col - query.disc[1]) > query.disc[2] + 3 * radius
    places = np.argwhere((np.max(rooms, 0) > radius + 1) & apart)
    return [(r + 0.5, c + 0.5, radius) for r, c in rng.permutation(places)[:RANDOM]]


Answers = list[tuple[Place, bool]]


def answered(query: Query) -> tuple[dict[str, list[float]], int]:
    """Overlap after each answer, by method, and the number of answers that were asked for."""
    from uavseg.jobs.match.match import with_answers
    from uavseg.jobs.match.request import MatchRequest
    from uavseg.jobs.source.open_source import open_raster
    from uavseg.regions.sample.place import Disc

    source = open_raster(str(query.path))
    transform, asked, random = source.geobox.transform, Answers(), Answers()

    def ask(disc: Disc) -> bool | None:
        if len(asked) == ANSWERS:
            return None
        col, row = ~transform * (disc.x, disc.y)
        place = row, col, disc.radius / abs(transform.a)
        asked.append((place, _wanted(query, place)))
        return asked[-1][1]

    x, y = transform * (query.disc[1], query.disc[0])
    with_answers(source, MatchRequest(Disc(x, y, query.disc[2] * abs(transform.a)), by="color"), ask)
    rng = np.random.default_rng([*map(int, query.disc)])
    rows, cols = query.truth.shape
    while len(random) < ANSWERS:
        radius = float(query.disc[2])
        row, col = rng.uniform(radius, rows - radius), rng.uniform(radius, cols - radius)
        if all(
            np.hypot(row - r, col - c) > 2 * radius + 2 for r, c, _ in [query.disc, *(p for p, _ in random)]
        ):
            random.append(((row, col, radius), _wanted(query, (row, col, radius))))
    ways = {"as asked": (pixels, asked), "at random": (pixels, random), "forest, at random": (forest, random)}
    return {name: _overlaps(query, find, answers) for name, (find, answers) in ways.items()}, len(asked)


def _overlaps(query: Query, find: Callable[[Query, Answers], Any], answers: Answers) -> list[float]:
    values = [overlap(find(query, answers[:count]), query.truth) for count in range(len(answers) + 1)]
    return values + values[-1:] * (ANSWERS + 1 - len(values))


def _wanted(query: Query, place: Place) -> bool:
    return bool(query.truth[_inside(query, place)].mean() >= 0.5)


def pixels(query: Query, answers: Answers) -> Any:
    """Where the likeness of `match` by color is one half or more."""
    from uavseg.jobs.match.match import learn
    from uavseg.jobs.match.ranges_of_sample import color_sources
    from uavseg.jobs.source.open_source import open_raster
    from uavseg.jobs.source.work import SERIAL
    from uavseg.raster.grid.tiling import Window
    from uavseg.regions.sample.place import Disc, sample_mask
    from uavseg.units import GREY_MAX

    raster = open_raster(str(query.path))
    tile_pass, transform = SERIAL.begun().over(raster), raster.geobox.transform
    masks: dict[bool, list[Any]] = {True: [], False: []}
    for place, wanted in [(query.disc, True), *answers]:
        x, y = transform * (place[1], place[0])
        masks[wanted].append(sample_mask(Disc(x, y, place[2] * abs(transform.a)), raster.geobox))
    colors = color_sources(raster, raster.grey(tile_pass), (), tile_pass)
    rows, cols = query.truth.shape
    tile = learn(colors, masks[True], masks[False], tile_pass).read(Window(0, 0, rows, cols), 0)
    return tile.grey[:rows, :cols] >= GREY_MAX / 2


def forest(query: Query, answers: Answers) -> Any:
    """A random forest with the same discs; all is wanted as long as it has none of what is not."""
    unlike = [place for place, wanted in answers if not wanted]
    like = [query.disc, *(place for place, wanted in answers if wanted)]
    if not unlike:
        return np.ones_like(query.truth)
    return by_forest(Samples(query.path, query.image, query.truth, like, unlike))


def print_answers(folder: Path | None, made: Path) -> None:
    """Print the overlap after each answer, and how many answers were needed, with the means at the end."""
    curves: dict[str, list[list[float]]] = {}
    needed: dict[str, list[list[float]]] = {}
    asked_of = list(_smallest(folder, made))
    with ProcessPoolExecutor(2) as pool:
        for query, (found, count) in zip(asked_of, pool.map(answered, asked_of), strict=True):
            best = max(found["forest, at random"])
            for name, values in found.items():
                print(query.path.stem, name, *(f"{value:.3f}" for value in values), flush=True)
                for group in (f"{_kind(query)}, {name}", f"all, {name}"):
                    curves.setdefault(group, []).append(values)
                firsts: list[float] = [_first(values, ENOUGH), _first(values, best)]
                needed.setdefault(name, []).append([*firsts, count if name == "as asked" else ANSWERS])
    print()
    print(table.mean_rows(dict(sorted(curves.items())), ["", "discs", *map(str, range(ANSWERS + 1))]))
    print()
    print(table.mean_rows(needed, ["answers", "discs", "to 0.80", "to the best of the forest", "asked for"]))


def _smallest(folder: Path | None, made: Path) -> Iterator[Query]:
    """The first disc of the smallest radius in each drawn scene, and in two pictures of each kind."""
    seen: dict[str, set[Path]] = {}
    for query in drawn(made) if folder is None else queries(folder):
        paths = seen.setdefault(_kind(query), set())
        if query.disc[2] == RADII[0] and query.path not in paths and (folder is None or len(paths) < 2):
            paths.add(query.path)
            yield query


def _kind(query: Query) -> str:
    return query.path.stem.rstrip(" 0123456789")


def _first(values: Sequence[float], level: float) -> int:
    return next((count for count, value in enumerate(values) if value >= level), ANSWERS + 1)


def main() -> None:
    """Print a row for each picture and radius, and the means."""
    if sys.argv[1:2] == ["--ask"]:
        with TemporaryDirectory() as made:
            print_answers(Path(sys.argv[2]) if len(sys.argv) > 2 else None, Path(made))
        return
    found: dict[str, list[list[float]]] = {}
    silent = 0
    with TemporaryDirectory() as made:
        folder = Path(sys.argv[1]) if len(sys.argv) > 1 else None
        for query in drawn(Path(made)) if folder is None else queries(folder):
            values = compared(query)
            if values is None:
                silent += 1
                continue
            stem, radius = query.path.stem, f"radius {query.disc[2]}"
            for name in (radius, "all") if folder is None else (stem, radius, "all"):
                found.setdefault(name, []).append(values)
    heads = ["", "discs", "one disc", "second at random", "at random, of one kind", "as proposed"]
    print(table.mean_rows(found, heads))
    print(f"\nNothing was proposed for {silent} more discs.")


if __name__ == "__main__":
    main()
