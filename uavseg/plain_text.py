"""Text of messages: one printable line of bounded length, whatever a file or a library says."""

import re
import struct
from collections.abc import Sequence

MAX_MESSAGE = 500  # characters
MAX_WORD = 160
MAX_CAUSE = 200
_TAIL = 150  # of a message, which often ends with what to do


def one_line(text: object, max_length: int = MAX_MESSAGE) -> str:
    r"""Format a text as one printable line: control characters are escaped, the middle of long ones left out.

    `max_length` is how many characters are kept.

    Examples
    --------
    >>> one_line("red\x1b[31m\nfile.tif")
    'red\\x1b[31m\\nfile.tif'
    >>> one_line("a" * 1000, 20)
    'aaaaaaa ... aaaaaaaa'
    """
    line = re.sub(rf"\S{{{MAX_WORD + 1},}}", lambda word: _shortened(word[0], MAX_WORD), printable(str(text)))
    return _shortened(line, max_length)


def printable(text: str) -> str:
    r"""Escape control characters, and those that change the direction of writing.

    Examples
    --------
    >>> printable("a\tb\x9b")
    'a\\tb\\x9b'
    """
    if text.isprintable():
        return text
    return "".join(one if one.isprintable() else one.encode("unicode_escape").decode() for one in text)


def cause_of(error: BaseException) -> str:
    """Return the message of the first error in a chain of causes: its first sentence, as one line.

    Python's messages about values of a wrong type are replaced by ones for users.

    Examples
    --------
    >>> cause_of(ValueError("Cannot read it.\\nSee the manual. It is long."))
    'Cannot read it'
    >>> cause_of(ValueError("could not convert string to float: 'x'")), cause_of(KeyError("items"))
    ("expected a number, got 'x'", "'items' is missing")
    """
    while error.__cause__ is not None:
        error = error.__cause__
    for error_type, text in _MESSAGES.items():
        if isinstance(error, error_type):
            return text
    message = " ".join(str(getattr(error, "strerror", None) or error).split())
    if type(error) is KeyError:
        return f"{shown(error.args[0]) if error.args else 'a value'} is missing"
    for pattern, text in _REPHRASED:
        message = re.sub(pattern, text, message)
    sentence = re.split(r"(?<=[^.\s])\.(?=\s|$)", message, maxsplit=1)[0]
    return one_line(sentence or type(error).__name__, MAX_CAUSE)


_MESSAGES: dict[type[BaseException], str] = {
    UnicodeError: "a text or a name in it is not UTF-8",
    RecursionError: "it is nested too deeply",
    OverflowError: "a number in it is too large",
    TypeError: "a value in it is of a wrong kind",
    AttributeError: "a value in it is of a wrong kind",
    IndexError: "a list in it is too short",
    UnboundLocalError: "it is damaged",
    struct.error: "a record in it is cut short",
}
_REPHRASED = (
    (r"^could not convert string to float: (.*)", r"expected a number, got \1"),
    (r"^invalid literal for int\(\) with base \d+: (.*)", r"expected a whole number, got \1"),
    (r"^cannot convert float \w+ to integer", "expected a whole number, got one that is not finite"),
    (r"^Exceeds the limit \(\d+ digits\).*", "a number in it is too large"),
    (r"^(too many|not enough) values to unpack.*", "a list in it is of a wrong length"),
    (r"^(VSIFReadL\(|Read of \d+ bytes).* failed.*", "the file ends too early"),
    (r"\b0x[0-9a-fA-F]{6,}", "..."),
    (r"^<urlopen error (?:\[Errno -?\d+\] )?(.*)>$", r"\1"),
    (r".*do not form a closed linestring.*", "a ring is not closed: its last point is not its first"),
)


def shown(value: object, quoted: bool = True) -> str:
    """Format a wrong value for a message: its representation, or the text itself, shortened.

    Examples
    --------
    >>> shown("a" * 100), shown(3)
    ("'aaaaaaaaaaaaaaaaaa ... aaaaaaaaaaaaaaa'", '3')
    """
    try:
        text = repr(value) if quoted else str(value)
    except Exception:  # a huge int has no text, and a stranger's object may raise anything
        text = f"a value of type {type(value).__name__}"
    return one_line(" ".join(text.split()), 40 if len(text) > 60 else 60)


def joined(names: Sequence[str]) -> str:
    """Return names as a sentence lists them: "a", "a and b", or "a, b and c"."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def first_of(texts: Sequence[object], most: int, what: str = "") -> str:
    """List the first of some texts, and how many more of `what` there are."""
    more = f" and {len(texts) - most} more{what}" if len(texts) > most else ""
    return ", ".join(map(str, texts[:most])) + more


def _shortened(text: str, max_length: int) -> str:
    if len(text) <= max_length:
        return text
    tail = min(_TAIL, max_length * 2 // 5)
    return f"{text[: max_length - tail - 5]} ... {text[-tail:]}"
