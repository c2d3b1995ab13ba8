"""Formulas that become intensity: a spectral index or band arithmetic (`--expr`), bound to its bands.

The indices are in `indices.csv`. Formulas, names and references are those of Awesome Spectral Indices
(https://github.com/awesome-spectral-indices, Montero et al. 2023, Scientific Data 10:197, MIT licence), with
its constants put in: g = 2.5, C1 = 6, C2 = 7.5 and L = 1 for EVI, and L = 0.5 for SAVI (Huete 1988).
"""

import ast
import csv
import re
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from uavseg.arrays import Float32s, Floats
from uavseg.dataclass import dataclass
from uavseg.errors import BandError, ExpressionError, ParameterError, named_errors
from uavseg.expressions import ARITHMETIC, Evaluator
from uavseg.plain_text import printable, shown
from uavseg.raster.spectral.band_names import find_band, listed, names_of
from uavseg.raster.spectral.bands import BandLayout, BandScale, Valid, Values

_SHOWN = 60  # characters of a formula in messages
MAX_CHARACTERS = 1000
MAX_DEPTH = 50
CHUNK = 1 << 14  # pixels: what a step holds stays in the processor's cache

Array = NDArray[Any]
_TABLE = Path(__file__).with_name("indices.csv").read_text(encoding="utf-8")
_KNOWN = "expected names of bands, numbers, + - * / **, parentheses and functions"


@dataclass(frozen=True, slots=True)
class SpectralIndex:
    """A spectral index."""

    name: str  # in full
    formula: str
    reference: str
    limits: tuple[float, float] | None  # between which all values of positive bands lie
    of_reflectance: bool  # for reflectance (0 to 1) alone: constants are added to bands


INDICES = {
    row["index"]: SpectralIndex(
        name=row["name"],
        formula=row["formula"],
        reference=row["reference"],
        limits=(float(row["low"]), float(row["high"])) if row["low"] else None,
        of_reflectance=row["of_reflectance"] == "yes",
    )
    for row in csv.DictReader(_TABLE.splitlines())
}


def find_index(name: str) -> tuple[str, SpectralIndex]:
    """Return the index of a name, in any case, with its name in lower case; else a ParameterError."""
    key = name.strip().casefold()
    if key not in INDICES:
        raise ParameterError(
            f"{shown(name)} is not a known index; give another as --expr; known are {', '.join(INDICES)}"
        )
    return key, INDICES[key]


@dataclass(frozen=True, slots=True)
class BandWords:
    """What is said of bands beside their numbers; ParameterError for both an index and an expression."""

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
    if words.expr is not None:
        return Formula("", parse_expression(words.expr, partial(_find, layout)))
    assert words.index is not None
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


def _find_of(layout: BandLayout, index: str, found: SpectralIndex, name: str) -> int:
    with named_errors(f"{index} = {found.formula}", BandError, ParameterError):
        return find_band(layout, name)


def _power(base: Any, exponent: Any) -> Any:
    """Compute powers; squares and square roots are exact, which `pow` of a system need not be."""
    if np.ndim(exponent) == 0 and exponent in (2.0, 0.5):
        return np.square(base) if exponent == 2.0 else np.sqrt(base)
    return np.power(base, exponent)


@dataclass(frozen=True, slots=True)
class Expression:
    """Band arithmetic, checked and ready to be computed chunk by chunk.

    Every step is one function of numpy in double precision, in the order in which it is written, so neither
    tiles nor threads change a bit.
    """

    text: str
    bands: tuple[int, ...]  # those that it uses, counted from 1, in the order of their first use
    names: tuple[tuple[str, int], ...]  # those that it uses, each with the place of its band in `bands`

    def compute(self, planes: Array, scales: Sequence[tuple[float, float]] = ()) -> Float32s:
        """Return the value of each pixel, computed in double precision and rounded to single.

        `planes` (bands, rows, cols) are those of `bands`, and `scales` what a stored number of each is
        multiplied by, and what is added then. The result is not finite where a step divides by 0, or has no
        result.
        """
        values = np.empty(planes.shape[1:], np.float32)
        flat, found = [np.ascontiguousarray(plane).reshape(-1) for plane in planes], values.reshape(-1)
        scales = scales or ((1.0, 0.0),) * len(flat)
        with np.errstate(all="ignore"):
            for start in range(0, len(found), CHUNK):
                part = slice(start, start + CHUNK)
                floats = [_in_units(plane[part], *scale) for plane, scale in zip(flat, scales, strict=True)]
                found[part] = self._run(floats)
        return values

    def _run(self, bands: Sequence[Array]) -> Any:
        return _Bands(self.text, {name: bands[k] for name, k in self.names}).evaluate(_parse(self.text))


def _in_units(plane: Array, scale: float, offset: float) -> Floats:
    values = plane.astype(np.float64)
    if (scale, offset) != (1.0, 0.0):
        values *= scale
        values += offset
    return values


def parse_expression(text: str, find: Callable[[str], int]) -> Expression:
    """Parse band arithmetic: names of bands, numbers, + - * / **, parentheses and a few functions.

    `find` gives the number of the band of a name, or a BandError. An ExpressionError says that the text
    cannot be parsed, uses anything else, names an unknown band, or names none.

    Examples
    --------
    >>> expression = parse_expression("(nir - red) / (nir + red)", {"nir": 4, "red": 1}.__getitem__)
    >>> expression.bands, expression.compute(np.array([[[3, 0]], [[1, 0]]], np.uint8))
    ((4, 1), array([[0.5, nan]], dtype=float32))
    """
    text = re.sub(r"\s", " ", text).strip()
    if len(text) > MAX_CHARACTERS:
        raise ExpressionError(
            f"the expression has {len(text)} characters; at most {MAX_CHARACTERS} are read: shorten it"
        )
    if not text.isprintable():
        raise _wrong(text, next(n for n, letter in enumerate(text) if not letter.isprintable()), _KNOWN)
    tree = _parse(text)
    names = _Names(text, find)
    with np.errstate(all="ignore"):
        names.evaluate(tree)
    bands = tuple(dict.fromkeys(names.found.values()))
    if not bands:
        raise ExpressionError(f"the expression {printable(text)!r} uses no band; expected as in nir / red")
    return Expression(text, bands, tuple((name, bands.index(band)) for name, band in names.found.items()))


@lru_cache(maxsize=16)
def _parse(text: str) -> ast.expr:
    try:
        return ast.parse(text, mode="eval").body
    except SyntaxError as error:
        at = error.offset - 1 if error.offset else len(text)  # 0 where more is expected
        raise _wrong(text, at, _syntax_text(text, at)) from error
    except (ValueError, RecursionError, MemoryError) as error:
        raise ExpressionError("the expression cannot be read: it is nested too deeply or not text") from error


class _Bands(Evaluator):
    """Band arithmetic over arrays, by the names of their bands."""

    nodes = frozenset({ast.BinOp, ast.UnaryOp, ast.Call, ast.Constant, ast.Name})
    operators: ClassVar = {**ARITHMETIC, ast.Pow: _power}
    functions: ClassVar = {
        "abs": (np.abs, 1),
        "sqrt": (np.sqrt, 1),
        "exp": (np.exp, 1),
        "log": (np.log, 1),
    } | {"log10": (np.log10, 1), "min": (np.minimum, 2), "max": (np.maximum, 2)}
    max_depth = MAX_DEPTH

    def __init__(self, text: str, bands: Mapping[str, Array]) -> None:
        self.text = text
        self.bands = bands

    def look_up(self, part: ast.Name) -> Any:
        return self.bands[part.id]

    def constant(self, part: ast.Constant) -> Any:
        if type(part.value) not in (int, float):
            raise self.refused(part)
        try:
            value = np.float64(part.value)  # type: ignore[arg-type]
        except OverflowError:
            value = np.float64(np.inf)
        if not np.isfinite(value):
            raise self.refused(part, "the number is too large")
        return value

    def refused(self, part: ast.expr, why: str = "") -> ExpressionError:
        before = self.text.encode()[: part.col_offset].decode(errors="replace")
        return _wrong(self.text, len(before), why or _KNOWN)


class _Names(_Bands):
    """The same with a number for each band, which finds what is wrong, and the bands that are used."""

    def __init__(self, text: str, find: Callable[[str], int]) -> None:
        super().__init__(text, {})
        self.find = find
        self.found: dict[str, int] = {}

    def look_up(self, part: ast.Name) -> Any:
        try:
            self.found[part.id] = self.find(part.id)
        except BandError as error:
            raise self.refused(part, str(error)) from error
        return np.float64(1)


def _wrong(text: str, at: int, why: str) -> ExpressionError:
    """Return an error that shows where it is: the column, and a caret in front of the place."""
    at = min(max(at, 0), len(text))
    before, after = printable(text[max(at - 60, 0) : at]), printable(text[at : at + 60])
    return ExpressionError(f"the expression is wrong at column {at + 1} (^), {before}^{after}: {why}")


def _syntax_text(text: str, at: int) -> str:
    if text.count("(") != text.count(")"):
        more = "closed" if text.count("(") < text.count(")") else "opened"
        return f"more parentheses are {more} than {'opened' if more == 'closed' else 'closed'}"
    if not text:
        return "it is empty; expected as in (nir - red) / (nir + red)"
    if at >= len(text):
        return "it ends too early"
    return _KNOWN
