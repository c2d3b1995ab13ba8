"""Spectral indices: formulas in common names of bands, from the table `indices.csv`.

Formulas, names and references are those of Awesome Spectral Indices (https://github.com/awesome-spectral-indices,
Montero et al. 2023, Scientific Data 10:197, MIT licence), with its constants put in: g = 2.5, C1 = 6,
C2 = 7.5 and L = 1 for EVI, and L = 0.5 for SAVI (Huete 1988).
"""

import csv
from collections.abc import Iterator
from pathlib import Path

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.plain_text import shown


@dataclass(frozen=True, slots=True)
class SpectralIndex:
    """A spectral index."""

    name: str  # in full
    formula: str
    reference: str
    limits: tuple[float, float] | None  # between which all values of positive bands lie
    of_reflectance: bool  # for reflectance (0 to 1) alone: constants are added to bands


def _read_table() -> Iterator[tuple[str, SpectralIndex]]:
    text = Path(__file__).with_suffix(".csv").read_text(encoding="utf-8")
    for row in csv.DictReader(text.splitlines()):
        limits = (float(row["low"]), float(row["high"])) if row["low"] else None
        yield (
            row["index"],
            SpectralIndex(
                name=row["name"],
                formula=row["formula"],
                reference=row["reference"],
                limits=limits,
                of_reflectance=row["of_reflectance"] == "yes",
            ),
        )


INDICES = dict(_read_table())


def find_index(name: str) -> tuple[str, SpectralIndex]:
    """Return the index of a name, in any case, with its name in lower case; else a ParameterError."""
    key = name.strip().casefold()
    if key not in INDICES:
        raise ParameterError(
            f"{shown(name)} is not a known index; give another as --expr; known are {', '.join(INDICES)}"
        )
    return key, INDICES[key]
