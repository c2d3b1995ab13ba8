"""Which regions: by id, by a condition, by size."""

from collections.abc import Sequence

import numpy as np

from uavseg.errors import RegionError
from uavseg.regions.select.where import where
from uavseg.regions.table import Regions

MOST_NAMED = 10  # ids that a message lists


def choose(
    regions: Regions,
    ids: Sequence[int] | None = None,
    largest: int | None = None,
    condition: str | None = None,
) -> Regions:
    """Those of the regions that have one of these ids and fulfil a condition; of them, the largest.

    Parameters
    ----------
    regions : Regions
    ids : sequence of int, optional
        Every one of them must be there.
    largest : int, optional
        How many to keep at most, by `area_m2`; the first ones among equals.
    condition : str, optional
        See `uavseg.regions.select.where.where`.

    Returns
    -------
    regions : Regions
        In the order in which they were.

    Raises
    ------
    RegionError
        If an id is not there, the condition is not understood, or nothing is left.
    """
    kept = np.ones(len(regions), dtype=bool)
    if ids is not None:
        kept &= _have(regions, ids)
    if condition is not None:
        kept &= where(regions.columns, condition)
    if largest is not None:
        kept = _largest(regions, kept, largest)
    if not kept.any():
        raise RegionError(f"none of the {len(regions)} regions is chosen; ask for less")
    return regions.select(np.flatnonzero(kept))


def _have(regions: Regions, ids: Sequence[int]) -> np.ndarray:
    there = regions.columns["id"]
    missing = sorted(set(ids) - set(there.tolist()))
    if missing:
        raise RegionError(
            f"there is no region {_listed(missing)}; there are {_listed(np.unique(there).tolist())}"
        )
    return np.isin(there, list(ids))


def _largest(regions: Regions, kept: np.ndarray, count: int) -> np.ndarray:
    if count < 1:
        raise RegionError(f"the largest {count} regions are none; ask for at least 1")
    area = np.where(kept, regions.columns["area_m2"], -np.inf)
    first = np.argsort(-area, kind="stable")[:count]
    return kept & np.isin(np.arange(len(regions)), first)


def _listed(ids: Sequence[int]) -> str:
    shown = ", ".join(map(str, ids[:MOST_NAMED]))
    return shown if len(ids) <= MOST_NAMED else f"{shown}, ... {ids[-1]} ({len(ids)} in all)"
