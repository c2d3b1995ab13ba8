"""The same scene flipped, turned or shifted: the same answer, as `docs/quality.md` promises it."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import shapely
from affine import Affine
from numpy.typing import NDArray

import uavseg
from tests.honest import plain
from tests.honest.findings import unlike
from tests.honest.patterns import any_pattern, drawn, holes
from tests.honest.picture import Picture, as_type, with_holes, write_tiff
from tests.hostile.judging import Finding

Turn = Callable[[NDArray[Any]], NDArray[Any]]
TURNS: dict[str, Turn] = {
    "upside down": lambda a: a[::-1],
    "from right to left": lambda a: a[:, ::-1],
    "half a turn": lambda a: a[::-1, ::-1],
    "transposed": lambda a: a.T,
    "a quarter turn": lambda a: np.rot90(a),
}
MIRRORED = ("upside down", "from right to left", "half a turn")
SQUARES = {"tv": 16, "pixels": 1, "none": 64, "smooth": 64, "scan": 64}  # sides of the squares of a method
SAME = {"tv": MIRRORED, "scan": MIRRORED}  # the turns with the same answer; all for the others
MOVED = 0.1  # share of the pixels that another turn may decide otherwise: most lie on the shore of a texture


def case(rng: Random, folder: Path) -> Iterator[Finding]:
    """Two extractions, of a scene and of the same scene turned or shifted."""
    refine = rng.choice(["none", "tv", "tv", "tv", "pixels", "scan", "smooth"])
    square = SQUARES[refine]
    rows, cols = (square * rng.randint(1, 256 // square) for _ in range(2))
    field, valid = any_pattern(rng, (rows, cols)), np.ones((rows, cols), bool)
    if rng.random() < 0.3:
        field = np.clip(field + drawn(rng).normal(0, 0.04, field.shape), 0, 1)
    if rng.random() < 0.3:
        valid = holes(rng, field.shape)
    picture = with_holes(
        Picture(as_type(field, (0, 65535), "uint16")[np.newaxis], valid, (0, 65535), "nodata", 0)
    )
    ends = round(0.5 * rng.random(), 2), round(0.51 + 0.49 * rng.random(), 2)
    if not picture.valid.any():
        return
    first = answer(folder / "a.tif", picture, ends, refine)
    if rng.random() < 0.7:
        name = rng.choice(sorted(TURNS))
        turn = TURNS[name]
        values = np.stack([turn(band) for band in picture.values])
        moved = replace(picture, values=values, valid=turn(picture.valid))
        second, expected = answer(folder / "b.tif", moved, ends, refine), turn(first)
    else:
        name = f"shifted by squares of {square}"
        down, right = square * rng.randint(0, 2), square * rng.randint(0, 2)
        around = ((0, 0), (down, 0), (right, 0))
        moved = replace(
            picture,
            values=np.pad(picture.values, around),
            valid=np.pad(picture.valid, around[1:]),
            transform=picture.transform * Affine.translation(-right, -down),
        )
        second, expected = answer(folder / "b.tif", moved, ends, refine)[down:, right:], first
    if name.startswith("shifted") or name in SAME.get(refine, TURNS):
        yield from unlike("TURNED", f"{name} {refine}", second, expected)
    else:
        share = np.count_nonzero(second != expected) / second.size
        if share > MOVED:
            yield Finding("TURNED", f"{name} {refine}", f"{share:.2%} of the pixels differ")


def answer(path: Path, picture: Picture, ends: tuple[float, float], refine: str) -> NDArray[np.uint8]:
    """The pixels of a range."""
    write_tiff(path, picture, {})
    found = uavseg.extract(path, range=ends, refine=refine, stretch="dtype", collar="keep", threads=1)
    together = shapely.multipolygons(shapely.get_parts(found.geometry))  # thousands of specks, drawn at once
    return plain.drawn_pixels([together], picture.shape, picture.transform)
