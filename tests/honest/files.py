"""Files in any layout: every valid pixel, and no other, where it lies, with its true area and its mean."""

from collections.abc import Iterator
from pathlib import Path
from random import Random

import numpy as np

import uavseg
from tests.honest import plain
from tests.honest.findings import differ, far, unlike
from tests.honest.picture import Picture, any_file, any_picture
from tests.hostile.judging import Finding


def case(rng: Random, folder: Path) -> Iterator[Finding]:
    """A file, asked for all that is valid in it."""
    picture = any_picture(rng)
    path = folder / any_file(rng, folder, picture)
    bands = (1, 2, 3) if len(picture.values) == 3 else (1,)
    about = picture.by
    truth = plain.read(path, bands)
    yield from whole(path, truth, about, picture)


def whole(source: object, truth: plain.Plain, about: str, picture: Picture) -> Iterator[Finding]:
    """What must hold of all valid pixels of a source."""
    low, high = picture.span
    how = {"range": (0, 1), "refine": "none", "stretch": f"{low!r},{high!r}", "collar": "keep", "threads": 1}
    if not truth.valid.any():
        return
    found = uavseg.extract(source, **how)
    pixels = int(np.count_nonzero(truth.valid))
    yield from differ("VALID", about, int(found["pixels"].sum()), pixels)
    covered = plain.drawn_pixels(found.geometry, truth.valid.shape, truth.transform)
    yield from unlike("PLACE", about, covered, truth.valid.astype(np.uint8))
    area = plain.area_m2(truth.valid, truth.transform, truth.crs)
    yield from far("AREA", about, float(found["area_m2"].sum()), area, 2e-6)
    v = plain.v_of(truth.intensity[truth.valid], low, high)
    mean = float(np.average(found["mean"], weights=found["pixels"]))
    yield from far("MEAN", about, mean, float(v.mean()), 0, 1.1 / 65535)
