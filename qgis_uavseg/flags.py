"""Messages of the program with labels of fields of a dialog in place of flags of the command line."""

from __future__ import annotations

import re
from collections.abc import Mapping

_TYPED = re.compile(r"(\buavseg [a-z][a-z-]*(?: --[a-z][\w-]*(?:=\S+)?)+)")
_FLAG = re.compile(
    r"(?<![\w./\\-])(?P<quote>['\"`]?)(?P<flag>--[A-Za-z]\w*(?:-\w+)*|-[A-Za-z])(?![\w-]|[./]\w)(?P<is>=?)(?P=quote)"
)
_IN_PYTHON = re.compile(r"(?P<typed>(?P<flag>--[a-z]\w*(?:-\w+)*)(?: [^\s()]+)?) \((?P<name>\w+)=[^()]*\)")
_TWICE = re.compile(r"(“[^”]*”)(?: ?[/,] \1)+")
_UNIT = re.compile(r" \([^()]*\)$")


def field_name(label: str) -> str:
    """Return the name of a field as messages have it: in quotes, without the unit behind it.

    >>> field_name("Smallest area (m², or pixels as 50px)")
    '“Smallest area”'
    """
    return f"“{_UNIT.sub('', label)}”"


def in_dialog(text: str, fields: Mapping[str, str]) -> str:
    """Replace the flags in a message by the fields of a dialog.

    A flag that the dialog has no field for stays, and the message says so at its end. A command that the
    message tells to type, such as `uavseg divide --flatten`, stays without a remark.

    Parameters
    ----------
    text : str
    fields : mapping of str to str
        What to write for a flag, such as “Smallest area” for --min-area.

    Examples
    --------
    >>> in_dialog("'--min-area' is 3; try --tile 64", {"--min-area": "“Smallest area”"})
    '“Smallest area” is 3; try --tile 64 (--tile is an option of the command line, not of this dialog)'
    """
    absent: dict[str, None] = {}

    def shown(found: re.Match[str]) -> str:
        flag = found["flag"]
        positive = flag.replace("--no-", "--", 1)
        if flag not in fields and positive not in fields:
            if flag.startswith("--"):
                absent[flag] = None
            return found[0]
        name = fields[flag] if flag in fields else f"{fields[positive]} off"
        return f"{name} " if found["is"] else name

    pieces = _TYPED.split(text)  # every second one is a command
    for k in range(0, len(pieces), 2):
        piece = _IN_PYTHON.sub(lambda found: _without_python(found, fields), pieces[k])
        pieces[k] = _TWICE.sub(r"\1", _FLAG.sub(shown, piece))
    said = "".join(pieces)
    remark = _remark(list(absent))
    return said if said.endswith(remark) else f"{said}{remark}"


def _without_python(found: re.Match[str], fields: Mapping[str, str]) -> str:
    """Leave out the argument of Python that a message has behind a flag: --nodata 0 (nodata=0)."""
    same = found["flag"][2:].replace("-", "_") == found["name"]
    return found["typed"] if same and found["flag"] in fields else found[0]


def _remark(flags: list[str]) -> str:
    if not flags:
        return ""
    *others, last = flags
    subject = f"{', '.join(others)} and {last} are options" if others else f"{last} is an option"
    return f" ({subject} of the command line, not of this dialog)"
