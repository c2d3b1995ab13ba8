"""Draw the sample rasters: four small synthetic aerial images.

    python samples/make_samples.py [FOLDER]

The pixels are identical on every machine (see brushes.py). Takes a few seconds.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from brushes import (
    Array,
    Mask,
    RandomStream,
    Shape,
    chaikin,
    distance,
    domes,
    farmland,
    grid,
    hillshade,
    mix,
    noise,
    photo_footprints,
    shadow,
    smooth,
    soften,
    terraces,
    union_distance,
    wave,
    waves,
)
from numpy.typing import NDArray
from rasterio.transform import from_origin


def main(folder: Path = Path(__file__).parent) -> None:
    """Write all four rasters into a folder."""
    for make in (quarry, shore, fields, thermal):
        make(folder)


# ---- the four images


def quarry(folder: Path) -> None:
    """Bright terraces and pits in a dark forest: 8-bit grey, 0.5 m, UTM 10N."""
    rng, shape = RandomStream(1), (560, 640)
    rugged = 9 * noise(rng, shape, 22) + 3 * noise(rng, shape, 7) + 1.2 * noise(rng, shape, 2)
    loop = [(385, 85), (345, 175), (390, 265), (455, 270), (488, 180), (455, 95), (385, 85)]
    pits = [
        distance(shape, chaikin((95, 330), (90, 430), (150, 520), (260, 545), (335, 490))) - 62,
        distance(shape, loop) - 36,
        distance(shape, [(110, 110), (150, 165)]) - 40,
        distance(shape, [(478, 470), (462, 560)]) - 33,
    ]
    inside = np.maximum(-(union_distance(*pits) + rugged), 0)
    roads = [
        chaikin((560, 372), (500, 385), (430, 350), (372, 385), (335, 440), (320, 480)),
        chaikin((433, 352), (424, 330), (425, 300)),
        chaikin((500, 380), (490, 410), (482, 440)),
        chaikin((425, 90), (310, 55), (220, 95), (150, 140)),
    ]
    road = union_distance(*(distance(shape, line) for line in roads)) + 0.8 * noise(rng, shape, 5)
    cleared, on_road = inside > 0, road < 6.5
    trees = domes(rng, shape, 5200, (5, 11), ~cleared & (road > 10))
    ground = 5 * noise(rng, shape, 60) - 6 * terraces(inside / 14) + 0.35 * noise(rng, shape, 2)
    ground += 0.6 * domes(rng, shape, 400, (4, 9), inside > 45)
    height = ground + np.where(trees > 0, 1.6 * trees + 4, 0)
    light, dark = hillshade(height, 0.5), shadow(height, 16, 1.3)

    forest = 0.14 + 0.24 * light + 0.04 * noise(rng, shape, 26) + 0.03 * noise(rng, shape, 1)
    rock = 0.69 + 0.16 * light + 0.03 * noise(rng, shape, 14) + 0.02 * noise(rng, shape, 1)
    rock += 0.06 * np.minimum(inside / 60, 1)
    gravel = 0.49 + 0.015 * noise(rng, shape, 6) - 0.05 * (np.abs(road) < 1.4)
    view = np.where(cleared, rock, np.where(on_road, gravel, forest))
    view = soften(view - np.where(dark, np.where(cleared, 0.08, 0.10), 0))
    view = np.where(cleared, np.clip(view, 0.5, 0.93), np.clip(view, 0.08, 0.53))
    view += 0.012 * noise(rng, shape, 0)
    write(folder / "quarry.tif", Georeference("EPSG:32610", 512340.0, 5478620.0, 0.5), to_uint8(view)[None])


def shore(folder: Path) -> None:
    """Land, islands and water with glint: 8-bit grey, 1 m, UTM 18N on Lake Ontario."""
    rng, shape = RandomStream(2), (540, 640)
    rows, cols = grid(shape)
    rugged = 16 * noise(rng, shape, 34) + 6 * noise(rng, shape, 11) + 2 * noise(rng, shape, 3)
    coast = np.maximum(rows - (215 + 0.16 * cols), 88 - distance(shape, [(250, 330), (170, 400)]))
    spit = distance(shape, chaikin((300, 470), (345, 500), (362, 560))) - 17
    islands = [((400, 130), (385, 190), 30), ((470, 300), (455, 350), 34), ((330, 240), (335, 250), 15)]
    shapes = [distance(shape, [a, b]) - radius for a, b, radius in islands]
    inland = -(union_distance(coast, spit, *shapes) + rugged)
    land = inland > 0

    tone, furrow = farmland(rng, shape, 78)
    wooded = land & (inland > 10) & (noise(rng, shape, 24) > 0.3)
    trees = domes(rng, shape, 4200, (3, 6.5), wooded)
    road = np.abs(rows - 0.2 * cols - 92 - 10 * noise(rng, shape, 50))
    houses = cottages(rng, shape, 46, land & (road > 9) & (road < 20) & (inland > 14))
    relief = 2.5 * noise(rng, shape, 30) + trees + np.where(trees > 0, 3, 0) + 7 * (houses > 0)
    soil = np.where(inland < 60, 0.72 + 0.03 * noise(rng, shape, 9), 0.68 + tone + 0.03 * furrow)
    soil = np.where(trees > 0, 0.6, np.where(road < 3, 0.88, np.clip(soil, 0.6, 0.9)))
    soil += 0.2 * (hillshade(relief, 0.6) - 0.5) - 0.17 * shadow(relief, 9, 1.0)
    soil = np.where(houses > 0, houses, soil) + 0.03 * noise(rng, shape, 1)
    beach = 1 - inland / np.maximum(8 + 3 * noise(rng, shape, 20), 3)
    soil += (0.94 - soil) * smooth(np.clip(beach, 0, 1))

    shallow = np.clip(1 + inland / 45, 0, 1)
    swell = waves(rng, shape)
    water = 0.12 + 0.14 * shallow * shallow + 0.02 * swell + 0.015 * noise(rng, shape, 20)
    path = np.clip(1 - np.abs(cols - 455 + 0.5 * (rows - 420)) / 170, 0, 1) * (1 - shallow)
    spark = swell + noise(rng, shape, 0) + 2.4 * path - 4.1
    foam = np.abs(inland + 2.5) < 1 + np.clip(noise(rng, shape, 6), -2, 1)
    water += np.clip(0.5 * spark, 0, 0.8) + 0.16 * foam
    view = soften(np.where(land, soil, np.clip(water, 0.03, 1))) + 0.02 * noise(rng, shape, 0)
    write(folder / "shore.tif", Georeference("EPSG:32618", 379850.0, 4897340.0, 1.0), to_uint8(view)[None])


def fields(folder: Path) -> None:
    """Fields with crop rows and a track, in the outline of a drone mosaic: RGB and alpha, 0.1 m, UTM 50S."""
    rng, shape = RandomStream(3), (440, 520)
    rows, cols = grid(shape)
    track = distance(shape, chaikin((0, 215), (150, 232), (290, 262), (440, 270)))
    left, upper = cols < 215 + 0.14 * rows, rows - 190 - 0.1 * cols
    lower_right = rows - 250 + 0.12 * cols
    plots = [  # mask, colours of crop and soil, direction of the rows, spacing in pixels, crop cover
        (left & (upper < 0), (70, 116, 42), (140, 108, 78), (0.28, 0.96), 9.0, 0.64),
        (left & (upper >= 0), (198, 172, 98), (158, 126, 84), (0.96, 0.28), 6.5, 0.66),
        (~left & (lower_right < 0), (152, 114, 82), (112, 80, 56), (0.8, 0.6), 11.0, 0.48),
        (~left & (lower_right >= 0), (104, 142, 52), (134, 106, 74), (0.96, -0.28), 10.0, 0.8),
    ]
    vigour, plants = noise(rng, shape, 26), noise(rng, shape, 1)
    image = np.zeros((3, *shape))
    for where, crop, soil, (down, right), spacing, closed in plots:
        across = (rows * down + cols * right + 0.8 * noise(rng, shape, 25)) / spacing
        cover = np.clip((wave(across) - 1 + closed) * 2.2 + 0.3 * plants + 0.14 * vigour, 0, 1)
        wheel = np.abs(across - 12 * np.floor(across / 12) - 6) < 0.5
        cover = np.where(wheel, 0.12 * cover, cover)
        image = np.where(where, mix(soil, crop, cover) * (1 + 0.03 * plants + 0.05 * vigour), image)
    grass = np.clip(0.5 + 0.5 * noise(rng, shape, 3), 0, 1)
    headland = np.abs(np.where(left, upper, lower_right)) < 6 + noise(rng, shape, 6)
    image = np.where(headland, mix((140, 122, 78), (92, 120, 56), grass), image)
    wander = track + 1.2 * noise(rng, shape, 8)
    image = np.where(wander < 21, mix((132, 120, 76), (96, 120, 58), grass), image)
    image = np.where(wander < 13, mix((180, 154, 116), (138, 132, 82), grass * (track < 4)), image)
    rut = np.abs(track - 8 + 0.5 * noise(rng, shape, 12)) < 3
    image = np.where(rut, mix((210, 188, 150), (190, 164, 126), grass), image)

    trees = domes(rng, shape, 420, (11, 21), (track > 26) & (track < 44) & (rows < 345) & ~left)
    leaves = np.where(trees > 0, trees + 10 + 1.5 * noise(rng, shape, 2), 0)
    image = np.where(shadow(leaves, 26, 1.0), image * 0.55, image)
    image = np.where(trees > 0, mix((30, 52, 24), (100, 128, 62), hillshade(leaves, 0.35)), image)
    covered = photo_footprints(rng, shape, (56, 66), (44, 56))
    image = np.where(covered, np.clip(image + 1.5 * noise(rng, shape, 0), 1, 254), 0)
    values = np.concatenate([image, np.where(covered, 255, 0)[None]]).astype(np.uint8)
    write(folder / "fields_rgb.tif", Georeference("EPSG:32750", 548210.0, 6471905.0, 0.1), values)


def thermal(folder: Path) -> None:
    """Cattle and a farm on a cold night: 16-bit in units of 0.01 K, nodata 0, 0.15 m, UTM 32N."""
    rng, shape = RandomStream(4), (420, 512)
    rows, cols = grid(shape)
    kelvin = 28380 + 60 * noise(rng, shape, 50) + 30 * noise(rng, shape, 10) + 14 * noise(rng, shape, 2)
    ditch = distance(shape, chaikin((420, 110), (300, 190), (210, 205), (60, 330), (0, 350)))
    kelvin -= 150 * smooth(np.clip(1 - ditch / 9, 0, 1))
    lane = distance(shape, chaikin((118, 512), (120, 400), (112, 250), (150, 120), (130, 0)))
    kelvin = np.where(lane + noise(rng, shape, 8) < 10, 28640 + 16 * noise(rng, shape, 9), kelvin)
    trees = domes(rng, shape, 500, (7, 15), (rows < 100) & (rows + 0.3 * cols < 110))
    kelvin = np.where(trees > 0, 28520 + 12 * trees + 25 * noise(rng, shape, 2), kelvin)
    kelvin = barns(kelvin, rng)
    for row, col, down, right in cattle(rng):
        body = distance(shape, [(row - 6 * down, col - 6 * right), (row + 5 * down, col + 5 * right)]) - 4
        head = distance(shape, [(row + 11 * down, col + 11 * right)]) - 2
        warm = smooth(np.clip(0.6 - np.minimum(body, head) / 4, 0, 1))
        kelvin += 2150 * warm * (1 + 0.08 * noise(rng, shape, 2))
    for row, col, hot in ((272, 352, 1500), (283, 366, 1100), (301, 88, 900)):
        kelvin += hot * smooth(np.clip(1 - distance(shape, [(row, col)]) / 6, 0, 1))
    kelvin = soften(kelvin) + 6 * noise(rng, shape, 0)
    covered = photo_footprints(rng, shape, (70, 84), (42, 54))
    values = np.where(covered, np.clip(kelvin, 28000, 31500), 0).astype(np.uint16)
    write(
        folder / "thermal.tif", Georeference("EPSG:25832", 545004.0, 5905410.0, 0.15), values[None], nodata=0
    )


def cattle(rng: RandomStream) -> Iterator[tuple[float, float, float, float]]:
    """Position of each animal, and its heading as a unit vector."""
    for row, col in (
        (228, 120),
        (258, 152),
        (240, 176),
        (286, 122),
        (340, 330),
        (322, 366),
        (352, 392),
        (336, 240),
    ):
        down, right = rng.uniform(2) - 0.5
        length = np.sqrt(down * down + right * right)
        yield row + 12 * down, col + 12 * right, float(down / length), float(right / length)


def barns(kelvin: Array, rng: RandomStream) -> Array:
    """Add a warm stable with roof lights and a cold shed."""
    rows, cols = grid(kelvin.shape)
    along = (cols - 390) * 0.96 - (rows - 255) * 0.28
    across = (cols - 390) * 0.28 + (rows - 255) * 0.96
    roof = 28980 + 26 * noise(rng, kelvin.shape, 6) + np.where(across < 0, 130, 0)
    roof += 420 * ((np.abs(across) < 2.5) | (wave(along / 26) > 0.86) & (np.abs(across + 14) < 6))
    stable = (np.abs(along) < 82) & (np.abs(across) < 27)
    shed = (np.abs(along - 40) < 30) & (np.abs(across + 66) < 18)
    tin = 28090 + 15 * noise(rng, kelvin.shape, 6) + 40 * (across < -66)
    return np.where(stable, roof, np.where(shed, tin, kelvin))


def cottages(rng: RandomStream, shape: Shape, count: int, where: Mask) -> Array:
    """Brightness of bright roofs; 0 between them."""
    roofs = np.zeros(shape)
    for row, col, size, tone in zip(*rng.uniform(4, count * 8), strict=True):
        top, start = int(row * (shape[0] - 12)), int(col * (shape[1] - 14))
        if where[top, start]:
            roofs[top : top + 5 + int(3 * size), start : start + 8 + int(5 * size)] = 0.8 + 0.2 * tone
    return roofs


# ---- files


@dataclass(frozen=True)
class Georeference:
    """Georeference of a raster: the outer corner of its first pixel, and metres per pixel."""

    crs: str
    x: float
    y: float
    metres: float


def to_uint8(view: Array) -> NDArray[np.uint8]:
    """Scale 0..1 to 8 bits."""
    return np.floor(255 * np.clip(view, 0, 1) + 0.5).astype(np.uint8)


def write(path: Path, place: Georeference, values: NDArray[Any], nodata: float | None = None) -> None:
    """Write a tiled, compressed GeoTIFF from an array of shape (bands, rows, cols)."""
    profile = {
        "driver": "GTiff", "dtype": values.dtype, "count": values.shape[0],
        "height": values.shape[1], "width": values.shape[2], "nodata": nodata,
        "crs": place.crs, "transform": from_origin(place.x, place.y, place.metres, place.metres),
        "tiled": True, "blockxsize": 256, "blockysize": 256, "interleave": "band",
        "compress": "deflate", "predictor": 2, "zlevel": 9,
    }  # fmt: skip
    if values.shape[0] == 4:
        profile |= {"photometric": "RGB", "alpha": "non-premultiplied"}
    with rasterio.open(path, "w", **profile) as file:
        file.write(values)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
