"""Texts of the command line as the values that Python takes."""

import math
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

from uavseg.errors import ParameterError, RasterReadError, RegionError, caused_errors

Band = int | str


class OptionTextError(ParameterError):
    """A text that is not the value of its option, which is an error of usage."""


def band(text: str) -> Band:
    """Return the number of a band, or its name."""
    text = text.strip()
    try:
        number = int(text)
    except ValueError:
        if text:
            return text
        raise OptionTextError("a band is a number or a name, not an empty text") from None
    if not 0 < number < 2**31:
        raise OptionTextError(f"bands are counted from 1, there is no band {text}")
    return number


def bands(text: str) -> tuple[Band, ...]:
    """Return numbers or names of bands between commas."""
    return tuple(map(band, text.split(",")))


def three_bands(text: str) -> tuple[Band, Band, Band]:
    """Return numbers or names of three bands."""
    parts = bands(text)
    if len(parts) != 3:
        raise OptionTextError(f"{text!r} is not three bands, such as 4,3,2 or nir,red,green")
    return parts[0], parts[1], parts[2]


def nodata(text: str) -> float | str | None:
    """Return the number, or the text of `as_nodata`."""
    from uavseg.raster.spectral.bands import as_nodata

    try:
        return as_nodata(text)
    except ParameterError as error:
        raise OptionTextError(str(error)) from error


def count_or_auto(text: str) -> int | Literal["auto"]:
    """Return a number of classes, or "auto"."""
    if text == "auto":
        return "auto"
    refusal = f"{text!r} is neither auto nor a number such as 3"
    with caused_errors(refusal, OptionTextError, ValueError, form="{}"):
        return int(text)


def range_named(name: str) -> Callable[[str], Any]:
    """Return a parser of LO,HI of an option with this name."""

    def parse(text: str) -> Any:
        from uavseg.options.classes import parse_range

        return parse_range(name, text)

    return parse


def several_ranges(given: tuple[str, ...]) -> Any:
    """Return one range, or the texts of several."""
    return list(given) if len(given) > 1 else range_named("--range")(given[0])


def numbers(expected: str, *counts: int, separator: str | None = ",") -> Callable[[str], tuple[float, ...]]:
    """Return a parser of so many numbers; without counts they are counted where they are used.

    `expected` says what the option is.
    """

    def parse(text: str) -> tuple[float, ...]:
        try:
            result = tuple(float(part) for part in text.lower().split(separator))
        except ValueError:
            result = ()
        if not result or (counts and len(result) not in counts):
            raise ParameterError(f"{expected}, not {text!r}")
        return result

    return parse


def number_or(word: str, value: Any, expected: str) -> Callable[[str], Any]:
    """Return a parser of a number, or of a word that stands for a value."""

    def parse(text: str) -> Any:
        if text.strip().lower() == word:
            return value
        try:
            return float(text)
        except ValueError:
            raise ParameterError(f"{expected}, not {text!r}") from None

    return parse


def home(text: str) -> tuple[float, ...] | Literal["auto"]:
    """Return LAT,LON or LAT,LON,M as numbers, or "auto"."""
    if text.strip().lower() == "auto":
        return "auto"
    expected = "--home is LAT,LON or LAT,LON,M in degrees and metres, or auto"
    return numbers(expected, 2, 3, separator="," if "," in text else None)(text)


def ids(text: str) -> list[int]:
    """Return whole numbers between commas."""
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise RegionError(f"--ids is whole numbers between commas, as in 1,4,7, not {text!r}") from None


def shutter(text: str) -> float:
    """Return 1/1000 or 0.001 as seconds."""
    above, slash, below = text.partition("/")
    with suppress(ValueError, ZeroDivisionError):
        divisor = float(below) if slash else 1.0
        if math.isfinite(divisor):
            return float(above) / divisor
    raise ParameterError(f"--shutter is seconds, such as 1/1000, not {text!r}")


def zones(texts: tuple[str, ...]) -> list[str | tuple[float, float]]:
    """Return names of files, and LO,HI as numbers unless a file has that name."""
    return [_zone(text) for text in texts]


def _zone(text: str) -> str | tuple[float, float]:
    parts = text.split(",")
    if len(parts) != 2 or Path(text).exists():
        return text
    try:
        return float(parts[0]), float(parts[1])
    except ValueError:
        return text


def place_item_or_file(text: str) -> str | float | tuple[float, ...]:
    """Return a number, numbers between commas, or the name of a file; one that there is comes first."""
    if Path(text).is_file():
        return text
    try:
        first, *more = map(float, text.split(","))
    except ValueError:
        return text
    return (first, *more) if more else first


def each(parse: Callable[[str], Any]) -> Callable[[tuple[str, ...]], tuple[Any, ...]]:
    """Return a parser of all texts of an option that may be repeated."""
    return lambda texts: tuple(map(parse, texts))


def or_none(texts: tuple[str, ...]) -> tuple[str, ...] | None:
    """Return the texts of an option that may be repeated, None where there are none."""
    return texts or None


def names_from_standard_input(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return names of rasters, with those that standard input holds in place of -."""
    if "-" not in names:
        return names
    from uavseg.raster.read.source_list import MAX_LIST, parse_list

    if sys.stdin is None:
        raise RasterReadError("the standard input is closed; name rasters, or pass their names to it")
    listed = parse_list(sys.stdin.buffer.read(MAX_LIST))
    if not listed:
        raise RasterReadError("the standard input names no rasters; pass one name a line to it")
    return tuple(name for given in names for name in (listed if given == "-" else [given]))
