"""Sorted integer keys: duplicates removed by sorting, and binary search inside kernels."""

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined


def sorted_unique(keys: NDArray[np.int64]) -> NDArray[np.int64]:
    """The distinct keys in ascending order; many times as fast as `numpy.unique`, which hashes them.

    Parameters
    ----------
    keys : (n,) int64 array

    Returns
    -------
    (m,) int64 array

    Examples
    --------
    >>> sorted_unique(np.array([3, 1, 3, 2])).tolist()
    [1, 2, 3]
    """
    ordered = np.sort(keys)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])] if len(ordered) else ordered


@inlined
def lower_bound(keys, key):  # type: ignore[no-untyped-def]
    """Index of the first of some ascending keys that is not below a key (binary search)."""
    low = 0
    high = keys.shape[0]
    while low < high:
        middle = (low + high) // 2
        if keys[middle] < key:
            low = middle + 1
        else:
            high = middle
    return low
