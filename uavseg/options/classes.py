"""Ranges of v, values or percentiles, and classes of them: texts, numbers, mappings, files (CSV or YAML)."""

import csv
import io
import math
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from uavseg.errors import IntensityRangeError, ParameterError, caused_errors, named_errors
from uavseg.inputs import parse_yaml, read_bytes
from uavseg.options.regions import RangeOptions
from uavseg.plain_text import shown
from uavseg.raster.intensity.value_range import ValueRange
from uavseg.segmentation.params.segment import IntensityRange, ValueClass, ValueClasses

AnyRange = IntensityRange | ValueRange

_EXAMPLES = {"range": "0.55,1", "values": "20,40 (or 300, or ,35)", "percentile": "90,100"}
MAX_BYTES = 1 << 16  # of a file of classes
_COLUMNS = ("name", "range", "low", "high", "color")
_SPELLINGS = {"class": "name", "colour": "color", "range_low": "low", "range_high": "high"}
_COLOR = re.compile(r"#[0-9a-fA-F]{6}\Z")
_EXPECTED = "columns name and range (or low and high), and color if you like"


def parse_range(name: str, text: str) -> AnyRange:
    """Read LO,HI of an option or an argument; an end of values or percentiles may be left out.

    The name is "--range", "--values" or "--percentile", or without the dashes as in Python. ParameterError is
    raised if it is not such a range.

    Examples
    --------
    >>> parse_range("--values", "300,")
    ValueRange(low=300.0, high=None, by_rank=False)
    """
    kind = name.removeprefix("--")
    try:
        low, high = (float(one) if one.strip() or kind == "range" else None for one in text.split(","))
    except ValueError:
        raise ParameterError(
            f"{name} is two numbers with a comma between them, such as {_EXAMPLES[kind]}, not {shown(text)}"
        ) from None
    return _range(name, low, high)


def requested_range(options: RangeOptions) -> AnyRange:
    """Return the range of a job: exactly one of three, each two numbers (None for an open end) or a text.

    ParameterError is raised if there is none or more than one, or it is not a range.
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
    low, high = (None if end is None else _end_of(name, end) for end in value)
    return _range(name, low, high)


def _end_of(name: str, end: Any) -> float:
    try:
        if isinstance(end, bool | str | bytes):
            raise TypeError
        return float(end)
    except (TypeError, ValueError, OverflowError):
        raise ParameterError(f"{name} is two numbers, and {shown(end)} is not one") from None


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
        raise IntensityRangeError(f"{error}{_meant(name, low, high)}") from None


def _meant(name: str, low: float, high: float) -> str:
    """Return which other option a range beyond 0..1 was probably meant for."""
    if not low <= high or (low >= 0 and high <= 1):
        return ""
    dashes, pair = name.removesuffix("range"), f"{low:.12g},{high:.12g}"
    given = f" {pair}" if dashes else f"=({pair})"
    text = f"; for values in the units of the raster give {dashes}values{given}"
    if low >= 0 and high <= 100:
        text += f", for per cent of its pixels {dashes}percentile{given}"
    return text


def parse_class_range(text: str, what: str = "a range") -> IntensityRange:
    """Read LO,HI as a range of v; either end may be left out. What is not two numbers is a ParameterError.

    Examples
    --------
    >>> parse_class_range("0.5,")
    IntensityRange(low=0.5, high=1.0)
    """
    try:
        low, high = (part.strip() for part in text.split(","))
        if low or high:
            return IntensityRange(float(low or 0), float(high or 1))
    except ValueError as error:
        if isinstance(error, ParameterError):
            raise
    raise ParameterError(f"{what} is two numbers between commas, such as 0.55,1, not {text!r}")


def classes_of_texts(texts: Sequence[str]) -> ValueClasses:
    """Return classes from texts such as "water=0,0.2".

    ParameterError is raised if one is not understood, or the classes do not go together.

    Examples
    --------
    >>> [str(one) for one in classes_of_texts(["water=0,0.2", "sand=0.6,0.8"]).classes]
    ['water (0,0.2)', 'sand (0.6,0.8)']
    """
    found = []
    for text in texts:
        name, equals, ends = text.rpartition("=")
        if not equals:
            raise ParameterError(f"--class is NAME=LO,HI, such as water=0,0.2, not {text!r}")
        found.append(ValueClass(name.strip(), parse_class_range(ends, f"the range of the class {name}")))
    return ValueClasses(tuple(found))


def classes_of_ranges(texts: Sequence[str]) -> ValueClasses:
    """Return classes from texts of ranges, after which they are named; errors as of `classes_of_texts`.

    Examples
    --------
    >>> [one.name for one in classes_of_ranges(["0,0.20", "0.5,1"]).classes]
    ['0,0.2', '0.5,1']
    """
    found = [parse_class_range(text, "--range") for text in texts]
    return ValueClasses(tuple(ValueClass(f"{one.low:g},{one.high:g}", one) for one in found))


def classes_of_options(ranges: Any, texts: Sequence[str], classes: Any) -> ValueClasses | None:
    """Return the classes of a job, None where it has one range; errors as of `classes_of_texts`.

    Several ranges are a list of their texts. For a mapping or a path see `classes_of_mapping` and
    `read_classes`.
    """
    if isinstance(classes, str | os.PathLike):
        return read_classes(classes)
    if isinstance(classes, Mapping):
        return classes_of_mapping(classes)
    if classes is not None:
        raise ParameterError(f"classes are a mapping of names to ranges, or a file, not {shown(classes)}")
    if texts:
        return classes_of_texts(texts)
    several = isinstance(ranges, list) and len(ranges) > 1 and isinstance(ranges[0], str)
    return classes_of_ranges(ranges) if several else None


def classes_of_mapping(classes: Mapping[str, Any]) -> ValueClasses:
    """Return classes from a mapping of names to (low, high) or (low, high, color).

    ParameterError is raised if a value is neither, or the classes do not go together.

    Examples
    --------
    >>> classes_of_mapping({"water": (0, 0.2, "#2040ff")}).classes[0].color
    '#2040ff'
    """
    found = []
    for name, value in classes.items():
        parts = list(value) if isinstance(value, Sequence) and not isinstance(value, str) else []
        if len(parts) not in (2, 3) or not isinstance(name, str):
            raise ParameterError(
                f"classes are names with (low, high) or (low, high, color), not {shown(name)}: {shown(value)}"
            )
        found.append(_class(name, parts[0], parts[1], parts[2] if len(parts) == 3 else None))
    return ValueClasses(tuple(found))


def read_classes(path: str | os.PathLike[str]) -> ValueClasses:
    """Read classes from a file: CSV with a header, or a list in YAML, each with a name and a range.

    ParameterError is raised if it cannot be read or understood, or the classes do not go together.
    """
    name, suffix = os.fspath(path), Path(path).suffix.lower()
    if suffix not in (".csv", ".yaml", ".yml"):
        raise ParameterError(f"{name}: classes are read from .csv or .yaml")
    content = read_bytes(path, ParameterError, MAX_BYTES)
    with named_errors(name, ParameterError):
        rows = _csv_rows(content) if suffix == ".csv" else _yaml_rows(content)
        return ValueClasses(tuple(_class_of_row(row) for row in rows))


def _csv_rows(content: bytes) -> list[dict[str, Any]]:
    """Return rows by the names of columns."""
    with caused_errors("it is not a table of text", ParameterError, csv.Error, ValueError):
        lines = list(csv.reader(io.StringIO(content.decode("utf-8-sig"), newline=""), strict=True))
    rows = [line for line in lines if any(field.strip() for field in line)]
    if len(rows) < 2:
        raise ParameterError(f"it has no classes; expected a header with the {_EXPECTED}, and a row for each")
    header = rows[0]
    for row in rows[1:]:
        if len(row) != len(header):
            raise ParameterError(
                f"the row {','.join(row)!r} has {len(row)} fields and the header {len(header)}; a range with "
                'a comma stands in quotes, as in water,"0,0.2"'
            )
    return [dict(zip(header, row, strict=True)) for row in rows[1:]]


def _yaml_rows(content: bytes) -> list[dict[str, Any]]:
    """Return the list of classes, or a mapping of names to ranges, as rows."""
    aliases = "it has aliases (*name), which are not read"
    result = parse_yaml(content, ParameterError, aliases, "it is not YAML")
    if isinstance(result, dict) and isinstance(result.get("classes"), list | dict):
        result = result["classes"]
    if isinstance(result, dict):
        result = [
            {"name": name, **(value if isinstance(value, dict) else {"range": value})}
            for name, value in result.items()
        ]
    if not isinstance(result, list) or not result or not all(isinstance(row, dict) for row in result):
        raise ParameterError("it has no list of classes; expected entries with a name and a range")
    return result


def _class_of_row(row: Mapping[Any, Any]) -> ValueClass:
    """Return the class of a row of a file."""
    named: dict[str, Any] = {}
    for key, value in row.items():
        column = str(key).strip().lower()
        column = _SPELLINGS.get(column, column)
        if column not in _COLUMNS:
            raise ParameterError(f"{str(key)!r} is not known; expected {_EXPECTED}")
        named[column] = value.strip() if isinstance(value, str) else value
    name = named.get("name")
    if name is None or name == "" or isinstance(name, list | dict):
        raise ParameterError(f"a class has no name; expected {_EXPECTED}")
    ends = named.get("range")
    if ends in (None, ""):
        ends = [named.get("low"), named.get("high")]
    if isinstance(ends, str):
        ends = ends.split(",")
    if not isinstance(ends, list) or len(ends) != 2:
        raise ParameterError(f"the class {name} has no range of two numbers; expected {_EXPECTED}")
    low, high = ends
    return _class(str(name), low, high, named.get("color") or None)


def _class(name: str, low: Any, high: Any, color: Any) -> ValueClass:
    """Return a class from its words, which are checked."""
    numbers = []
    for end in (low, high):
        try:
            number = math.nan if isinstance(end, bool) or end is None else float(end)
        except (TypeError, ValueError, OverflowError):
            number = math.nan
        if math.isnan(number):
            raise ParameterError(f"the range of the class {name} is two numbers, not {shown(end)}")
        numbers.append(number)
    if color is not None and not (isinstance(color, str) and _COLOR.match(color)):
        raise ParameterError(f"the color of the class {name} is written #rrggbb, not {shown(color)}")
    with named_errors(f"the class {name}", ParameterError):
        interval = IntensityRange(*numbers)
    return ValueClass(name, interval, None if color is None else color.lower())
