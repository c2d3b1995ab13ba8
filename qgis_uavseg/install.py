"""Install the program into an environment of its own, with the progress of venv and pip.

Nothing of QGIS's own Python is used or changed: the environment is made by another Python 3.11 or later.
"""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path
from typing import Any

from .process import Cancelled, ProcessError, quick_output, run
from .program import ProgramError, own_folder, program_in, requirement, version_of

OLDEST = (3, 11)
_CANDIDATES = ("python3.13", "python3.12", "python3.11", "python3", "python")
_ASK = "import sys; print(*sys.version_info[:2])"


class InstallError(Exception):
    """The program could not be installed; the text says why, and what to do."""


def find_python() -> str:
    """A Python that uavseg works with.

    Raises
    ------
    InstallError
        If there is none.
    """
    beside = [Path(sys.exec_prefix) / "python.exe", Path(sys.exec_prefix) / "bin" / "python3"]
    on_path = [shutil.which(name) for name in _CANDIDATES]
    seen = []
    for candidate in (*(path for path in on_path if path), *(str(path) for path in beside if path.is_file())):
        try:
            major, minor = map(int, quick_output(candidate, ["-I", "-c", _ASK]).split())
        except (ProcessError, ValueError):
            continue
        if (major, minor) >= OLDEST:
            return candidate
        seen.append(f"{candidate} is {major}.{minor}")
    found = f" ({', '.join(seen)})" if seen else ""
    raise InstallError(
        f"there is no Python {OLDEST[0]}.{OLDEST[1]} or later{found}; "
        "install one from python.org, then try again"
    )


def install(feedback: Any) -> Path:
    """Make the environment and install the program there; the environment that was there is replaced.

    Parameters
    ----------
    feedback : QgsFeedback
        Takes messages and progress, and may cancel.

    Returns
    -------
    program : Path

    Raises
    ------
    InstallError
        If it fails. What was there before stays.
    Cancelled
        Likewise.
    """
    folder = own_folder()
    earlier = folder.with_name("venv.earlier")
    shutil.rmtree(earlier, ignore_errors=True)
    if folder.exists():
        folder.rename(earlier)
    try:
        program = _install_in(folder, feedback)
    except (InstallError, Cancelled):
        shutil.rmtree(folder, ignore_errors=True)
        if earlier.exists():
            earlier.rename(folder)
        raise
    shutil.rmtree(earlier, ignore_errors=True)
    return program


def _install_in(folder: Path, feedback: Any) -> Path:
    python = find_python()
    feedback.setProgress(5)
    _step(python, ["-I", "-m", "venv", str(folder)], feedback, "the environment cannot be made")
    feedback.setProgress(15)
    own = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    words = ["-I", "-m", "pip", "install", "--disable-pip-version-check", "--no-input", requirement()]
    _step(str(own), words, feedback, f"pip cannot install {requirement()}")
    feedback.setProgress(95)
    program = program_in(folder)
    try:
        feedback.pushInfo(f"installed: uavseg {version_of(program)}, {program}")
    except (ProgramError, OSError) as error:
        raise InstallError(f"it was installed, but does not run: {error}") from error
    feedback.setProgress(100)
    return program


def _step(program: str, words: list[str], feedback: Any, failed: str) -> None:
    try:
        finished = run(program, words, feedback)
    except ProcessError as error:
        raise InstallError(f"{failed}: {error}") from error
    if finished.code:
        marked = [line for line in finished.lines if line.startswith("ERROR: ")]
        raise InstallError(f"{failed}: {marked[-1][7:] if marked else finished.error()}")
