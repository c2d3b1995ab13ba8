"""Input files: regular files only, read whole within bounds, and JSON within bounds.

Opening a named pipe waits for its writer, and a device may never end, so nothing but a regular file is
opened. The size of a file is known before it is read, and what is parsed cannot grow beyond it.
"""

import json
import os
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any

from uavseg.errors import RasterReadError, UavsegError
from uavseg.plain_text import cause_of

MAX_TEXT = 256 << 20  # bytes of a text file that is held in memory
MAX_DEPTH = 64  # of objects and lists in each other, in JSON
MAX_DIGITS = 400  # of one number in JSON; a float has up to 309 before its point

_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)

Error = Callable[[str], UavsegError]


def regular_file(path: str | os.PathLike[str], error: Error = RasterReadError) -> Path:
    """The path of an input, which has to be a regular file; it is not opened.

    Parameters
    ----------
    path : path
    error : callable
        Makes the exception from its message.

    Raises
    ------
    UavsegError
        If there is no such file, or it is a folder, a named pipe, a socket or a device.
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
    kind = next((word for is_kind, word in _KINDS if is_kind(mode)), "no regular file")
    raise error(f"{name} is {kind}; name a regular file")


def read_bytes(path: str | os.PathLike[str], error: Error = RasterReadError, limit: int = MAX_TEXT) -> bytes:
    """The whole content of a regular file of at most `limit` bytes.

    Raises
    ------
    UavsegError
        As of `regular_file`, and if it is larger or cannot be read.
    """
    name = os.fspath(path)
    try:
        with regular_file(path, error).open("rb") as file:
            content = file.read(limit + 1)
    except OSError as cause:
        if isinstance(cause, UavsegError):
            raise
        raise error(f"{name} cannot be read ({cause_of(cause)})") from cause
    if len(content) > limit:
        raise error(f"{name} has more than {limit:,} bytes, which is too much for a file of its kind")
    return content


def read_start(path: str | os.PathLike[str], count: int = 4096, error: Error = RasterReadError) -> bytes:
    """The first bytes of a regular file.

    Raises
    ------
    UavsegError
        If it cannot be read.
    """
    try:
        with Path(path).open("rb") as file:
            return file.read(count)
    except OSError as cause:
        raise error(f"{os.fspath(path)} cannot be read ({cause_of(cause)})") from cause


def parse_json(text: str, **how: Any) -> Any:
    """`json.loads` with bounds on the depth and on the length of numbers.

    Raises
    ------
    ValueError
        If it is not valid JSON or beyond the bounds.
    """
    _check_depth(text)
    return json.loads(text, parse_int=_integer, parse_float=_number, **how)


def check_yaml_brackets(content: bytes) -> None:
    """Refuse YAML with brackets in brackets beyond a depth: scanning takes time that grows with its square.

    Raises
    ------
    ValueError
        If it is nested more than 64 deep.
    """
    depth = 0
    for letter in content.translate(None, _NO_BRACKETS):
        depth += 1 if letter in b"[{" else -1
        if depth > MAX_DEPTH:
            raise ValueError(f"it is nested more than {MAX_DEPTH} deep")


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


def _integer(digits: str) -> int:
    _check_digits(digits)
    return int(digits)


def _number(digits: str) -> float:
    _check_digits(digits)
    return float(digits)


def _check_digits(digits: str) -> None:
    if len(digits) > MAX_DIGITS:
        raise ValueError(f"a number has {len(digits)} digits; at most {MAX_DIGITS} are read")
