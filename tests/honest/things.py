"""Small things: what stands out by six deviations of the noise is found, whatever its arrangement."""

from collections.abc import Iterator
from pathlib import Path
from random import Random

import numpy as np
from numpy.typing import NDArray

import uavseg
from tests.honest import plain
from tests.honest.patterns import drawn
from tests.honest.picture import Picture, as_type, write_tiff
from tests.hostile.judging import Finding


def case(rng: Random, folder: Path) -> Iterator[Finding]:
    """Rows, grids, checkers or lone squares of 3 to 20 pixels in noise."""
    shape = rng.choice([128, 200, 256]), rng.choice([128, 200, 256])
    width = rng.choice([3, 4, 5, 6, 8, 12, 20])
    name = rng.choice(["rows", "grid", "checkers", "alone"])
    truth = arranged(rng, name, shape, width)
    sigma = rng.choice([0.005, 0.02, 0.05])
    contrast = max(6 * sigma, rng.choice([0.1, 0.3, 0.6]))
    dark = round(rng.uniform(0.1, 0.9 - contrast), 3) if contrast < 0.8 else 0.1
    field = np.where(truth, dark + contrast, dark) + drawn(rng).normal(0, sigma, shape)
    picture = Picture(
        as_type(np.clip(field, 0, 1), (0, 65535), "uint16")[np.newaxis], truth | True, (0, 65535)
    )
    write_tiff(folder / "x.tif", picture, {})
    found = uavseg.extract(
        folder / "x.tif", range=(dark + contrast / 2, 1), stretch="dtype", collar="keep", threads=1
    )
    got = plain.drawn_pixels(found.geometry, shape, picture.transform) > 0
    if truth.any():
        overlap = np.count_nonzero(got & truth) / np.count_nonzero(got | truth)
        least = 0.8 if width <= 5 else 0.9
        if overlap < least:
            about = f"{name} of {width}"
            yield Finding("MISSED", about, f"IoU {overlap:.3f}, noise {sigma}, contrast {contrast:.2f}")


def arranged(rng: Random, name: str, shape: tuple[int, int], width: int) -> NDArray[np.bool_]:
    """Where the things are."""
    row, col = np.indices(shape)
    if name == "rows":
        angle = rng.choice([0, 0.3, np.pi / 4, 1.2, np.pi / 2])
        across = np.round(row * np.cos(angle) + col * np.sin(angle), 6)
        return np.asarray(across % max(2 * width, 5) < width)
    if name == "checkers":
        return np.asarray((row // width + col // width) % 2 == 0)
    step = 2 * width if name == "grid" else 64
    top = rng.randint(4, 40)
    return np.asarray(((row + top) % step < width) & ((col + top) % step < width) & (row > 0) & (col > 0))
