"""Ranges of v, of values or of percentiles, from text and from numbers."""

from collections.abc import Sequence
from typing import Any

from uavseg.errors import IntensityRangeError, ParameterError
from uavseg.options.regions import RangeOptions
from uavseg.plain_text import shown
from uavseg.raster.intensity.value_range import ValueRange
from uavseg.segmentation.params.segment import IntensityRange

AnyRange = IntensityRange | ValueRange

_EXAMPLES = {"range": "0.55,1", "values": "20,40 (or 300, or ,35)", "percentile": "90,100"}


def parse_range(name: str, text: str) -> AnyRange:
    """LO,HI of an option or an argument; an end of values or percentiles may be left out.

    Parameters
    ----------
    name : str
        "--range", "--values" or "--percentile", or without the dashes as in Python.
    text : str

    Raises
    ------
    ParameterError
        If it is not such a range.

    Examples
    --------
    >>> parse_range("--values", "300,")
    ValueRange(low=300.0, high=None, by_rank=False)
    """
    kind = name.removeprefix("--")
    try:
        low, high = (_end(part, kind) for part in text.split(","))
    except ValueError:
        raise ParameterError(
            f"{name} is two numbers with a comma between them, such as {_EXAMPLES[kind]}, not {shown(text)}"
        ) from None
    return _range(name, low, high)


def requested_range(options: RangeOptions) -> AnyRange:
    """Return the range of a job: exactly one of three, each two numbers (None for an open end) or a text.

    Raises
    ------
    ParameterError
        If there is none or more than one, or it is not a range.
    """
    named = {"range": options.range, "values": options.values, "percentile": options.percentile}
    given = {name: value for name, value in named.items() if value is not None}
    if len(given) != 1:
        found = "none is given" if not given else f"{' and '.join(given)} are given"
        raise ParameterError(f"a range is one of range (v in 0..1), values and percentile; {found}")
    [(name, value)] = given.items()
    if isinstance(value, IntensityRange | ValueRange):
        return value
    if isinstance(value, str):
        return parse_range(name, value)
    if (not isinstance(value, Sequence) and getattr(value, "ndim", None) != 1) or len(value) != 2:
        raise ParameterError(f"{name} is two numbers, such as ({_EXAMPLES[name][:5]}), not {shown(value)}")
    low, high = (None if end is None else _number(name, end) for end in value)
    return _range(name, low, high)


def _number(name: str, end: Any) -> float:
    try:
        if isinstance(end, bool | str | bytes):
            raise TypeError
        return float(end)
    except (TypeError, ValueError, OverflowError):
        raise ParameterError(f"{name} is two numbers, and {shown(end)} is not one") from None


def _end(text: str, kind: str) -> float | None:
    if not text.strip() and kind != "range":
        return None
    return float(text)


def _range(name: str, low: float | None, high: float | None) -> AnyRange:
    kind = name.removeprefix("--")
    if kind != "range":
        return ValueRange(low, high, by_rank=kind == "percentile")
    if low is None or high is None:
        raise ParameterError(
            f"{name} is two numbers of v, such as 0.55,1; only values and percentiles are open"
        )
    try:
        return IntensityRange(low, high)
    except IntensityRangeError as error:
        hint = _meant(name, low, high)
        raise IntensityRangeError(f"{error}{hint}") from None


def _meant(name: str, low: float, high: float) -> str:
    """Which other option a range beyond 0..1 was probably meant for."""
    if not low <= high or (low >= 0 and high <= 1):
        return ""
    dashes = name.removesuffix("range")
    pair = f"{low:.12g},{high:.12g}"
    given = f" {pair}" if dashes else f"=({pair})"
    text = f"; for values in the units of the raster give {dashes}values{given}"
    if low >= 0 and high <= 100:
        text += f", for per cent of its pixels {dashes}percentile{given}"
    return text
