"""Jobs of a local server: one at a time, with progress, stopped on request; the last results are kept."""

import threading
from collections import OrderedDict
from collections.abc import Callable
from contextvars import copy_context
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from uavseg.errors import UavsegError
from uavseg.execution.executors import Progress
from uavseg.output.written import recording_written
from uavseg.plain_text import printable

KEPT = 20
STOPPING_S = 5.0  # a job stops at its next step; its files are deleted after it


class BusyError(UavsegError, RuntimeError):
    """A job is running already."""


class StoppedError(Exception):
    """The job was stopped on request."""


@dataclass
class Task:
    """A job, and what came of it.

    Parameters
    ----------
    number : int
    folder : Path
        Where its files are.
    state : "running", "done", "failed" or "stopped"
    done, total : int
        Progress.
    error : str
    answer : Any
        Values of JSON.
    files : dict of str to Path
        By their names.
    """

    number: int
    folder: Path
    state: str = "running"
    done: int = 0
    total: int = 0
    error: str = ""
    answer: Any = None
    files: dict[str, Path] = field(default_factory=dict)
    stop: threading.Event = field(default_factory=threading.Event)

    def progress(self, done: int, total: int) -> None:
        """Note the progress; raises where the job is to stop."""
        if self.stop.is_set():
            raise StoppedError
        self.done, self.total = done, total

    def report(self) -> dict[str, Any]:
        """State, progress and result as values of JSON."""
        return {
            "job": self.number,
            "state": self.state,
            "done": self.done,
            "total": self.total,
            "error": self.error,
            "answer": self.answer,
            "files": sorted(self.files),
        }


Job = Callable[[Path, Progress], tuple[Any, dict[str, Path]]]
"""Folder for files, and progress -> answer as values of JSON, files by name."""


class Tasks:
    """Runs one job at a time in a thread of its own.

    Parameters
    ----------
    folder : Path
        For the files of all jobs.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._lock = threading.Lock()
        self._count = 0
        self._running: threading.Thread | None = None
        self._tasks: OrderedDict[int, Task] = OrderedDict()

    def begin(self, job: Job) -> Task:
        """Begin a job.

        Raises
        ------
        BusyError
            If one is running.
        """
        with self._lock:
            if any(task.state == "running" for task in self._tasks.values()):
                raise BusyError("a job is running; wait for it, or stop it")
            self._count += 1
            folder = self._folder / str(self._count)
            folder.mkdir()
            task = self._tasks[self._count] = Task(self._count, folder)
            while len(self._tasks) > KEPT:
                self._forget(self._tasks.popitem(last=False)[1])
            context = copy_context()
            self._running = threading.Thread(target=context.run, args=(_run, task, job), daemon=True)
            self._running.start()
        return task

    def find(self, number: int) -> Task | None:
        """A job that is kept."""
        with self._lock:
            return self._tasks.get(number)

    def stop_all(self) -> None:
        """Ask the job that runs to stop, and wait for it, for some seconds at most."""
        with self._lock:
            for task in self._tasks.values():
                task.stop.set()
        if self._running is not None:
            self._running.join(STOPPING_S)

    @staticmethod
    def _forget(task: Task) -> None:
        import shutil

        shutil.rmtree(task.folder, ignore_errors=True)


def _run(task: Task, job: Job) -> None:
    try:
        with recording_written():  # its files are not those of the command
            task.answer, task.files = job(task.folder, task.progress)
        task.state = "done"
    except StoppedError:
        task.error, task.state = "stopped", "stopped"
    except UavsegError as error:
        task.error, task.state = printable(str(error)), "failed"
    except BaseException:
        task.error, task.state = "the program failed; its log says how", "failed"
        raise
