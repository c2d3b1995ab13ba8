"""JSON files that describe one thing, such as a camera: an object of numbers and words."""

import os
from typing import Any

from uavseg.errors import ParameterError
from uavseg.inputs import parse_json, read_bytes
from uavseg.plain_text import cause_of, shown

MAX_FILE_BYTES = 100_000


def read_object(path: str | os.PathLike[str], kind: str, expected: str) -> dict[str, Any]:
    """The object that a file holds.

    Parameters
    ----------
    path : str or path
    kind : str
        What it describes, such as "camera", for the message.
    expected : str
        What the object has, for the message.

    Raises
    ------
    ParameterError
        If the file cannot be read, or holds no object.
    """
    try:
        given = parse_json(read_bytes(path, ParameterError, MAX_FILE_BYTES).decode("utf-8"))
    except (ValueError, RecursionError) as error:
        if isinstance(error, ParameterError):
            raise
        raise ParameterError(f"{path} cannot be read as a {kind} in JSON ({cause_of(error)})") from error
    if not isinstance(given, dict) or not given:
        raise ParameterError(f"{path} is not a {kind}; expected a JSON object with {expected}")
    return given


def number_in(given: dict[str, Any], key: str, path: str | os.PathLike[str], kind: str) -> float:
    """The number of a key; ParameterError if it is none."""
    value = given[key]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ParameterError(f"{path}: {key} of a {kind} is a number, not {shown(value)}")
    try:
        return float(value)
    except OverflowError as error:
        raise ParameterError(f"{path}: {key} of a {kind} is too large") from error


def word_in(given: dict[str, Any], key: str, default: str, path: str | os.PathLike[str], kind: str) -> str:
    """The word of a key, or the default; ParameterError if it is none."""
    value = given.get(key, default)
    if not isinstance(value, str):
        raise ParameterError(f"{path}: {key} of a {kind} is a word, not {shown(value)}")
    return value
