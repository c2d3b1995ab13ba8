"""Select regions by id, by a condition on their attributes, and by size."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import RegionError
from uavseg.regions.select.where import where
from uavseg.regions.table import Regions

MAX_LISTED = 10  # ids in a message


def select_regions(
    regions: Regions,
    ids: Sequence[int] | None = None,
    largest: int | None = None,
    condition: str | None = None,
) -> Regions:
    """Select the regions that have one of the ids and fulfil the condition; of these, the largest.

    They stay in their original order. `largest` is the number to keep at most, by `area_m2`; of equal ones
    the first. For conditions see `uavseg.regions.select.where.where`. A RegionError says that an id does not
    exist, the condition is not understood, or no region is left.
    """
    kept = np.ones(len(regions), dtype=bool)
    if ids is not None:
        kept &= _has_id(regions, ids)
    if condition is not None:
        kept &= where(regions.columns, condition)
    if largest is not None:
        kept = _largest(regions, kept, largest)
    if not kept.any():
        raise RegionError(f"none of the {len(regions)} regions is selected; give weaker conditions")
    return regions.select(np.flatnonzero(kept))


def of_classes(regions: Regions, names: Sequence[str]) -> NDArray[np.bool_]:
    """Return the mask of the regions that are of some classes, by their column `class`.

    A RegionError says that no class is named, there is no such column, or no region of one of the classes.
    """
    if not names:
        raise RegionError("no class is named; leave classes out to take the regions of all")
    if "class" not in regions.columns:
        raise RegionError(
            f"these regions have no classes, so none is {names[0]}; "
            "uavseg extract --class NAME=LO,HI makes them"
        )
    column = np.array([str(value) for value in regions.columns["class"]], object)
    known = sorted(set(column.tolist()))
    for name in names:
        if name not in known:
            raise RegionError(f"no region is of the class {name}; there are {_names(known)}")
    return np.isin(column, list(names))


def _names(known: Sequence[str]) -> str:
    more = f" and {len(known) - MAX_LISTED} more" if len(known) > MAX_LISTED else ""
    return ", ".join(known[:MAX_LISTED]) + more if known else "none"


def _has_id(regions: Regions, ids: Sequence[int]) -> np.ndarray:
    known = regions.columns["id"]
    missing = sorted(set(ids) - set(known.tolist()))
    if missing:
        raise RegionError(
            f"there is no region {_listed(missing)}; there are {_listed(np.unique(known).tolist())}"
        )
    return np.isin(known, list(ids))


def _largest(regions: Regions, kept: np.ndarray, count: int) -> np.ndarray:
    if count < 1:
        raise RegionError(f"expected at least 1 largest region, got {count}")
    area = np.where(kept, regions.columns["area_m2"], -np.inf)
    first = np.argsort(-area, kind="stable")[:count]
    return kept & np.isin(np.arange(len(regions)), first)


def _listed(ids: Sequence[int]) -> str:
    shown = ", ".join(map(str, ids[:MAX_LISTED]))
    return shown if len(ids) <= MAX_LISTED else f"{shown}, ... {ids[-1]} ({len(ids)} in all)"
