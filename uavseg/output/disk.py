"""File system calls of the outputs: sync to disk, and rename without replacing."""

import errno
import os
from pathlib import Path

_NO_LINKS = {  # of FAT, of shares, of AFS between two folders
    *(errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK, errno.EINVAL, errno.EXDEV)
}
_NO_SYNC = {errno.EINVAL, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS}
_NO_FOLDER_SYNC = {*_NO_SYNC, errno.EACCES, errno.EPERM, errno.EBADF, errno.EISDIR}


def put_new(source: Path, place: Path) -> None:
    """Move a file or a folder to a name that must be free, on the same file system.

    A hard link is made, which fails where the name exists, and the old name removed. File systems without
    hard links (FAT) are asked whether the name is free before the file is renamed.

    Raises
    ------
    FileExistsError
        If the name exists.
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
    descriptor = os.open(file, os.O_RDWR)  # Windows only syncs what is open for writing
    _sync(descriptor, _NO_SYNC)


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
