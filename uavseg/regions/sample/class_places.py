"""Samples of several classes: the polygons of a file with a column `class`."""

import numpy as np

from uavseg.errors import SampleError
from uavseg.raster.grid.geobox import GeoBox
from uavseg.regions.formats.read import read_regions
from uavseg.regions.sample.place import SampleMask, check_placed, polygon_masks

COLUMN = "class"


def class_masks(name: str, geobox: GeoBox) -> dict[str, list[SampleMask]]:
    """Masks of the samples of each class, in the order in which classes first appear.

    Parameters
    ----------
    name : str
        A file of polygons with a column `class`, in any coordinate system.
    geobox : GeoBox
        Of the raster.

    Raises
    ------
    SampleError
        If the raster has no CRS, the file has no such column, a sample has no class or lies outside of the
        raster, or there are fewer than two classes.
    RegionError
        If the file cannot be read as polygons.
    """
    check_placed(geobox, name)
    regions = read_regions(name)
    if COLUMN not in regions.columns:
        raise SampleError(
            f"{name} has no column {COLUMN!r}, which names the class of each sample; it has "
            f"{', '.join(regions.columns)}"
        )
    names = [_name(value) for value in regions.columns[COLUMN]]
    if None in names:
        raise SampleError(f"sample {names.index(None) + 1} of {name} has no class; give it one, or remove it")
    found: dict[str, list[SampleMask]] = {}
    masks = polygon_masks(regions, geobox, f"a sample of {name}")
    for label, mask in zip(names, masks, strict=True):
        found.setdefault(str(label), []).append(mask)
    if len(found) < 2:
        raise SampleError(f"{name} has samples of one class; give some of another one, or use --like {name}")
    return found


def _name(value: object) -> str | None:
    """A class as text; None for what is no name."""
    if value is None or (isinstance(value, float | np.floating) and not np.isfinite(value)):
        return None
    if isinstance(value, float | np.floating) and float(value).is_integer():
        value = int(value)  # a column of whole numbers with a gap is read as floats
    return str(value).strip() or None
