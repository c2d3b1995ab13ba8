"""Input files: regular files only, read whole within bounds, and JSON with bounded depth and numbers.

Opening a named pipe waits for its writer, and a device may never end, so nothing but a regular file is
opened. The size of a file is known before it is read, and what is parsed cannot grow beyond it.
"""

import json
import os
import stat
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from uavseg.errors import ParameterError, RasterReadError, UavsegError, caused_errors
from uavseg.plain_text import cause_of, shown

_MAX_OBJECT_BYTES = 100_000  # of a JSON file that describes one thing
MAX_TEXT = 256 << 20  # bytes of a text file that is held in memory
MAX_DEPTH = 64  # of objects and lists in each other, in JSON
MAX_DIGITS = 400  # of one number in JSON; a float has up to 309 before its point

_FILE_TYPES = (
    *((stat.S_ISDIR, "a folder"), (stat.S_ISFIFO, "a named pipe"), (stat.S_ISSOCK, "a socket")),
    *((stat.S_ISCHR, "a device"), (stat.S_ISBLK, "a device")),
)

Error = Callable[[str], UavsegError]


def regular_file(path: str | os.PathLike[str], error: Error = RasterReadError) -> Path:
    """Refuse an input that is not a regular file, without opening it, else return its path.

    It is refused with an `error` if there is no such file, or it is a folder, a named pipe, a socket or a
    device.
    """
    name = os.fspath(path)
    try:
        mode = os.stat(path).st_mode  # noqa: PTH116 - Path(...) rejects some names that a file may have
    except FileNotFoundError as cause:
        raise error(f"there is no file {name}") from cause
    except (OSError, ValueError) as cause:
        raise error(f"{name} cannot be read ({cause_of(cause)})") from cause
    if stat.S_ISREG(mode):
        return Path(path)
    file_type = next((text for is_type, text in _FILE_TYPES if is_type(mode)), "no regular file")
    raise error(f"{name} is {file_type}; name a regular file")


def read_bytes(path: str | os.PathLike[str], error: Error = RasterReadError, limit: int = MAX_TEXT) -> bytes:
    """Read a regular file of at most `limit` bytes; an `error` if it cannot be read or is longer."""
    name = os.fspath(path)
    with (
        caused_errors(f"{name} cannot be read", error, OSError),
        regular_file(path, error).open("rb") as file,
    ):
        content = file.read(limit + 1)
    if len(content) > limit:
        raise error(f"{name} has more than {limit:,} bytes, which is too much for a file of its kind")
    return content


def read_start(path: str | os.PathLike[str], count: int = 4096, error: Error = RasterReadError) -> bytes:
    """Read the first `count` bytes of a regular file; an `error` if it cannot be read."""
    with caused_errors(f"{os.fspath(path)} cannot be read", error, OSError), Path(path).open("rb") as file:
        return file.read(count)


def parse_json(text: str, **options: Any) -> Any:
    """Parse JSON as `json.loads`; ValueError where objects are nested too deeply or numbers too long."""
    _check_depth(text)
    return json.loads(text, parse_int=partial(_number, int), parse_float=partial(_number, float), **options)


def check_yaml_brackets(content: bytes) -> None:
    """Refuse YAML with deeply nested brackets (ValueError): the time to scan it grows with its square."""
    depth = 0
    for letter in content.translate(None, _NO_BRACKETS):
        depth += 1 if letter in b"[{" else -1
        if depth > MAX_DEPTH:
            raise ValueError(f"it is nested more than {MAX_DEPTH} deep")


def parse_yaml(content: bytes, error: Error, aliases: str, invalid: str) -> Any:
    """Parse YAML of plain values; an `error` says `aliases` where it has some (*name), else `invalid`."""
    import yaml

    wrong = (yaml.YAMLError, ValueError, RecursionError, TypeError, KeyError)
    with caused_errors(invalid, error, *wrong):
        check_yaml_brackets(content)
        if any(isinstance(token, yaml.AliasToken) for token in yaml.scan(content, Loader=yaml.SafeLoader)):
            raise error(aliases)
        return yaml.safe_load(content)


_NO_BRACKETS = bytes(set(range(256)) - set(b"[]{}"))


def _check_depth(text: str) -> None:
    """Refuse deep nesting before a recursive parser meets it."""
    if max(text.count("["), text.count("{")) <= MAX_DEPTH // 2:
        return
    depth, inside, skip = 0, False, False
    for letter in text:
        if skip:
            skip = False
        elif inside:
            skip, inside = letter == "\\", letter != '"'
        elif letter == '"':
            inside = True
        elif letter in "[{":
            depth += 1
            if depth > MAX_DEPTH:
                raise ValueError(f"it is nested more than {MAX_DEPTH} deep")
        elif letter in "]}":
            depth -= 1


def _number(convert: Callable[[str], Any], digits: str) -> Any:
    if len(digits) > MAX_DIGITS:
        raise ValueError(f"a number has {len(digits)} digits; at most {MAX_DIGITS} are read")
    return convert(digits)


def read_object(path: str | os.PathLike[str], subject: str, expected: str) -> dict[str, Any]:
    """Read a JSON file that describes one thing, such as a camera; ParameterError where it holds no object.

    The message has what the file describes, the subject, and the expected content of the object.
    """
    unread = f"{path} cannot be read as a {subject} in JSON"
    with caused_errors(unread, ParameterError, ValueError, RecursionError):
        content = parse_json(read_bytes(path, ParameterError, _MAX_OBJECT_BYTES).decode("utf-8"))
    if not isinstance(content, dict) or not content:
        raise ParameterError(f"{path} is not a {subject}; expected a JSON object with {expected}")
    return content


def as_number(value: Any, name: str, error: Error, convert: Callable[[Any], Any] = float) -> Any:
    """Convert a number that is neither text nor a truth value; name it in an `error` else."""
    try:
        if isinstance(value, str | bytes | bool):
            raise TypeError
        return convert(value)
    except (TypeError, ValueError, OverflowError) as cause:
        raise error(f"{name} is a number, not {shown(value)}") from cause


def number_in(content: dict[str, Any], key: str, path: str | os.PathLike[str], subject: str) -> float:
    """Return the number of a key of `read_object`, or raise a ParameterError."""
    value = content[key]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ParameterError(f"{path}: {key} of a {subject} is a number, not {shown(value)}")
    try:
        return float(value)
    except OverflowError as error:
        raise ParameterError(f"{path}: {key} of a {subject} is too large") from error


def text_in(
    content: dict[str, Any], key: str, default: str, path: str | os.PathLike[str], subject: str
) -> str:
    """Return the text of a key of `read_object`, or the default; ParameterError if it is not text."""
    value = content.get(key, default)
    if not isinstance(value, str):
        raise ParameterError(f"{path}: {key} of a {subject} is a word, not {shown(value)}")
    return value
