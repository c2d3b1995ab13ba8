"""Processes in the background: started by the dock, ended when their answer is not needed any more."""

from __future__ import annotations

from collections.abc import Sequence

from qgis.PyQt.QtCore import QObject, QProcess, QTimer, pyqtSignal

from .process import TERMINATE_MS, Finished, Lines, clean_environment, end_process


class BackgroundRun(QObject):
    """One process at a time; a new one ends the one before, whose answer is dropped.

    Signals
    -------
    progressed : int
        Per cent.
    succeeded : Finished
    failed : str
        What the program says of its error.
    """

    progressed = pyqtSignal(int)
    succeeded = pyqtSignal(object)
    failed = pyqtSignal(str)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._process: QProcess | None = None
        self._ending: list[QProcess] = []
        self._errors, self._output = Lines(self), Lines(None)

    @property
    def is_running(self) -> bool:
        """Whether a process is at work."""
        return self._process is not None

    def start(self, program: str, arguments: Sequence[str]) -> None:
        """Start a process; the one before is ended."""
        self.cancel()
        process = QProcess(self)
        self._errors, self._output = Lines(self), Lines(None)
        process.setProcessEnvironment(clean_environment())
        process.readyReadStandardError.connect(self._read)
        process.readyReadStandardOutput.connect(self._read)
        process.finished.connect(self._ended)
        process.errorOccurred.connect(self._not_started)
        self._process = process
        process.start(program, list(arguments))
        process.closeWriteChannel()

    def cancel(self) -> None:
        """End the process that is at work, if there is one, without waiting for it; no signal follows."""
        process, self._process = self._process, None
        if process is None:
            return
        for signal in (process.finished, process.errorOccurred):
            signal.disconnect()
        self._ending.append(process)
        process.finished.connect(lambda: self._forget(process))
        process.terminate()
        kill = QTimer(process)  # deleted with the process
        kill.setSingleShot(True)
        kill.timeout.connect(process.kill)
        kill.start(TERMINATE_MS)

    def stop(self) -> None:
        """End the process and wait until it has ended, within a second; no signal follows."""
        self.cancel()
        for process in list(self._ending):
            end_process(process)

    def _forget(self, process: QProcess) -> None:
        self._ending.remove(process)
        process.deleteLater()

    def setProgress(self, share: float) -> None:
        """A share in per cent, as `Lines` reports it."""
        self.progressed.emit(int(share))

    def pushWarning(self, text: str) -> None:
        """A warning is in the lines of the answer."""

    def pushInfo(self, text: str) -> None:
        """A message is in the lines of the answer."""

    def _read(self) -> None:
        if self._process is not None:
            self._errors.take(bytes(self._process.readAllStandardError()))
            self._output.take(bytes(self._process.readAllStandardOutput()))

    def _ended(self, code: int, status: QProcess.ExitStatus) -> None:
        self._read()
        self._errors.end()
        self._output.end()
        process, self._process = self._process, None
        if process is not None:
            process.deleteLater()
        finished = Finished(code, self._output.text, tuple(self._errors.lines))
        if status == QProcess.ExitStatus.CrashExit:
            self.failed.emit("uavseg was ended from outside, or crashed; the memory may not have sufficed")
        elif code:
            self.failed.emit(finished.error())
        else:
            self.succeeded.emit(finished)

    def _not_started(self, error: QProcess.ProcessError) -> None:
        if error == QProcess.ProcessError.FailedToStart and self._process is not None:
            process, self._process = self._process, None
            self.failed.emit(f"{process.program()} does not start: {process.errorString()}")
            process.deleteLater()
