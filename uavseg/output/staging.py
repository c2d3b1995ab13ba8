"""Staging folders: hidden folders beside the targets, in which a run makes its files before renaming them."""

import os
import shutil
import stat
import tempfile
from dataclasses import dataclass
from pathlib import Path

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
        else:
            shutil.rmtree(self.folder, ignore_errors=True)
            os.close(self.lock)

    def leave(self) -> None:
        """Give the folder up as it is; a later run finds it."""
        _open_stages.discard(os.path.realpath(self.folder))
        os.close(self.lock)


def has_stages() -> bool:
    """Return whether this process makes an output."""
    return bool(_open_stages)


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
    """Lock a file in a staging folder; returns its descriptor and the result of `try_lock`.

    Another run may lock and remove a new folder before this one locks it, so the lock counts only if its file
    still exists afterwards.
    """
    name = folder / _LOCK
    lock = os.open(name, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o600)
    locked = try_lock(lock)
    return lock, locked and _is_same(lock, name)


def _is_same(descriptor: int, name: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), name.stat(follow_symlinks=False))
    except FileNotFoundError:
        return False
