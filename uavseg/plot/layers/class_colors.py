"""Colours of regions by their class: those of the column `color`, or one for each class."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

MAX_CLASSES = 24  # in a legend
_HEX = re.compile(r"#[0-9a-fA-F]{6}\Z")


@dataclass(frozen=True)
class ClassColors:
    """A colour for each region, and the classes that the legend lists.

    Parameters
    ----------
    colors : (n,) object array of str
        As "#rrggbb".
    legend : dict of str to str
        The colour of each class by its name.
    """

    colors: NDArray[np.object_]
    legend: dict[str, str]

    @classmethod
    def of(cls, columns: dict[str, NDArray[Any]], palette: Sequence[str]) -> "ClassColors | None":
        """Colours by the columns `class` and `color`; None without classes, or with too many for a legend.

        Parameters
        ----------
        columns : dict of (n,) arrays
        palette : sequence of str
            For classes without a colour.
        """
        if "class" not in columns:
            return None
        names = [_text(value) for value in columns["class"]]
        known = list(dict.fromkeys(sorted(names)))
        if not 1 <= len(known) <= MAX_CLASSES:
            return None
        given: dict[str, str] = {}
        for name, value in zip(names, columns.get("color", ()), strict=False):
            if _HEX.match(_text(value)):
                given.setdefault(name, _text(value))
        free = [color for color in palette if color not in given.values()] or list(palette)
        legend = {name: given.get(name) or free[n % len(free)] for n, name in enumerate(known)}
        return cls(np.array([legend[name] for name in names], object), legend)


def _text(value: Any) -> str:
    return "" if value is None or value != value else str(value)
