"""Transactions: the outputs of one command appear together, complete and synced to disk, or not at all.

Files are made in staging folders beside their targets. At the end all of them are synced, then renamed: a
single file by one system call, several after a journal says which. An error undoes what was renamed; a killed
run is undone by the next one that writes into the folder (`renames.recover`). Where outputs go to several
folders, each folder has its own staging folder and journal: an error undoes all of them, but a run that is
killed between the renames of two folders leaves one folder new and the other as it was.
"""

import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path

from uavseg.errors import OutputError, OutputExistsError, UavsegError
from uavseg.output.disk import put_new, sync_all_in, sync_folder
from uavseg.output.interrupts import interrupts_held
from uavseg.output.journal import Journal, NewFile, has_journal, remove_journal
from uavseg.output.locks import locked_folder
from uavseg.output.renames import rename_all, undo
from uavseg.output.staging import Stage
from uavseg.output.targets import Target, existing_files, find_target
from uavseg.output.written import note_written


@dataclass(frozen=True, slots=True)
class Part:
    """The files of one target, in a subfolder of a staging folder.

    Parameters
    ----------
    folder : Path
    target : Target
    overwrite : bool
    """

    folder: Path
    target: Target
    overwrite: bool

    def made(self) -> list[Path]:
        """The files and folders that were made, the main file last."""
        main = self.folder / self.target.path.name
        return sorted(self.folder.iterdir(), key=lambda path: (path == main, path.name))

    def replaced(self) -> list[Path]:
        """What is there and gives way, the main file first.

        Raises
        ------
        OutputExistsError
            If anything is, and may not be replaced.
        """
        find_target(self.target.given, self.overwrite)
        others = [file for path in self.made() for file in existing_files(self.target.home / path.name)]
        found = dict.fromkeys((*self.target.existing(), *others))
        if found and not self.overwrite:
            raise OutputExistsError(
                f"{next(iter(found))} exists; give --overwrite (overwrite=True) to replace it"
            )
        return list(found)


class Transaction:
    """Outputs that appear together; see `transaction`."""

    def __init__(self, sync: bool = True) -> None:
        self._sync = sync
        self._stages: dict[tuple[int, int], Stage] = {}
        self._parts: list[tuple[Stage, Part]] = []

    def add(self, target: Target, overwrite: bool) -> Path:
        """Take in a target; returns the path where its main file is to be made."""
        home = target.home.stat()
        key = (home.st_dev, home.st_ino)
        if key not in self._stages:
            self._stages[key] = Stage.make(target.home)
        part = Part(self._stages[key].add_part(), target, overwrite)
        self._parts.append((self._stages[key], part))
        return part.folder / target.path.name

    @property
    def names(self) -> str:
        """Its targets, for messages."""
        return ", ".join(str(part.target.given) for _, part in self._parts)

    def drop(self, path: Path) -> None:
        """Leave out a target whose main file was to be made at a path."""
        self._parts = [(stage, part) for stage, part in self._parts if part.folder != path.parent]

    def commit(self) -> None:
        """Give all files their names.

        Raises
        ------
        OutputExistsError
            If one of them exists and may not be replaced.
        OSError
            If anything cannot be renamed; what was renamed is undone.
        """
        if self._sync:
            for _, part in self._parts:
                sync_all_in(part.folder)
        with ExitStack() as locks:
            for key in sorted(self._stages):
                if self._sync:
                    locks.enter_context(locked_folder(self._stages[key].home))
            with interrupts_held():
                self._rename()
                if self._sync:
                    note_written(*(str(part.target.given) for _, part in self._parts))

    def close(self) -> None:
        """Remove the staging folders; one whose renames could not be undone stays."""
        with interrupts_held():
            for stage in self._stages.values():
                if has_journal(stage.folder):
                    stage.leave()
                else:
                    stage.remove()
            self._stages.clear()
            self._parts.clear()

    def _rename(self) -> None:
        journals = [(stage, self._journal(stage)) for stage in self._stages.values()]
        if len(journals) == 1 and _is_single(journals[0][1]):
            self._rename_single(*journals[0])
            return
        try:
            for stage, journal in journals:
                journal.write(stage.folder)
            for stage, journal in journals:
                rename_all(stage, journal)
            for stage, _ in journals:
                sync_folder(stage.home)
        except BaseException:
            with ExitStack() as undoing:  # which goes on after one cannot be undone
                for stage, journal in journals:
                    undoing.callback(undo, stage, journal)
            raise
        for stage, _ in journals:
            remove_journal(stage.folder)

    def _rename_single(self, stage: Stage, journal: Journal) -> None:
        for file in journal.new:
            source, place = stage.folder / file.folder / file.name, stage.home / file.name
            if journal.old or not self._sync:
                source.replace(place)
            else:
                put_new(source, place)
            if self._sync:
                self._sync_single(stage, place, bool(journal.old))

    def _sync_single(self, stage: Stage, place: Path, replaced: bool) -> None:
        """Sync the name of the only file; a new one goes where that fails, one that is replaced has gone."""
        try:
            sync_folder(stage.home)
        except OSError as error:
            if not replaced:
                place.unlink()
                raise
            warnings.warn(
                f"{place} was replaced, but its folder could not be synced to disk ({error.strerror})",
                stacklevel=2,
            )

    def _journal(self, stage: Stage) -> Journal:
        """The renames of one folder: main files go first and come last."""
        parts = [part for owner, part in self._parts if owner is stage and part.made()]
        replaced = [part.replaced() for part in parts] if self._sync else []
        made = [part.made() for part in parts]
        old = [files[0] for files in replaced if files] + [path for files in replaced for path in files[1:]]
        new = [path for files in made for path in files[:-1]] + [files[-1] for files in made]
        names = [path.name for path in new]
        for name in names:
            if names.count(name) > 1:
                raise OutputError(f"two outputs have the file {stage.home / name}; give each its own name")
        return Journal(tuple(dict.fromkeys(path.name for path in old)), tuple(map(NewFile.of, new)))


def _is_single(journal: Journal) -> bool:
    """Whether one system call does it: a new file, or one in place of another."""
    return len(journal.new) <= 1 and set(journal.old) <= {file.name for file in journal.new}


_current: ContextVar[Transaction | None] = ContextVar("transaction", default=None)


@contextmanager
def transaction() -> Iterator[None]:
    """Context in which the files of this thread's `atomic_file` are kept back, to appear together at its end.

    After an error none of them appears. A transaction inside another one belongs to it.

    Raises
    ------
    OutputExistsError, OutputError
        As of `atomic_file`.
    """
    if _current.get() is not None:
        yield
        return
    files = Transaction()
    token = _current.set(files)
    try:
        yield
        with output_errors(files.names):
            files.commit()
    finally:
        _current.reset(token)
        files.close()


def current_transaction() -> Transaction | None:
    """The transaction of this thread, if there is one."""
    return _current.get()


@contextmanager
def output_errors(name: str) -> Iterator[None]:
    """Errors of the operating system as OutputError."""
    try:
        yield
    except UavsegError:
        raise
    except FileExistsError as error:
        raise OutputExistsError(
            f"{error.filename2 or error.filename} was made by another program in the meantime; try again"
        ) from error
    except OSError as error:
        raise OutputError(f"{name} cannot be written: {error.strerror or error}") from error
