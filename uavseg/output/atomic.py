"""Atomic output files: made in a temporary folder beside the target, synced to disk, renamed at the end.

After a crash, of the program or of the machine, each file is what it was before or the whole new one. For
the latter, files are synced (`os.fsync`) before they are renamed, and their folder afterwards. That costs two
waits for the disk, and the time in which it writes what the system still holds in memory: measured on a
virtual disk (ext4), a file of 1 MB took 16 ms instead of 4, one of 200 MB 200 ms instead of 150. A hard disk
takes longer.

Outputs of one command appear together, complete and synced to disk, or not at all (`transaction`). They are
made in staging folders beside their targets. At the end all of them are synced, then renamed: a single file
by one system call, several after a journal lists them. An error undoes what was renamed; a killed run is
undone by the next one that writes into the folder (`renames.recover`). Where outputs go to several folders,
each has a staging folder and a journal: an error undoes all of them, but a run that is killed between the
renames of two folders leaves one folder new and the other as it was.
"""

import errno
import os
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from pathlib import Path

from uavseg.dataclass import dataclass
from uavseg.errors import OutputError, OutputExistsError, UavsegError
from uavseg.output.disk import locked_folder, put_new, sync_all_in, sync_folder, written_here
from uavseg.output.renames import Journal, NewFile, has_journal, recover, remove_journal, rename_all, undo
from uavseg.output.staging import Stage, interrupts_held, is_staged
from uavseg.output.targets import Target, existing_files, find_target, sidecars

_PROBE = 1 << 16  # bytes


_current: ContextVar["Transaction | None"] = ContextVar("transaction", default=None)


def check_target(path: str | os.PathLike[str], overwrite: bool = False) -> Path:
    """Refuse a file that may not be written, before the work whose result it holds, else return its path.

    Before that, what a killed run left in its folder is undone and removed. An OutputExistsError says that it
    exists and `overwrite` is false, or a file that would be read as a part of it, an OutputError that its
    folder does not exist, or that an existing file cannot be replaced.
    """
    return _checked(path, overwrite).given


@contextmanager
def atomic_file(path: str | os.PathLike[str], overwrite: bool = False, sync: bool = True) -> Iterator[Path]:
    """Yield a temporary path that is renamed to `path` at the end if nothing was raised.

    The temporary path keeps the file name, and lies in a temporary folder beside `path`. Drivers may write
    several files (the parts of a shapefile) or a subfolder there: all of them are renamed, and files of an
    older output that a reader would take for parts of this one are removed. Inside of a `transaction`, files
    are renamed at its end. Where `path` is a symbolic link, the file to which it points is written.

    Without `sync` to disk, a file may be empty or torn after a power cut, and is not part of a transaction:
    for single files that are checked when they are read and can be computed again. Errors are those of
    `check_target`; an OutputError also says that writing fails, as on a full disk.
    """
    if is_staged(Path(path)):
        yield Path(path)
        return
    target = _checked(path, overwrite) if sync else find_target(path, overwrite)
    outer = _current.get() if sync else None
    files = outer or Transaction(sync)
    try:
        with output_errors(str(target.given)):
            temporary = files.add(target, overwrite)
            try:
                yield temporary
            except BaseException as error:
                reason = _disk_full(temporary) if isinstance(error, UavsegError) else None
                files.drop(temporary)
                if reason is not None:
                    raise OutputError(f"{target.given} cannot be written: {reason}") from error
                raise
            if outer is None:
                files.commit()
    finally:
        if outer is None:
            files.close()


def _disk_full(path: Path) -> str | None:
    """Return why no more can be written to a file, or None: libraries do not report a full disk."""
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
    reasons = recover(real.parent)
    for file in (real, *sidecars(real)):
        if file.name in reasons:
            raise OutputError(reasons[file.name])
    return find_target(path, overwrite)


@contextmanager
def transaction() -> Iterator[None]:
    """Keep back the files of this thread's `atomic_file`, to appear together or not at all; may be nested."""
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


@contextmanager
def output_errors(name: str) -> Iterator[None]:
    """Raise errors of the operating system as OutputError."""
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


@dataclass(frozen=True, slots=True)
class Part:
    """The files of one target, in a subfolder of a staging folder."""

    folder: Path
    target: Target
    overwrite: bool

    def made(self) -> list[Path]:
        """List the files and folders that were made, the main file last."""
        main = self.folder / self.target.path.name
        return sorted(self.folder.iterdir(), key=lambda path: (path == main, path.name))

    def replaced(self) -> list[Path]:
        """List the existing files that are replaced, the main file first; refuse any without `overwrite`."""
        find_target(self.target.given, self.overwrite)
        others = [file for path in self.made() for file in existing_files(self.target.home / path.name)]
        files = list(dict.fromkeys((*existing_files(self.target.path), *others)))
        if files and not self.overwrite:
            raise OutputExistsError(f"{files[0]} exists; give --overwrite (overwrite=True) to replace it")
        return files


class Transaction:
    """Outputs that appear together; see `transaction`."""

    def __init__(self, sync: bool = True) -> None:
        self._sync = sync
        self._stages: dict[tuple[int, int], Stage] = {}
        self._parts: list[tuple[Stage, Part]] = []

    def add(self, target: Target, overwrite: bool) -> Path:
        """Add a target, and return the path where its main file is to be made."""
        home = target.home.stat()
        key = (home.st_dev, home.st_ino)
        if key not in self._stages:
            self._stages[key] = Stage.make(target.home)
        part = Part(self._stages[key].add_part(), target, overwrite)
        self._parts.append((self._stages[key], part))
        return part.folder / target.path.name

    @property
    def names(self) -> str:
        """Return its targets, for messages."""
        return ", ".join(str(part.target.given) for _, part in self._parts)

    def drop(self, path: Path) -> None:
        """Leave out a target whose main file was to be made at a path."""
        self._parts = [(stage, part) for stage, part in self._parts if part.folder != path.parent]

    def commit(self) -> None:
        """Give all files their names, or undo it if one cannot be renamed."""
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
                    written_here().files += [str(part.target.given) for _, part in self._parts]

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
        """Sync the name of the only file; where that fails, a new one is removed, a replaced one kept."""
        try:
            sync_folder(stage.home)
        except OSError as error:
            if not replaced:
                place.unlink()
                raise
            why = f"its folder could not be synced to disk ({error.strerror})"
            warnings.warn(f"{place} was replaced, but {why}", stacklevel=2)

    def _journal(self, stage: Stage) -> Journal:
        """Return the renames of one folder: old main files are moved first, new ones last."""
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
    """Return whether one system call does it: a new file, or one in place of another; no folder."""
    files = {file.name for file in journal.new if not file.is_folder}
    return len(files) == len(journal.new) <= 1 and set(journal.old) <= files
