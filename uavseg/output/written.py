"""Record of what a command has written, for the last line of one that is interrupted."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field


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
    """

    files: list[str] = field(default_factory=list)
    unfinished: list[str] = field(default_factory=list)
    kept: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        """One clause, such as "nothing was written"."""
        found = [
            f"{', '.join(self.files)} {_were(self.files)} written" if self.files else "nothing was written"
        ]
        if self.unfinished:
            found = [*found[: len(self.files)], f"{', '.join(self.unfinished)} may be incomplete"]
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


def note_written(*names: str) -> None:
    """Outputs are complete."""
    if written := _current.get():
        written.files += names


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


def _were(names: list[str]) -> str:
    return "was" if len(names) == 1 else "were"
