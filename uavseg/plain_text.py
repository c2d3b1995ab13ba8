"""Text of messages: one printable line of bounded length, whatever a file or a library says."""

import re

MAX_MESSAGE = 500  # characters
MAX_WORD = 160
MAX_CAUSE = 200
_TAIL = 150  # of a message, which often ends with what to do


def one_line(text: object, most: int = MAX_MESSAGE) -> str:
    r"""A text as one printable line: control characters are escaped, what is too long is left out.

    Parameters
    ----------
    text : object
        Usually str.
    most : int
        Characters that are kept.

    Examples
    --------
    >>> one_line("red\x1b[31m\nfile.tif")
    'red\\x1b[31m\\nfile.tif'
    >>> one_line("a" * 1000, 20)
    'aaaaaaa ... aaaaaaaa'
    """
    line = re.sub(rf"\S{{{MAX_WORD + 1},}}", lambda word: _shortened(word[0], MAX_WORD), printable(str(text)))
    return _shortened(line, most)


def printable(text: str) -> str:
    r"""A text in which control characters are escaped, and what changes the direction of writing.

    Examples
    --------
    >>> printable("a\tb\x9b")
    'a\\tb\\x9b'
    """
    if text.isprintable():
        return text
    letters = (
        letter if letter.isprintable() else letter.encode("unicode_escape").decode() for letter in text
    )
    return "".join(letters)


def cause_of(error: BaseException) -> str:
    """The message of the first error in a chain of causes: its first sentence, as one line.

    Examples
    --------
    >>> cause_of(ValueError("Cannot read it.\\nSee the manual. It is long."))
    'Cannot read it'
    >>> cause_of(KeyError())
    'KeyError'
    """
    while error.__cause__ is not None:
        error = error.__cause__
    words = " ".join(str(getattr(error, "strerror", None) or error).split())
    sentence = re.split(r"(?<=[^.\s])\.(?=\s|$)|; (?=[A-Z])", words, maxsplit=1)[0]
    return one_line(sentence or type(error).__name__, MAX_CAUSE)


def shown(value: object) -> str:
    """A wrong value in a message: its representation, shortened.

    Examples
    --------
    >>> shown("a" * 100), shown(3)
    ("'aaaaaaaaaaaaaaaaaa ... aaaaaaaaaaaaaaa'", '3')
    """
    try:
        text = repr(value)
    except Exception:  # a huge int has no text, and a stranger's object may raise anything
        text = f"a value of type {type(value).__name__}"
    return one_line(" ".join(text.split()), 40 if len(text) > 60 else 60)


def _shortened(text: str, most: int) -> str:
    """The beginning and the end of a text that is longer than `most`."""
    if len(text) <= most:
        return text
    tail = min(_TAIL, most * 2 // 5)
    return f"{text[: most - tail - 5]} ... {text[-tail:]}"
