"""Journaled renames of one staging folder: all of them, or none after they are undone by this or a later run.

Old files are moved into the staging folder, main files first, and new ones out of it, main files last. So at
no moment does a reader find a main file beside parts of another one. Whether a new file got its name shows in
the staging folder, which it has left then. Undoing looks at the files alone; it can itself be stopped and
taken up again.
"""

import json
import os
import stat
from dataclasses import asdict
from pathlib import Path
from typing import Any

from uavseg.dataclass import dataclass
from uavseg.errors import OutputError
from uavseg.output.disk import locked_folder, put_new, sync_file, sync_folder
from uavseg.output.staging import Stage, dead_stages

_OLD = "old"  # the subfolder of files that are replaced
_JOURNAL = "journal"
_MAX_BYTES = 1 << 20
_VERSION = 1


class JournalError(ValueError):
    """A journal that is damaged, or of another program."""


class UndoError(OutputError):
    """Renames cannot be undone, because files of the same names came into being since."""


@dataclass(frozen=True, slots=True)
class NewFile:
    """A file or folder that gets its name, with what identifies it, in a subfolder of the staging folder."""

    folder: str
    name: str
    inode: int
    size: int  # 0 of a folder
    mtime_ns: int  # likewise

    @classmethod
    def of(cls, path: Path) -> "NewFile":
        """Identify a file or folder in a subfolder of the staging folder."""
        status = path.lstat()
        size, mtime_ns = (0, 0) if stat.S_ISDIR(status.st_mode) else (status.st_size, status.st_mtime_ns)
        return cls(folder=path.parent.name, name=path.name, inode=status.st_ino, size=size, mtime_ns=mtime_ns)

    @property
    def is_folder(self) -> bool:
        """Whether it has neither size nor time."""
        return self.size == self.mtime_ns == 0

    def is_at(self, place: Path) -> bool:
        """Return whether that is this very file, unchanged."""
        if not os.path.lexists(place):
            return False
        other = NewFile.of(place)
        return (other.inode, other.size, other.mtime_ns) == (self.inode, self.size, self.mtime_ns)


@dataclass(frozen=True, slots=True)
class Journal:
    """The renames between a staging folder and the folder in which it lies."""

    old: tuple[str, ...]  # first moved into the subfolder `old`, main files first
    new: tuple[NewFile, ...]  # then moved out of the staging folder, main files last

    def write(self, stage: Path) -> None:
        """Write the journal to a staging folder, whole and on the disk, or not at all."""
        (stage / _OLD).mkdir()
        temporary = stage / f"{_JOURNAL}.new"
        temporary.write_text(json.dumps({"version": _VERSION, **asdict(self)}), encoding="utf-8")
        sync_file(temporary)
        temporary.replace(stage / _JOURNAL)
        sync_folder(stage)


def read_journal(stage: Path) -> Journal | None:
    """Read the journal of a staging folder; None without one, JournalError if it cannot be used.

    A stranger may have made the folder, as by an archive that was unpacked. So only plain names are accepted,
    in subfolders that are no symbolic links, and only a regular file is read.
    """
    try:
        text = _read(stage / _JOURNAL)
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
    for folder in {_OLD, *(one.folder for one in new)}:
        if not stat.S_ISDIR((stage / folder).lstat().st_mode):
            raise JournalError(f"not a folder: {folder}")
    for name in old:
        moved = stage / _OLD / name
        if moved.is_symlink() or not (moved.is_file() or moved.is_dir() or not moved.exists()):
            raise JournalError(f"not a regular file: {name}")
    return Journal(old, new)


def has_journal(stage: Path) -> bool:
    """Return whether a staging folder has a journal, even a damaged one."""
    return os.path.lexists(stage / _JOURNAL)


def remove_journal(stage: Path) -> None:
    """Remove the journal of a staging folder, so that nothing is undone."""
    (stage / _JOURNAL).unlink(missing_ok=True)


def _read(path: Path) -> bytes:
    flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    with os.fdopen(os.open(path, flags), "rb") as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise JournalError("it is not a regular file")
        text = file.read(_MAX_BYTES + 1)
    if len(text) > _MAX_BYTES:
        raise JournalError("it is too long")
    return text


def _new_file(folder: Any, name: Any, inode: Any, size: Any, mtime_ns: Any) -> NewFile:
    if not all(type(number) is int for number in (inode, size, mtime_ns)):
        raise ValueError("a number is missing")
    return NewFile(folder=_plain(folder), name=_plain(name), inode=inode, size=size, mtime_ns=mtime_ns)


def _plain(name: Any) -> str:
    """Refuse a name that is empty or leads out of its folder."""
    separators = "/\0\\:" if os.name == "nt" else "/\0"
    if not isinstance(name, str) or name in ("", ".", "..") or set(name) & set(separators):
        raise ValueError("empty name, or not a plain one")
    return name


def rename_all(stage: Stage, journal: Journal) -> None:
    """Make the renames of a journal, which is in the staging folder already."""
    for name in journal.old:
        (stage.home / name).replace(stage.folder / _OLD / name)
    for file in journal.new:
        put_new(_source(stage, file), stage.home / file.name)


def undo(stage: Stage, journal: Journal) -> None:
    """Undo `rename_all`, which may have stopped anywhere."""
    moved = [name for name in journal.old if os.path.lexists(stage.folder / _OLD / name)]
    _check_free(stage, journal, moved)
    for file in reversed(journal.new):
        _take_back(_source(stage, file), stage.home / file.name, file)
    for name in reversed(moved):
        old, place = stage.folder / _OLD / name, stage.home / name
        if _is_empty_folder(place):
            place.rmdir()
        if _are_same(old, place):
            old.unlink()  # it has both names
        else:
            put_new(old, place)
    sync_folder(stage.home)
    remove_journal(stage.folder)


def recover(home: Path) -> dict[str, str]:
    """Undo what killed runs left half done in a folder, and remove their staging folders.

    A journal that cannot be used is left alone, with its folder. Returns the reasons by the names of files
    that could not be put back.
    """
    left: dict[str, str] = {}
    for stage in dead_stages(home):
        try:
            journal = read_journal(stage.folder)
        except (JournalError, OSError):
            stage.leave()
            continue
        try:
            if journal is not None:
                with locked_folder(home):
                    if any(_is_waiting(stage, file) for file in journal.new):
                        undo(stage, journal)  # unless all renames of the killed run were made
                    remove_journal(stage.folder)
        except OutputError as error:
            assert journal is not None
            left |= dict.fromkeys((*journal.old, *(file.name for file in journal.new)), str(error))
            stage.leave()
        else:
            stage.remove()
    return left


def _is_waiting(stage: Stage, file: NewFile) -> bool:
    """Return whether a new file has not got its name yet: the last one to get it may have both names."""
    source, place = _source(stage, file), stage.home / file.name
    return os.path.lexists(source) and not _are_same(source, place)


def _source(stage: Stage, file: NewFile) -> Path:
    return stage.folder / file.folder / file.name


def _are_same(one: Path, other: Path) -> bool:
    return os.path.lexists(other) and os.path.samestat(one.lstat(), other.lstat())


def _check_free(stage: Stage, journal: Journal, moved: list[str]) -> None:
    """Refuse to undo unless every name that it needs is free, or belongs to what is taken away."""
    ours = {file.name for file in journal.new if file.is_at(stage.home / file.name)}
    named = {file.name for file in journal.new if not os.path.lexists(_source(stage, file))}
    for name in (*moved, *sorted(named)):
        place = stage.home / name
        free = not os.path.lexists(place) or name in ours or _is_empty_folder(place)
        if not free and not (name in moved and _are_same(stage.folder / _OLD / name, place)):
            raise UndoError(
                f"a run was killed while it replaced files, and the old ones in {stage.folder} cannot be put "
                f"back: {place} is there again; move it away, or remove that folder"
            )


def _take_back(source: Path, place: Path, file: NewFile) -> None:
    """Move a new file back into the staging folder."""
    if file.is_at(place):
        if os.path.lexists(source):
            place.unlink()  # it had both names
        else:
            place.replace(source)
    elif source.is_dir() and _is_empty_folder(place):
        place.rmdir()


def _is_empty_folder(place: Path) -> bool:
    """Return whether that is an empty folder, such as `put_new` makes before it renames one."""
    return place.is_dir() and not place.is_symlink() and not any(place.iterdir())
