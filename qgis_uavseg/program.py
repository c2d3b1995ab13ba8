"""The program `uavseg`: where it is, which version it is, and what to type where it is missing."""

from __future__ import annotations

import os
import re
import shlex
import shutil
from pathlib import Path

from qgis.core import QgsApplication, QgsSettings

from .process import ProcessError, quick_output

VERSIONS = ((1, 0), (2, 0))
"""First version that the plugin works with, and the first that it does not."""

REQUIREMENT = "uavseg>=1.0,<2.0"
SETTING = "uavseg/program"
REQUIREMENT_SETTING = "uavseg/requirement"
VARIABLE = "UAVSEG_PROGRAM"
_VERSION = re.compile(r"^uavseg (\d+)\.(\d+)(\.\S+)?$")
_known: dict[tuple[str, int, int], str] = {}


class ProgramError(Exception):
    """The program is missing or of another version; the text says what to type."""


def own_folder() -> Path:
    """The folder of the environment that the plugin installs uavseg into, in the user's profile."""
    return Path(QgsApplication.qgisSettingsDirPath()) / "uavseg" / "venv"


def program_in(environment: Path) -> Path:
    """The program in a virtual environment."""
    return environment / ("Scripts/uavseg.exe" if os.name == "nt" else "bin/uavseg")


def requirement() -> str:
    """What pip installs: a requirement, a wheel or a folder; the option `uavseg/requirement`."""
    return str(QgsSettings().value(REQUIREMENT_SETTING, "") or "") or REQUIREMENT


def find_program() -> Path:
    """The program: of the options, of $UAVSEG_PROGRAM, of the plugin's own environment, or on the PATH.

    Raises
    ------
    ProgramError
        If there is none, or if what the options or the variable name is not a file.
    """
    named = (
        (str(QgsSettings().value(SETTING, "") or ""), "Options > UAV Segmentation"),
        (os.environ.get(VARIABLE, ""), f"${VARIABLE}"),
    )
    for text, where in named:
        if text and not Path(text).is_file():
            raise ProgramError(
                f"{text}, which {where} names as the program uavseg, is not a file; {advice()}"
            )
        if text:
            return Path(text)
    own, on_path = program_in(own_folder()), shutil.which("uavseg")
    if own.is_file():
        return own
    if on_path:
        return Path(on_path)
    raise ProgramError(f"the program uavseg was not found; {advice()}")


def version_of(program: Path) -> str:
    """What `uavseg --version` says, such as 1.0.0; asked once for each state of the file.

    Raises
    ------
    ProgramError
        If it cannot be run, or is another program.
    """
    state = program.stat()
    key = (str(program), state.st_mtime_ns, state.st_size)
    if key not in _known:
        try:
            line = quick_output(str(program), ["--version"])
        except ProcessError as error:
            raise ProgramError(f"{program} does not run: {error}; {advice()}") from error
        if not _VERSION.match(line):
            raise ProgramError(f"{program} is not uavseg: it says {line[:80]!r} of its version; {advice()}")
        _known[key] = line.split(" ", 1)[1]
    return _known[key]


def ready_program() -> Path:
    """The program, of a version that the plugin works with.

    Raises
    ------
    ProgramError
        As of `find_program` and `version_of`, and if the version is another.
    """
    program = find_program()
    version = version_of(program)
    first, end = VERSIONS
    parts = version.split(".")
    if not first <= (int(parts[0]), int(parts[1])) < end:
        raise ProgramError(
            f"{program} is uavseg {version}; this plugin works with {_dotted(first)} or later, "
            f"before {_dotted(end)}; {advice()}"
        )
    return program


def advice() -> str:
    """One line that installs the program where the plugin looks for it, and where the button is."""
    folder = own_folder()
    python = "py -3" if os.name == "nt" else "python3"
    line = (
        f"{python} -m venv {_quoted(folder)} && {_quoted(_pip_in(folder))} install {_quoted(requirement())}"
    )
    return f"type: {line}   (or press Install in Plugins > UAV Segmentation; a path can be set in Options)"


def _pip_in(environment: Path) -> Path:
    return environment / ("Scripts/pip.exe" if os.name == "nt" else "bin/pip")


def _quoted(text: object) -> str:
    return f'"{text}"' if os.name == "nt" else shlex.quote(str(text))


def _dotted(version: tuple[int, int]) -> str:
    return ".".join(map(str, version))
