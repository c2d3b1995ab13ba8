"""Classes and levels: each valid pixel is in one segment at most, of levels in exactly one."""

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import shapely

import uavseg
from tests.honest import plain
from tests.honest.findings import far, unlike
from tests.honest.picture import any_file, any_picture, any_shape
from tests.hostile.judging import Finding


def case(rng: Random, folder: Path) -> Iterator[Finding]:
    """A raster in levels or classes."""
    picture = any_picture(rng, any_shape(rng, 300))
    path = folder / any_file(rng, folder, picture)
    truth = plain.read(path, (1, 2, 3) if len(picture.values) == 3 else (1,))
    if not truth.valid.any():
        return
    how: dict[str, Any] = {
        "stretch": f"{picture.span[0]!r},{picture.span[1]!r}",
        "collar": "keep",
        "threads": 1,
    }
    how["refine"] = rng.choice(["tv", "none"])
    place = truth.valid.shape, truth.transform
    if rng.random() < 0.6:
        if rng.random() < 0.4:
            how |= {"min_area": f"{rng.choice([4, 20, 100])}px", "small": "merge"}
        found = uavseg.levels(path, width=rng.choice([0.05, 0.1, 0.2, 0.34, 0.5, 1.0]), **how)
        about = f"levels {how['refine']} {'merged' if 'min_area' in how else ''}"
        yield from unlike(
            "COVER", about, plain.drawn_pixels(found.geometry, *place), truth.valid.astype(np.uint8)
        )
        area = plain.area_m2(truth.valid, truth.transform, truth.crs)
        yield from far("AREA", about, float(found["area_m2"].sum()), area, 2e-6)
        v = plain.v_of(truth.intensity[truth.valid], *picture.span)
        mean = float(np.average(found["mean"], weights=found["pixels"]))
        yield from far("MEAN", about, mean, float(v.mean()), 0, 1.1 / 65535)
        if how["refine"] == "none" and "min_area" not in how:
            low, high = found["range_low"] - 2e-5, found["range_high"] + 2e-5
            if not ((found["mean"] >= low) & (found["mean"] <= high)).all():
                yield Finding("LEVEL", about, str(found[["mean", "range_low", "range_high"]].head()))
    else:
        ends = sorted({0.0, *(round(rng.random(), 2) for _ in range(3)), 1.0})
        classes = {f"c{n}": pair for n, pair in enumerate(pairwise(ends))}
        if rng.random() < 0.5:
            classes.pop(rng.choice(sorted(classes)))
        found = uavseg.extract(path, classes=classes, **how)
        about = f"classes {how['refine']}"
        covered = plain.drawn_pixels(found.geometry, *place)
        if len(classes) == len(ends) - 1:
            yield from unlike("COVER", about, covered, truth.valid.astype(np.uint8))
        yield from unlike("OVERLAP", about, covered > truth.valid, np.zeros(covered.shape, bool))
    if not shapely.is_valid(found.geometry.values).all():
        yield Finding("GEOMETRY", about, str(shapely.is_valid_reason(found.geometry.values)[:5]))
    pixels = [int(plain.drawn_pixels([one], *place).sum()) for one in found.geometry[:20]]
    if pixels != found["pixels"].tolist()[:20]:
        yield Finding("PIXELS", about, f"{found['pixels'].tolist()[:20]}, not {pixels}")
