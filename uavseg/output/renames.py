"""Renames of one staging folder: all of them, or none after they are undone, wherever the program stops.

Old files are moved into the staging folder, main files first, and new ones out of it, main files last. So at
no moment does a reader find a main file beside parts of another one. Whether a new file got its name shows in
the staging folder, which it has left then. Undoing looks at the files alone; it can itself be stopped and
taken up again.
"""

import os
from pathlib import Path

from uavseg.errors import OutputError
from uavseg.output.disk import put_new, sync_folder
from uavseg.output.journal import OLD, Journal, JournalError, NewFile, read_journal, remove_journal
from uavseg.output.locks import locked_folder
from uavseg.output.staging import Stage, dead_stages


class UndoError(OutputError):
    """Renames cannot be undone, because files of the same names came into being since."""


def rename_all(stage: Stage, journal: Journal) -> None:
    """Make the renames of a journal, which is in the staging folder already."""
    for name in journal.old:
        (stage.home / name).replace(stage.folder / OLD / name)
    for file in journal.new:
        put_new(_source(stage, file), stage.home / file.name)


def undo(stage: Stage, journal: Journal) -> None:
    """Put things back as they were before `rename_all`, which may have stopped anywhere.

    Raises
    ------
    UndoError
        If a name is taken by a file that is neither the old nor the new one; nothing is done then.
    """
    back = [name for name in journal.old if os.path.lexists(stage.folder / OLD / name)]
    _check_free(stage, journal, back)
    for file in reversed(journal.new):
        _take_back(_source(stage, file), stage.home / file.name, file)
    for name in reversed(back):
        _restore(stage.folder / OLD / name, stage.home / name)
    sync_folder(stage.home)
    remove_journal(stage.folder)


def recover(home: Path) -> dict[str, str]:
    """Undo what killed runs left half done in a folder, and remove their staging folders.

    A journal that cannot be used is left alone, with its folder.

    Returns
    -------
    left : dict of str to str
        By the names of files that could not be put back: why.
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
                    _settle(stage, journal)
        except OutputError as error:
            assert journal is not None
            left |= dict.fromkeys((*journal.old, *(file.name for file in journal.new)), str(error))
            stage.leave()
        else:
            stage.remove()
    return left


def _settle(stage: Stage, journal: Journal) -> None:
    """Finish the renames of a killed run if all were made, else undo them."""
    if any(_is_waiting(stage, file) for file in journal.new):
        undo(stage, journal)
    remove_journal(stage.folder)


def _is_waiting(stage: Stage, file: NewFile) -> bool:
    """Whether a new file has not got its name yet: the last one to get it may have both names."""
    source, place = _source(stage, file), stage.home / file.name
    return os.path.lexists(source) and not _are_same(source, place)


def _source(stage: Stage, file: NewFile) -> Path:
    return stage.folder / file.folder / file.name


def _are_same(one: Path, other: Path) -> bool:
    return os.path.lexists(other) and os.path.samestat(one.lstat(), other.lstat())


def _check_free(stage: Stage, journal: Journal, back: list[str]) -> None:
    """Whether every name is free that undoing needs, or belongs to what is taken away."""
    ours = {file.name for file in journal.new if file.is_at(stage.home / file.name)}
    named = {file.name for file in journal.new if not os.path.lexists(_source(stage, file))}
    for name in (*back, *sorted(named)):
        place = stage.home / name
        if not os.path.lexists(place) or name in ours or _is_empty_folder(place):
            continue
        if name in back and _are_same(stage.folder / OLD / name, place):
            continue
        raise UndoError(
            f"a run was killed while it replaced files, and the old ones in {stage.folder} cannot be put "
            f"back: {place} is there again; move it away, or remove that folder"
        )


def _take_back(source: Path, place: Path, file: NewFile) -> None:
    """Take the name from a new file; afterwards it is in the staging folder, and nowhere else."""
    if file.is_at(place):
        if os.path.lexists(source):
            place.unlink()  # it had both names
        else:
            place.replace(source)
    elif source.is_dir() and _is_empty_folder(place):
        place.rmdir()


def _restore(moved: Path, place: Path) -> None:
    if _is_empty_folder(place):
        place.rmdir()
    if _are_same(moved, place):
        moved.unlink()  # it has both names
    else:
        put_new(moved, place)


def _is_empty_folder(place: Path) -> bool:
    """The empty folder that `put_new` makes before it renames one."""
    return place.is_dir() and not place.is_symlink() and not any(place.iterdir())
