"""Names of outputs from the names of inputs: templates such as ``out/{stem}.gpkg``."""

import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path, PurePath

from uavseg.errors import OutputError

_PLACE = re.compile(r"\{\{|\}\}|\{([^{}]*)\}|[{}]")
_WORDS = "{stem}, {name}, {suffix}, {parent} or {number}"


def fill_template(template: str, source: str, number: int = 1) -> str:
    """The name of the output of a source.

    Parameters
    ----------
    template : str
        ``{stem}`` is the name of the source without folder and extension, ``{name}`` with its extension,
        ``{suffix}`` the extension without point, ``{parent}`` the name of its folder, and ``{number}`` its
        place in the list, from 0001; ``{{`` and ``}}`` are braces.
    source : str
    number : int

    Raises
    ------
    OutputError
        If the template has another word in braces, or a brace alone.

    Examples
    --------
    >>> fill_template("out/{parent}-{stem}.gpkg", "sheets/a.tif")
    'out/sheets-a.gpkg'
    >>> fill_template("{steam}.gpkg", "a.tif")
    Traceback (most recent call last):
    uavseg.errors.OutputError: {steam}.gpkg: {steam} is unknown; write {stem}, {name}, {suffix}, ...
    """
    path = PurePath(source)
    words = {
        "stem": path.stem,
        "name": path.name,
        "suffix": path.suffix.removeprefix("."),
        "parent": path.parent.name or Path(os.path.abspath(source)).parent.name,  # noqa: PTH100 - keeps links
        "number": f"{number:04d}",
    }

    def replaced(found: re.Match[str]) -> str:
        if found[0] in ("{{", "}}"):
            return found[0][0]
        if found[1] not in words:
            raise OutputError(f"{template}: {found[0]} is unknown; write {_WORDS}, and {{{{ for a brace")
        return words[found[1]]

    return _PLACE.sub(replaced, template)


def outputs_of(template: str, sources: Sequence[str]) -> list[str]:
    """The output of each source, by a template.

    Raises
    ------
    OutputError
        If the template is wrong.
    """
    return [fill_template(template, source, number) for number, source in enumerate(sources, start=1)]


def check_own_names(sources: Sequence[str], outputs: Iterable[Sequence[str]]) -> None:
    """Check that no two outputs have the same name.

    Parameters
    ----------
    sources : sequence of str
    outputs : iterable of sequences of str
        Those of each source.

    Raises
    ------
    OutputError
        If two have, with the sources of both.
    """
    owners: dict[str, str] = {}
    for source, names in zip(sources, outputs, strict=True):
        for name in names:
            key = os.path.normcase(os.path.realpath(name))
            if key in owners:
                raise OutputError(
                    f"{owners[key]} and {source} would both be written to {name}; give each an output of its "
                    f"own with {_WORDS} in the name"
                )
            owners[key] = source
