"""Staging folders: hidden folders beside the targets, in which a run makes files; signals wait for renames.

Python handles a signal when the main thread runs Python, which it does not while a library works there. A
program that `ends_by_signals` ends all the same: see `cli.terminal.stop`.
"""

import os
import shutil
import signal
import stat
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from uavseg.dataclass import dataclass
from uavseg.errors import OutputError
from uavseg.output.disk import try_lock

PREFIX = ".uavseg-"
_LOCK = "lock"
_ATTEMPTS = 100
_open_stages: set[str] = set()  # real paths of the staging folders of this process


@dataclass(slots=True)
class Stage:
    """A staging folder of this run, locked as long as the run lives."""

    folder: Path
    home: Path  # in which it lies, and into which its files are renamed
    lock: int  # descriptor of the locked file in it
    parts: int = 0

    @classmethod
    def make(cls, home: Path) -> "Stage":
        """Make a staging folder in a folder; raises OutputError where that cannot be written to."""
        try:
            for _ in range(_ATTEMPTS):
                folder = Path(tempfile.mkdtemp(prefix=PREFIX, dir=home))
                try:
                    lock, locked = _locked(folder)
                except FileNotFoundError:
                    continue  # another run has removed it
                except OSError:
                    folder.rmdir()
                    raise
                if locked is not False:
                    _open_stages.add(os.path.realpath(folder))
                    return cls(folder, home, lock)
                os.close(lock)
        except OSError as error:
            raise OutputError(f"{home} cannot be written to: {error.strerror}") from error
        raise OutputError(f"{home} cannot be written to: another program removes what is made there")

    def add_part(self) -> Path:
        """Make a subfolder for the files of one target."""
        folder = self.folder / str(self.parts)
        folder.mkdir()
        self.parts += 1
        return folder

    def remove(self) -> None:
        """Remove the folder with all that is in it.

        It stays locked until it is gone: another run that has just made it would lock it and lose its files.
        """
        _open_stages.discard(os.path.realpath(self.folder))
        if os.name == "nt":  # where open files are not removed
            os.close(self.lock)
        shutil.rmtree(self.folder, ignore_errors=True)
        if os.name != "nt":
            os.close(self.lock)

    def leave(self) -> None:
        """Give the folder up as it is; a later run finds it."""
        _open_stages.discard(os.path.realpath(self.folder))
        os.close(self.lock)


def remove_stages() -> None:
    """Remove what this process has made and not renamed, at its end."""
    for folder in tuple(_open_stages):
        shutil.rmtree(folder, ignore_errors=True)


def is_staged(path: Path) -> bool:
    """Return whether a path lies inside a staging folder of this process, so that it is renamed with that."""
    if not _open_stages:
        return False
    folder = os.path.realpath(path.parent)
    return any(folder == stage or folder.startswith(stage + os.sep) for stage in tuple(_open_stages))


def dead_stages(home: Path) -> list[Stage]:
    """Lock the staging folders that killed runs left in a folder, and return them."""
    try:
        with os.scandir(home) as entries:
            names = [entry.name for entry in entries if entry.name.startswith(PREFIX)]
    except OSError:  # a folder that may be written to and not read
        return []
    stages = []
    for name in sorted(names):
        folder = home / name
        if not _is_private(folder):
            continue
        try:
            lock, locked = _locked(folder)
        except OSError:
            continue  # its run has removed it, or a stranger made it
        if locked:
            stages.append(Stage(folder, home, lock))
        else:
            os.close(lock)
    return stages


def _is_private(folder: Path) -> bool:
    """Return whether a folder belongs to this user, and only this user may write into it."""
    try:
        status = folder.lstat()
    except FileNotFoundError:
        return False
    if not stat.S_ISDIR(status.st_mode):
        return False
    return os.name == "nt" or (status.st_uid == os.geteuid() and not status.st_mode & 0o022)


def _locked(folder: Path) -> tuple[int, bool | None]:
    """Lock a file in a staging folder; returns its descriptor and the result of `try_lock`."""
    # Another run may lock and remove a new folder before this one locks it, so the lock counts only if its
    # file still exists afterwards.
    name = folder / _LOCK
    lock = os.open(name, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o600)
    locked = try_lock(lock)
    return lock, locked and _is_same(lock, name)


def _is_same(descriptor: int, name: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), name.stat(follow_symlinks=False))
    except FileNotFoundError:
        return False


# Windows has no SIGHUP.
_SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
holding = threading.RLock()  # held during what must not stop half way
_ends_by_signals = False


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Delay Ctrl-C, SIGTERM, SIGHUP (the main thread gets them); the first takes effect at the end."""
    with holding:
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        came: list[int] = []

        def hold(number: int, _: Any) -> None:
            came.append(number)

        before = _set_handlers(hold)
        try:
            yield
        finally:
            _put_back(before)
            if came:
                signal.raise_signal(came[0])  # os.kill would end a process of Windows at once


@contextmanager
def ends_by_signals() -> Iterator[None]:
    """Mark a program that a signal may end at once, see `default_signals`."""
    global _ends_by_signals
    before, _ends_by_signals = _ends_by_signals, True
    try:
        yield
    finally:
        _ends_by_signals = before


@contextmanager
def default_signals() -> Iterator[None]:
    """Let signals end the program at once during a call that blocks the interpreter.

    Only in the main thread of a program (`ends_by_signals`), and not while an output is being made, which
    would be left.
    """
    is_main = threading.current_thread() is threading.main_thread()
    if not (_ends_by_signals and is_main) or _open_stages:
        yield
        return
    before = _set_handlers(signal.SIG_DFL)
    try:
        yield
    finally:
        _put_back(before)


def _set_handlers(handler: Any) -> dict[int, Any]:
    """Set a handler, and return those before it; ignored signals stay ignored."""
    return {
        number: signal.signal(number, handler)
        for number in _SIGNALS
        if signal.getsignal(number) not in (signal.SIG_IGN, None)  # None: one that Python cannot put back
    }


def _put_back(handlers: dict[int, Any]) -> None:
    for number, handler in handlers.items():
        signal.signal(number, handler)
