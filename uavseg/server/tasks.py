"""Job queue of a local server: one job at a time, with progress and stop; the last results are kept."""

import shutil
import threading
from collections import OrderedDict
from collections.abc import Callable
from contextvars import copy_context
from dataclasses import field
from pathlib import Path
from typing import Any

from uavseg.dataclass import dataclass
from uavseg.errors import UavsegError
from uavseg.execution.executors import Progress
from uavseg.output.disk import recording_written
from uavseg.plain_text import printable

KEPT = 20
_STOPPING_S = 5.0  # a job stops at its next step; its files are deleted after it


class BusyError(UavsegError, RuntimeError):
    """Another job is running."""


class StoppedError(Exception):
    """Stop of a job on request."""


@dataclass
class Task:
    """A job and its result."""

    number: int
    folder: Path  # of its files
    state: str = "running"  # or "done", "failed" or "stopped"
    done: int = 0
    total: int = 0
    error: str = ""
    answer: Any = None  # values of JSON
    files: dict[str, Path] = field(default_factory=dict)  # by their names
    stop: threading.Event = field(default_factory=threading.Event)

    def progress(self, done: int, total: int) -> None:
        """Note the progress; raises StoppedError where the job is to stop."""
        if self.stop.is_set():
            raise StoppedError
        self.done, self.total = done, total

    def report(self) -> dict[str, Any]:
        """Return state, progress and result as values of JSON."""
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
    """Queue that runs one job at a time in another thread; the folder is for the files of all jobs."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._lock = threading.Lock()
        self._count = 0
        self._running: threading.Thread | None = None
        self._tasks: OrderedDict[int, Task] = OrderedDict()

    def begin(self, job: Job) -> Task:
        """Begin a job; BusyError if one is running."""
        with self._lock:
            if any(task.state == "running" for task in self._tasks.values()):
                raise BusyError("a job is running; wait for it, or stop it")
            self._count += 1
            folder = self._folder / str(self._count)
            folder.mkdir()
            task = self._tasks[self._count] = Task(self._count, folder)
            while len(self._tasks) > KEPT:
                shutil.rmtree(self._tasks.popitem(last=False)[1].folder, ignore_errors=True)
            context = copy_context()
            self._running = threading.Thread(target=context.run, args=(_run, task, job), daemon=True)
            self._running.start()
        return task

    def find(self, number: int) -> Task | None:
        """Return a job that is kept."""
        with self._lock:
            return self._tasks.get(number)

    def stop_all(self) -> None:
        """Stop the running job, and wait for it, for some seconds at most."""
        with self._lock:
            for task in self._tasks.values():
                task.stop.set()
        if self._running is not None:
            self._running.join(_STOPPING_S)


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
