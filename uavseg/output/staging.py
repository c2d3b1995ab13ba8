"""Staging folders: hidden folders beside the targets, in which a run makes its files before renaming them."""

import os
import shutil
import stat
import tempfile
from dataclasses import dataclass
from pathlib import Path

from uavseg.errors import OutputError
from uavseg.output.locks import try_lock

PREFIX = ".uavseg-"
_LOCK = "lock"
_ATTEMPTS = 100
_open_stages: set[str] = set()  # real paths of the staging folders of this process


@dataclass(slots=True)
class Stage:
    """A staging folder of this run, locked as long as the run lives.

    Parameters
    ----------
    folder : Path
    home : Path
        The folder beside whose files it lies, and into which its files are renamed.
    lock : int
        Descriptor of the locked file in it.
    """

    folder: Path
    home: Path
    lock: int
    parts: int = 0

    @classmethod
    def make(cls, home: Path) -> "Stage":
        """A new staging folder in a folder.

        Raises
        ------
        OutputError
            If the folder cannot be written to.
        """
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
        """A new subfolder, for the files of one target."""
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
    """Whether this process makes an output."""
    return bool(_open_stages)


def remove_stages() -> None:
    """Remove what this process has made and not renamed, at its end."""
    for folder in tuple(_open_stages):
        shutil.rmtree(folder, ignore_errors=True)


def is_staged(path: Path) -> bool:
    """Whether a path lies inside a staging folder of this process, so that it is renamed with that."""
    if not _open_stages:
        return False
    folder = os.path.realpath(path.parent)
    return any(folder == stage or folder.startswith(stage + os.sep) for stage in tuple(_open_stages))


def dead_stages(home: Path) -> list[Stage]:
    """Staging folders in a folder that runs left which were killed, locked for this process."""
    try:
        with os.scandir(home) as entries:
            names = [entry.name for entry in entries if entry.name.startswith(PREFIX)]
    except OSError:  # a folder that may be written to and not be read: what is in it cannot be told
        return []
    found = []
    for name in sorted(names):
        folder = home / name
        if not _is_own(folder):
            continue
        try:
            lock, locked = _locked(folder)
        except OSError:
            continue  # its run has removed it, or a stranger made it
        if locked:
            found.append(Stage(folder, home, lock))
        else:
            os.close(lock)
    return found


def _is_own(folder: Path) -> bool:
    """Whether a folder belongs to this user, and only this user may write into it."""
    try:
        about = folder.lstat()
    except FileNotFoundError:
        return False
    if not stat.S_ISDIR(about.st_mode):
        return False
    return os.name == "nt" or (about.st_uid == os.geteuid() and not about.st_mode & 0o022)


def _locked(folder: Path) -> tuple[int, bool | None]:
    """Lock a staging folder.

    Another run may lock and remove a new folder before this one locks it, so the lock is of use only if its
    file is still there afterwards.

    Returns
    -------
    lock : int
        Descriptor of the file in it that is locked.
    locked : bool or None
        False if another run holds the lock or has removed the file; None if files cannot be locked there.
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
