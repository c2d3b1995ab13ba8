"""How regions are drawn by their confidence: the surer, the stronger the fill and the more solid the line."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Look:
    """Fill and line of regions, and what the legend says of them; without a name it has none."""

    alpha: float
    line: str
    name: str = ""


PLAIN = Look(0.3, "solid")
_LOOKS = (
    Look(0.4, "solid", "confidence of 0.8 and more"),
    Look(0.22, "dashed", "confidence of 0.5 to 0.8"),
    Look(0.08, "dotted", "confidence below 0.5"),
)
_LEAST = (0.8, 0.5)


def looks_of(columns: dict[str, NDArray[Any]], count: int) -> list[tuple[Look, NDArray[np.bool_]]]:
    """Looks, each with the regions (n,) that have it; what has no known confidence is drawn plainly.

    Parameters
    ----------
    columns : dict of (n,) arrays
    count : int
        n.
    """
    values = columns.get("confidence", np.empty(0))
    if values.dtype.kind not in "iuf" or not np.isfinite(values).any():
        return [(PLAIN, np.ones(count, bool))]
    known = np.isfinite(values)
    rank = np.sum([values < least for least in _LEAST], axis=0)
    found = [(look, known & (rank == k)) for k, look in enumerate(_LOOKS)]
    return [(look, those) for look, those in (*found, (PLAIN, ~known)) if those.any()]
