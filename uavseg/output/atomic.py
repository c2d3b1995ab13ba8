"""Atomic output files: made in a temporary folder beside the target, synced to disk, renamed at the end.

After a crash, of the program or of the machine, each file is what it was before or the whole new one. For
the latter, files are synced (`os.fsync`) before they are renamed, and their folder afterwards. That costs two
waits for the disk, and the time in which it writes what the system still holds in memory: measured on a
virtual disk (ext4), a file of 1 MB took 16 ms instead of 4, one of 200 MB 200 ms instead of 150. A hard disk
takes longer.

Several files that belong together, and outputs of one command, appear together: see `output.transaction`.
"""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from uavseg.errors import OutputError, UavsegError
from uavseg.output.renames import recover
from uavseg.output.staging import is_staged
from uavseg.output.targets import Target, find_target, sidecars
from uavseg.output.transaction import Transaction, current_transaction, output_errors

_PROBE = 1 << 16  # bytes


def check_target(path: str | os.PathLike[str], overwrite: bool = False) -> Path:
    """Check that a file may be made, before the work whose result it holds; returns its path.

    Before that, what a killed run left in its folder is undone and removed.

    Raises
    ------
    OutputExistsError
        If it exists and `overwrite` is false, or a file that would be read as a part of it.
    OutputError
        If its folder does not exist, or what is there cannot be replaced.
    """
    return _checked(path, overwrite).given


@contextmanager
def atomic_file(path: str | os.PathLike[str], overwrite: bool = False, sync: bool = True) -> Iterator[Path]:
    """Context manager that yields a temporary path, renamed to `path` at the end if nothing was raised.

    The temporary path keeps the file name, and lies in a temporary folder beside `path`. Drivers may write
    several files (the parts of a shapefile) or a subfolder there: all of them are renamed, and files of an
    older output that a reader would take for parts of this one are removed. Inside of a `transaction`, files
    are renamed at its end.

    Parameters
    ----------
    path : path
        Of the target. Where it is a symbolic link, the file to which it points is written.
    overwrite : bool
        Whether to replace existing files.
    sync : bool
        Whether to sync the file to disk, so that it survives a power cut. Without that, it may be empty or
        torn afterwards, and is not part of a transaction: for single files that are checked when they are
        read and can be computed again.

    Raises
    ------
    OutputExistsError, OutputError
        As `check_target`, and if writing fails, as on a full disk.
    """
    if is_staged(Path(path)):
        yield Path(path)
        return
    target = _checked(path, overwrite) if sync else find_target(path, overwrite)
    outer = current_transaction() if sync else None
    files = outer or Transaction(sync)
    try:
        with output_errors(str(target.given)):
            temporary = files.add(target, overwrite)
            try:
                yield temporary
            except BaseException as error:
                reason = _no_room(temporary) if isinstance(error, UavsegError) else None
                files.drop(temporary)
                if reason is not None:
                    raise OutputError(f"{target.given} cannot be written: {reason}") from error
                raise
            if outer is None:
                files.commit()
    finally:
        if outer is None:
            files.close()


def _no_room(path: Path) -> str | None:
    """Why no more can be written to a file that is given up, or None: libraries do not report a full disk."""
    try:
        with path.open("ab") as file:
            file.write(bytes(_PROBE))
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        return error.strerror if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG) else None
    return None


def _checked(path: str | os.PathLike[str], overwrite: bool) -> Target:
    real = Path(os.path.realpath(path) if Path(path).is_symlink() else path)
    left = recover(real.parent)
    for file in (real, *sidecars(real)):
        if file.name in left:
            raise OutputError(left[file.name])
    return find_target(path, overwrite)
