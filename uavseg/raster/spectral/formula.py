"""Formulas that become intensity: a spectral index or an expression, bound to the bands of a raster."""

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from uavseg.dataclass import dataclass
from uavseg.errors import BandError, ParameterError
from uavseg.plain_text import printable
from uavseg.raster.spectral.band_names import find_band, listed, names_of
from uavseg.raster.spectral.bands import BandLayout, BandScale, Valid, Values

if TYPE_CHECKING:
    from uavseg.raster.spectral.expression import Expression
    from uavseg.raster.spectral.indices import SpectralIndex

_SHOWN = 60  # characters of a formula in messages


@dataclass(frozen=True, slots=True)
class BandWords:
    """What the user says of bands beside their numbers.

    A ParameterError says that both an index and an expression are given.
    """

    index: str | None = None  # a spectral index, see `indices`
    expr: str | None = None  # band arithmetic, see `expression`
    names: str | None = None  # names for the bands, see `band_names.renamed`

    def __post_init__(self) -> None:
        if self.index is not None and self.expr is not None:
            raise ParameterError("give --index or --expr, not both")

    @property
    def is_formula(self) -> bool:
        """Whether bands are computed with."""
        return self.index is not None or self.expr is not None


@dataclass(frozen=True, slots=True)
class Formula:
    """Band arithmetic over bands of a raster."""

    title: str  # such as "ndvi"
    expression: "Expression"
    limits: tuple[float, float] | None = None  # between which all values lie
    of_reflectance: bool = False  # whether it holds for reflectance alone

    @property
    def name(self) -> str:
        """Description for messages: "ndvi (nir - red) / (nir + red) of bands 4,1"."""
        text, bands = printable(self.expression.text), self.expression.bands
        short = text if len(text) <= _SHOWN else f"{text[: _SHOWN - 3]}..."
        numbers = ("band " if len(bands) == 1 else "bands ") + ",".join(map(str, bands))
        return " ".join(part for part in (self.title, short, "of", numbers) if part)

    def apply(
        self, planes: Values, valid: Valid | None, scales: Sequence[BandScale] = ()
    ) -> tuple[Values, Valid | None]:
        """Return values and validity from those of its bands; a result that is not finite is invalid.

        `planes` are (bands, rows, cols); the results are (1, rows, cols) float32, and (rows, cols) or None if
        every pixel is valid.
        """
        values = self.expression.compute(planes, [(scale.scale, scale.offset) for scale in scales])
        finite = np.isfinite(values)
        if not finite.all():
            valid = finite if valid is None else valid & finite
        return values[None], valid


def bind_formula(words: BandWords, layout: BandLayout) -> Formula | None:
    """Return the formula that is asked for, with the numbers of its bands; None if there is none.

    A ParameterError says that the index is not known, a BandError or ExpressionError that the expression is
    wrong, or a band is unknown.
    """
    if not words.is_formula:
        return None
    from uavseg.raster.spectral.expression import parse_expression

    if words.expr is not None:
        return Formula("", parse_expression(words.expr, partial(_find, layout)))
    assert words.index is not None
    from uavseg.raster.spectral.indices import find_index

    name, index = find_index(words.index)
    expression = parse_expression(index.formula, partial(_find_of, layout, name, index))
    return Formula(name, expression, index.limits, index.of_reflectance)


def _find(layout: BandLayout, name: str) -> int:
    """Return the band of a name in an expression, where b1, b2, ... are bands by their numbers too."""
    text = name.casefold()
    number = int(text[1:]) if text[:1] == "b" and text[1:].isascii() and text[1:].isdigit() else 0
    named = [band.number for band in names_of(layout) if text in band.keys]
    if not 1 <= number <= len(layout.dtypes):
        return find_band(layout, name)
    if named and named != [number]:
        raise BandError(
            f"{name} is band {number} by its number and band {named[0]} by its name; use another name, or "
            f"--band-names; the bands are {listed(layout)}"
        )
    return number


def _find_of(layout: BandLayout, index: str, found: "SpectralIndex", name: str) -> int:
    try:
        return find_band(layout, name)
    except BandError as error:
        raise ParameterError(f"{index} = {found.formula}: {error}") from error
