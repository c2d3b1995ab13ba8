"""Advisory file locks: they end with the process that holds them, however it ends."""

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from uavseg.errors import OutputError

PATIENCE_S = 10.0  # how long others may take to rename their files
_RETRY_S = 0.02


def try_lock(descriptor: int) -> bool | None:
    """Lock an open file for this process alone.

    Returns
    -------
    locked : bool or None
        False if another holds the lock; None if files cannot be locked there.
    """
    try:
        _lock(descriptor)
    except BlockingIOError:
        return False
    except OSError:
        return None  # a file system without locks
    return True


@contextmanager
def locked_folder(folder: Path) -> Iterator[None]:
    """Context in which no other run renames files in a folder; without effect where folders have no locks.

    Raises
    ------
    OutputError
        If another process holds the lock for ten seconds.
    """
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError:  # Windows does not open folders; or the folder may be written to and not read
        yield
        return
    try:
        end = time.monotonic() + PATIENCE_S
        while try_lock(descriptor) is False:
            if time.monotonic() > end:
                raise OutputError(f"another program has locked the folder {folder}; try again when it ended")
            time.sleep(_RETRY_S)
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
