"""File system calls of the outputs: sync, rename without replacing, lock; a record of what was written."""

import errno
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import field
from pathlib import Path

from uavseg.dataclass import dataclass
from uavseg.errors import OutputError

_MAX_NAMES = 8


@dataclass(slots=True)
class Written:
    """Outputs of a command so far."""

    files: list[str] = field(default_factory=list)  # complete outputs
    unfinished: list[str] = field(default_factory=list)  # streams of which a part may have been written
    kept: list[str] = field(default_factory=list)  # folders of finished tiles
    planned: list[str] = field(default_factory=list)  # outputs of a run over many sources
    ended: str = ""  # the meaning of the end of a command that writes no file

    def __str__(self) -> str:
        """Return one clause, such as "nothing was written"."""
        nothing = self.ended or "nothing was written"
        were = "was" if len(self.files) == 1 else "were"
        parts = [f"{_named(self.files)} {were} written" if self.files else nothing]
        if missing := [name for name in self.planned if name not in set(self.files)]:
            parts.append(f"{len(missing):,} of {len(self.planned):,} outputs were not: {_named(missing)}")
        if self.unfinished:
            parts = [*(parts if self.files else parts[1:]), f"{', '.join(self.unfinished)} may be incomplete"]
        if self.kept:
            parts.append(f"finished tiles are kept in {', '.join(dict.fromkeys(self.kept))}")
        return "; ".join(parts)


_current: ContextVar[Written | None] = ContextVar("written", default=None)


@contextmanager
def recording_written() -> Iterator[Written]:
    """Record what is written."""
    written = Written()
    token = _current.set(written)
    try:
        yield written
    finally:
        _current.reset(token)


def written_here() -> Written:
    """Return the record in which outputs are noted; one that nobody reads where none is kept."""
    return _current.get() or Written()


@contextmanager
def noted_stream(name: str) -> Iterator[None]:
    """Note a stream as incomplete while it is written to."""
    written = written_here()
    written.unfinished.append(name)
    yield
    written.unfinished.remove(name)
    written.files.append(name)


def _named(names: list[str]) -> str:
    """List names; of many, the first ones and the last."""
    if len(names) <= _MAX_NAMES:
        return ", ".join(names)
    return f"{', '.join(names[:2])} ... {names[-1]} ({len(names):,} files)"


LOCK_TIMEOUT_S = 10.0  # how long others may take to rename their files
_LOCK_RETRY_S = 0.02

_NO_LINKS = {  # of FAT, of shares, of AFS between two folders
    *(errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK, errno.EINVAL, errno.EXDEV)
}
_NO_SYNC = {errno.EINVAL, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS}
_NO_FOLDER_SYNC = {*_NO_SYNC, errno.EACCES, errno.EPERM, errno.EBADF, errno.EISDIR}


def put_new(source: Path, place: Path) -> None:
    """Move a file or a folder to a name that must be free, on the same file system.

    A hard link is made, which fails where the name exists, and the old name removed. File systems without
    hard links (FAT) are asked whether the name is free before the file is renamed.
    """
    if os.name == "nt":
        source.rename(place)  # does not replace there
        return
    if source.is_dir():
        place.mkdir()  # fails where the name exists; an empty folder is replaced by a renamed one
        source.replace(place)
        return
    try:
        os.link(source, place, follow_symlinks=False)
    except OSError as error:
        if error.errno not in _NO_LINKS:
            raise
        if os.path.lexists(place):
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(place)) from error
        source.rename(place)
        return
    source.unlink()


def sync_all_in(folder: Path) -> None:
    """Sync every file and folder inside a folder to disk, the innermost first."""
    for path, folders, files in os.walk(folder, topdown=False):
        for name in files:
            sync_file(Path(path, name))
        for name in folders:
            sync_folder(Path(path, name))


def sync_file(file: Path) -> None:
    """Sync a file to disk, unless the file system has no such call."""
    _sync(os.open(file, os.O_RDWR), _NO_SYNC)  # Windows only syncs what is open for writing


def sync_folder(folder: Path) -> None:
    """Sync the names in a folder to disk; Windows and some network shares cannot, and are left alone."""
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError as error:
        if error.errno not in _NO_FOLDER_SYNC:
            raise
        return
    _sync(descriptor, _NO_FOLDER_SYNC)


def _sync(descriptor: int, excused: set[int]) -> None:
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in excused:
            raise
    finally:
        os.close(descriptor)


def try_lock(descriptor: int) -> bool | None:
    """Lock an open file until this process ends; False if another has the lock, None without locks."""
    try:
        _lock(descriptor)
    except BlockingIOError:
        return False
    except OSError:
        return None  # the file system has no locks
    return True


@contextmanager
def locked_folder(folder: Path) -> Iterator[None]:
    """Keep other runs from renaming files in a folder; without effect where folders have no locks."""
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError:  # Windows does not open folders; or the folder may be written to and not read
        yield
        return
    try:
        end = time.monotonic() + LOCK_TIMEOUT_S
        while try_lock(descriptor) is False:
            if time.monotonic() > end:
                raise OutputError(f"another program has locked the folder {folder}; try again when it ended")
            time.sleep(_LOCK_RETRY_S)
        yield
    finally:
        os.close(descriptor)


try:
    import fcntl

    def _lock(descriptor: int) -> None:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)

except ImportError:  # Windows
    import msvcrt

    def _lock(descriptor: int) -> None:
        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
        except PermissionError as error:
            raise BlockingIOError from error
