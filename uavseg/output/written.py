"""Record of what a command has written, for the last line of one that is interrupted."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field

_MOST_NAMED = 8


@dataclass(slots=True)
class Written:
    """What has been written.

    Parameters
    ----------
    files : list of str
        Outputs that are complete.
    unfinished : list of str
        Streams of which a part may have been written.
    kept : list of str
        Folders of finished tiles.
    planned : list of str
        Outputs of a run over many sources.
    ended : str
        What the end of a command means that writes no file of the user, if that is all there is to say.
    """

    files: list[str] = field(default_factory=list)
    unfinished: list[str] = field(default_factory=list)
    kept: list[str] = field(default_factory=list)
    planned: list[str] = field(default_factory=list)
    ended: str = ""

    def __str__(self) -> str:
        """One clause, such as "nothing was written"."""
        nothing = self.ended or "nothing was written"
        found = [f"{_named(self.files)} {_were(self.files)} written" if self.files else nothing]
        if missing := [name for name in self.planned if name not in set(self.files)]:
            found.append(f"{len(missing):,} of {len(self.planned):,} outputs were not: {_named(missing)}")
        if self.unfinished:
            found = [*(found if self.files else found[1:]), f"{', '.join(self.unfinished)} may be incomplete"]
        if self.kept:
            found.append(f"finished tiles are kept in {', '.join(self.kept)}")
        return "; ".join(found)


_current: ContextVar[Written | None] = ContextVar("written", default=None)


@contextmanager
def recording_written() -> Iterator[Written]:
    """Context in which what is written is recorded."""
    written = Written()
    token = _current.set(written)
    try:
        yield written
    finally:
        _current.reset(token)


def note_ended(words: str) -> None:
    """What the end of this command means, from here on."""
    if written := _current.get():
        written.ended = words


def note_written(*names: str) -> None:
    """Outputs are complete."""
    if written := _current.get():
        written.files += names


def note_planned(*names: str) -> None:
    """Outputs are to be written, one after another."""
    if written := _current.get():
        written.planned += names


def note_kept(folder: str) -> None:
    """A folder holds finished tiles."""
    if (written := _current.get()) and folder not in written.kept:
        written.kept.append(folder)


@contextmanager
def noted_stream(name: str) -> Iterator[None]:
    """Context in which a stream is written to."""
    written = _current.get()
    if written is None:
        yield
        return
    written.unfinished.append(name)
    yield
    written.unfinished.remove(name)
    written.files.append(name)


def _named(names: list[str]) -> str:
    """Names for people: the first and the last ones of many."""
    if len(names) <= _MOST_NAMED:
        return ", ".join(names)
    return f"{', '.join(names[:2])} ... {names[-1]} ({len(names):,} files)"


def _were(names: list[str]) -> str:
    return "was" if len(names) == 1 else "were"
