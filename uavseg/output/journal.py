"""Journal of a staging folder: which files are renamed in which order, so that a later run can undo it."""

import json
import os
import stat
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from uavseg.output.disk import sync_file, sync_folder

OLD = "old"  # the subfolder of files that are replaced
_NAME = "journal"
_MAX_BYTES = 1 << 20
_VERSION = 1


class JournalError(ValueError):
    """There is a journal, and it is damaged or not one of this program."""


@dataclass(frozen=True, slots=True)
class NewFile:
    """A file or folder that gets its name, and what tells it from another of that name.

    Parameters
    ----------
    folder : str
        The subfolder of the staging folder in which it was made.
    name : str
    inode, size, mtime_ns : int
        A folder has neither size nor time: they are 0.
    """

    folder: str
    name: str
    inode: int
    size: int
    mtime_ns: int

    @classmethod
    def of(cls, path: Path) -> "NewFile":
        """A file or folder in a subfolder of the staging folder."""
        about = path.lstat()
        size, mtime_ns = (0, 0) if stat.S_ISDIR(about.st_mode) else (about.st_size, about.st_mtime_ns)
        return cls(path.parent.name, path.name, about.st_ino, size, mtime_ns)

    def is_at(self, place: Path) -> bool:
        """Whether that is this very file, unchanged."""
        if not os.path.lexists(place):
            return False
        found = NewFile.of(place)
        return (found.inode, found.size, found.mtime_ns) == (self.inode, self.size, self.mtime_ns)


@dataclass(frozen=True, slots=True)
class Journal:
    """The renames between a staging folder and the folder in which it lies.

    Parameters
    ----------
    old : tuple of str
        Names that are moved into the subfolder `old`, main files first.
    new : tuple of NewFile
        Files that are moved out of the staging folder afterwards, main files last.
    """

    old: tuple[str, ...]
    new: tuple[NewFile, ...]

    def write(self, stage: Path) -> None:
        """Write it to a staging folder; it is there whole, and on the disk, or not at all."""
        (stage / OLD).mkdir()
        temporary = stage / f"{_NAME}.new"
        temporary.write_text(json.dumps({"version": _VERSION, **asdict(self)}), encoding="utf-8")
        sync_file(temporary)
        temporary.replace(stage / _NAME)
        sync_folder(stage)


def read_journal(stage: Path) -> Journal | None:
    """The journal of a staging folder, None if there is none.

    A stranger may have made the folder, as by an archive that was unpacked. So only plain names are accepted,
    in subfolders that are no symbolic links, and only a regular file is read.

    Raises
    ------
    JournalError
        If there is one that cannot be used.
    """
    try:
        text = _read(stage / _NAME)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise JournalError(f"it cannot be read ({error})") from error
    try:
        content = json.loads(text)
        if content["version"] != _VERSION:
            raise JournalError("it is of another version")
        old = tuple(_plain(name) for name in content["old"])
        new = tuple(_new_file(**one) for one in content["new"])
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise JournalError(f"it is damaged ({error})") from error
    for folder in {OLD, *(one.folder for one in new)}:
        if not stat.S_ISDIR((stage / folder).lstat().st_mode):
            raise JournalError("it names what is no folder")
    for name in old:
        moved = stage / OLD / name
        if moved.is_symlink() or not (moved.is_file() or moved.is_dir() or not moved.exists()):
            raise JournalError("it names what is no regular file")
    return Journal(old, new)


def has_journal(stage: Path) -> bool:
    """Whether a staging folder has a journal, of whatever kind."""
    return os.path.lexists(stage / _NAME)


def remove_journal(stage: Path) -> None:
    """Remove the journal of a staging folder: nothing of it is left to be undone."""
    (stage / _NAME).unlink(missing_ok=True)


def _read(path: Path) -> bytes:
    how = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    with os.fdopen(os.open(path, how), "rb") as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise JournalError("it is no regular file")
        text = file.read(_MAX_BYTES + 1)
    if len(text) > _MAX_BYTES:
        raise JournalError("it is too long")
    return text


def _new_file(folder: Any, name: Any, inode: Any, size: Any, mtime_ns: Any) -> NewFile:
    for number in (inode, size, mtime_ns):
        if type(number) is not int:
            raise ValueError("a number is missing")
    return NewFile(_plain(folder), _plain(name), inode, size, mtime_ns)


def _plain(name: Any) -> str:
    """A name of something in a folder, which leads nowhere else."""
    if not isinstance(name, str) or name in ("", ".", "..") or set(name) & set("/\0"):
        raise ValueError("a name is none")
    if os.name == "nt" and set(name) & set("\\:"):
        raise ValueError("a name is none")
    return name
