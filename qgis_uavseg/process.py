"""Child processes: a cleaned environment, progress and messages line by line, cancelled within a second.

QGIS sets variables for its own Python, GDAL and PROJ. A child that inherits them loads QGIS's libraries or
coordinate systems in place of its own, and fails; so they are left out.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from qgis.PyQt.QtCore import QProcess, QProcessEnvironment

STRIPPED = frozenset(
    [
        "PYTHONHOME",
        "PYTHONPATH",
        "PYTHONSTARTUP",
        "PROJ_LIB",
        "PROJ_DATA",
        "PROJ_NETWORK",
        "GDAL_DATA",
        "GDAL_DRIVER_PATH",
        "GDAL_PLUGINS_PATH",
        "OGR_DRIVER_PATH",
        "LD_LIBRARY_PATH",
        "LD_PRELOAD",
        "VIRTUAL_ENV",
        "SSL_CERT_FILE",
        "SSL_CERT_DIR",
        "QT_PLUGIN_PATH",
        "__PYVENV_LAUNCHER__",
    ]
)
_STRIPPED_PREFIX = "DYLD_"
_POLL_MS = 50
_TERMINATE_MS = 600  # together with a poll below a second
_PROGRESS = re.compile(r"^progress (\d{1,3})$")
_ERROR = re.compile(r"^(?:uavseg: error|Error): ")
_WARNING = re.compile(r"^(?:uavseg: warning|warning|note): ")


class ProcessError(Exception):
    """A process did not start, or ended with an error."""


class Cancelled(Exception):  # noqa: N818 - no error
    """The user cancelled, and the process has ended."""


@dataclass(frozen=True)
class Finished:
    """How a process ended: exit code, all of stdout, and the lines of stderr that are no progress."""

    code: int
    output: str
    lines: tuple[str, ...]

    def error(self) -> str:
        """What it says of its error: the line that is marked so, or the last five."""
        marked = [_ERROR.sub("", line) for line in self.lines if _ERROR.match(line)]
        said = " ".join(marked) or " ".join(self.lines[-5:])
        return said or f"uavseg ended with exit code {self.code} and said nothing"


def clean_environment() -> QProcessEnvironment:
    """The environment of QGIS without what is meant for QGIS's own Python, GDAL, PROJ and libraries."""
    environment = QProcessEnvironment.systemEnvironment()
    for name in environment.keys():  # noqa: SIM118 - of Qt, not a dict
        if name.upper() in STRIPPED or name.upper().startswith(_STRIPPED_PREFIX):
            environment.remove(name)
    environment.insert("PYTHONIOENCODING", "utf-8")
    return environment


def run(program: str, arguments: Sequence[str], feedback: Any, show_output: bool = True) -> Finished:
    """Run a process until it ends, with its progress and messages in the feedback.

    Parameters
    ----------
    program : str
    arguments : sequence of str
    feedback : QgsProcessingFeedback
    show_output : bool
        Whether lines on stdout are messages, too.

    Returns
    -------
    finished : Finished

    Raises
    ------
    ProcessError
        If it does not start, or crashes.
    Cancelled
    """
    feedback.pushCommandInfo(shlex.join([program, *arguments]))
    process = _started(program, arguments)
    errors, output = _Lines(feedback), _Lines(feedback if show_output else None)
    while process.state() != QProcess.ProcessState.NotRunning:
        process.waitForFinished(_POLL_MS)
        errors.take(bytes(process.readAllStandardError()))
        output.take(bytes(process.readAllStandardOutput()))
        if feedback.isCanceled():
            _end(process)
            raise Cancelled
    errors.end()
    output.end()
    if process.exitStatus() == QProcess.ExitStatus.CrashExit:
        raise ProcessError(f"{program} was ended from outside, or crashed; the memory may not have sufficed")
    return Finished(process.exitCode(), output.text, tuple(errors.lines))


def quick_output(program: str, arguments: Sequence[str], timeout_ms: int = 30_000) -> str:
    """What a process that ends soon prints on stdout, stripped.

    Raises
    ------
    ProcessError
        If it does not start, takes longer than the timeout, or ends with an error.
    """
    process = _started(program, arguments)
    if not process.waitForFinished(timeout_ms):
        _end(process)
        raise ProcessError(f"it gave no answer within {timeout_ms / 1000:g} s")
    if process.exitStatus() == QProcess.ExitStatus.CrashExit or process.exitCode():
        said = bytes(process.readAllStandardError()).decode("utf-8", "replace").strip().splitlines()
        raise ProcessError(said[-1] if said else f"it ended with exit code {process.exitCode()}")
    return bytes(process.readAllStandardOutput()).decode("utf-8", "replace").strip()


def _started(program: str, arguments: Sequence[str]) -> QProcess:
    process = QProcess()
    process.setProcessEnvironment(clean_environment())
    process.start(program, list(arguments))
    if not process.waitForStarted(10_000):
        raise ProcessError(f"{program} does not start: {process.errorString()}")
    process.closeWriteChannel()
    return process


def _end(process: QProcess) -> None:
    """End a process: asked first, so that it can tidy up, then killed."""
    process.terminate()
    if not process.waitForFinished(_TERMINATE_MS):
        process.kill()
        process.waitForFinished(2000)


class _Lines:
    """Lines out of a stream of bytes, each shown as what it is."""

    def __init__(self, feedback: Any | None) -> None:
        self._feedback = feedback
        self._rest = b""
        self._text: list[str] = []
        self.lines: list[str] = []

    @property
    def text(self) -> str:
        """All that was taken."""
        return "".join(self._text)

    def take(self, data: bytes) -> None:
        *whole, self._rest = (self._rest + data).split(b"\n")
        for line in whole:
            self._show(line.decode("utf-8", "replace") + "\n")

    def end(self) -> None:
        if self._rest:
            self._show(self._rest.decode("utf-8", "replace"))
        self._rest = b""

    def _show(self, text: str) -> None:
        self._text.append(text)
        line = text.rstrip("\r\n")
        progress = _PROGRESS.match(line)
        if not progress and line:
            self.lines.append(line)
        if self._feedback is None:
            return
        if progress:
            self._feedback.setProgress(int(progress.group(1)))
        elif _WARNING.match(line):
            self._feedback.pushWarning(_WARNING.sub("", line))
        elif line and not _ERROR.match(line):  # an error ends the algorithm, and is said there
            self._feedback.pushInfo(line)
