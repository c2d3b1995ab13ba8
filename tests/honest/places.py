"""Places: reference systems and transforms that honest rasters have."""

import math
from random import Random

from affine import Affine

# A reference system, the centre of the raster in it, and sizes of pixels in its units.
METRES = (0.003, 0.05, 0.5, 1.0, 10.0, 30.0)
DEGREES = (1e-7, 1e-6, 1e-5, 1e-4, 1e-3)
PLACES = {
    "utm": ("EPSG:32633", (500000.0, 4500000.0), METRES),
    "utm south": ("EPSG:32733", (312345.6, 6234567.8), METRES),
    "degrees": ("EPSG:4326", (15.0, 40.6), DEGREES),
    "degrees in the west": ("EPSG:4326", (-122.8, -33.4), DEGREES),
    "mercator": ("EPSG:3857", (1670000.0, 4950000.0), METRES),
    "feet": ("EPSG:2264", (1500000.0, 600000.0), (0.1, 1.0, 30.0)),
    "northing first": ("EPSG:31467", (3500000.0, 5500000.0), METRES),
    "equal area": ("EPSG:3035", (4321000.0, 3210000.0), METRES),
    "another datum": ("EPSG:27700", (400000.0, 300000.0), METRES),
    "polar": ("EPSG:3413", (12000.0, -7000.0), METRES),
    "polar south": ("EPSG:3031", (-1200000.0, 300000.0), METRES),
    "antimeridian in metres": ("EPSG:3832", (3339584.7 + 20.0, -1900000.0), METRES),
    "antimeridian in utm": ("EPSG:32760", (816000.0, 8000000.0), METRES),
    "antimeridian in degrees": ("EPSG:4326", (180.0, -17.0), DEGREES),
    "local": (None, (0.0, 0.0), METRES),
}
TURNS = ("north up",) * 8 + (
    "south up",
    "mirrored",
    "not square",
    "anisotropic",
    "turned",
    "turned",
    "sheared",
)


def any_place(rng: Random, shape: tuple[int, int]) -> tuple[str | None, Affine, str]:
    """A reference system, a transform around a place in it, and what they are called."""
    name, turn = rng.choice(sorted(PLACES)), rng.choice(TURNS)
    crs, (x, y), sizes = PLACES[name]
    return crs, transform_at(rng, turn, rng.choice(sizes), (x, y), shape), f"{name}, {turn}"


def transform_at(
    rng: Random, turn: str, pixel: float, centre: tuple[float, float], shape: tuple[int, int]
) -> Affine:
    """A transform whose raster has a centre."""
    across, down = pixel, -pixel
    if turn == "not square":
        down *= rng.choice([0.5, 1.5, 2.0])
    elif turn == "anisotropic":
        down *= 10
    elif turn == "south up":
        down = -down
    elif turn == "mirrored":
        across = -across
    plain = Affine.scale(across, down)
    if turn == "turned":
        plain = Affine.rotation(rng.choice([-120, -30, 1, 45, 90, 180])) * plain
    elif turn == "sheared":
        plain = Affine.shear(10, 0) * plain
    x, y = plain * (shape[1] / 2, shape[0] / 2)
    return Affine.translation(centre[0] - x, centre[1] - y) * plain


def is_upright(transform: Affine) -> bool:
    """Whether rows go along x and columns along y."""
    return math.isclose(transform.b, 0, abs_tol=1e-15) and math.isclose(transform.d, 0, abs_tol=1e-15)
