"""A raster of two halves and its suggested ranges."""

import numpy as np
from affine import Affine

from uavseg.jobs.source.source import Raster
from uavseg.jobs.suggest import Suggestions, suggest
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.intensity.stretch import StretchSpec
from uavseg.raster.read.dataset import Dataset


def raster(image: np.ndarray) -> Dataset:
    return Dataset.of_values(image, GeoBox(image.shape, Affine.identity(), None), "halves.tif")


def halves() -> np.ndarray:
    image = np.full((160, 240), 0.0, np.float32)
    image[:, 120:] = 0.9
    image[:64, :64] = np.nan
    return image


def found_in(image: np.ndarray) -> tuple[Suggestions, Dataset]:
    dataset = raster(image)
    return suggest(Raster(dataset, StretchSpec("none"))), dataset
