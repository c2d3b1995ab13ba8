"""Cache of object files on disk: its folder, and files that are read only if they are whole and trusted.

A cached file is used only if its checksum is right, and if it belongs to the user or to root and nobody else
can write to it. Otherwise its kernel is compiled again.
"""

import contextlib
import hashlib
import os
import stat
import sys
import tempfile
from pathlib import Path

_FORMAT = b"uavseg object cache, version 1"


def cache_folder() -> Path | None:
    """Return the folder of the caches: $UAVSEG_CACHE, the user's cache folder, or else a temporary one.

    It belongs to the user or to root, and nobody else can write to it. None where no folder can be made:
    then kernels are compiled again in each process.
    """
    try:
        folder = _user_folder()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = folder.stat()
        if _owned(status) and status.st_mode & _WRITABLE_BY_OTHERS:
            folder.chmod(stat.S_IMODE(status.st_mode) & ~_WRITABLE_BY_OTHERS)
            status = folder.stat()
        if trusted(status) and os.access(folder, os.W_OK):
            return folder
    except (OSError, RuntimeError):  # a read-only home, or none
        pass
    with contextlib.suppress(OSError):
        return _temporary_folder()
    return None


def _user_folder() -> Path:
    named = os.environ.get("UAVSEG_CACHE")
    if named:
        return Path(named) / "kernels"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", tempfile.gettempdir())) / "uavseg" / "kernels"
    home = os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()
    return Path(home) / "uavseg" / "kernels"


def _temporary_folder() -> Path:
    """Return a folder under the system's temporary folder that nobody else can enter."""
    if hasattr(os, "geteuid"):
        folder = Path(tempfile.gettempdir()) / f"uavseg-{os.geteuid()}"
        with contextlib.suppress(OSError):
            folder.mkdir(mode=0o700)
        with contextlib.suppress(OSError):
            status = folder.lstat()  # of a link itself: anybody can put one there
            if stat.S_ISDIR(status.st_mode) and _owned(status) and not status.st_mode & _OPEN_TO_OTHERS:
                return folder
    global _process_folder
    if _process_folder is None:
        _process_folder = tempfile.TemporaryDirectory(prefix="uavseg-kernels-")
    return Path(_process_folder.name)


def is_temporary(folder: Path | None) -> bool:
    """Return whether what is kept in the folder of the caches ends with the process."""
    return folder is None or (_process_folder is not None and folder == Path(_process_folder.name))


_process_folder: tempfile.TemporaryDirectory[str] | None = None
_WRITABLE_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH
_OPEN_TO_OTHERS = stat.S_IRWXG | stat.S_IRWXO


def _owned(status: os.stat_result) -> bool:
    return not hasattr(os, "geteuid") or status.st_uid == os.geteuid()


def trusted(status: os.stat_result) -> bool:
    """Return whether a file or folder is the user's or root's, and nobody else can write to it."""
    if not hasattr(os, "geteuid"):
        return True
    return (_owned(status) or status.st_uid == 0) and not status.st_mode & _WRITABLE_BY_OTHERS


def read(folder: Path, name: str) -> bytes | None:
    """Return the content of a cached object file; None where it is missing, damaged or not to be trusted."""
    try:
        with open(folder / f"{name}.o", "rb", opener=_open_itself) as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode) or not trusted(status):
                return None
            version, kept, content = file.read().split(b"\n", 2)
    except (OSError, ValueError):
        return None
    return content if (version, kept) == (_FORMAT, checksum(name, content)) else None


def _open_itself(path: str, flags: int) -> int:
    """Open a file without following a link and without waiting at a pipe."""
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))


def checksum(name: str, content: bytes) -> bytes:
    """Checksum of a content under its name, so that no file stands for another."""
    return hashlib.sha256(name.encode() + b"\n" + content).hexdigest().encode()


def store(folder: Path, name: str, content: bytes) -> None:
    """Write an object file whole; not at all where there is no room: its kernel is compiled again then."""
    with contextlib.suppress(OSError):
        handle, temporary = tempfile.mkstemp(dir=folder)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(b"\n".join([_FORMAT, checksum(name, content), content]))
            Path(temporary).replace(folder / f"{name}.o")
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise
