"""Record of what a command has written, for the last line of an interrupted one."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field

_MAX_NAMES = 8


@dataclass(slots=True)
class Written:
    """Outputs of a command so far."""

    files: list[str] = field(default_factory=list)  # complete outputs
    unfinished: list[str] = field(default_factory=list)  # streams of which a part may have been written
    kept: list[str] = field(default_factory=list)  # folders of finished tiles
    planned: list[str] = field(default_factory=list)  # outputs of a run over many sources
    ended: str = ""  # the meaning of the end of a command that writes no file

    def __str__(self) -> str:
        """Return one clause, such as "nothing was written"."""
        nothing = self.ended or "nothing was written"
        parts = [f"{_named(self.files)} {_were(self.files)} written" if self.files else nothing]
        if missing := [name for name in self.planned if name not in set(self.files)]:
            parts.append(f"{len(missing):,} of {len(self.planned):,} outputs were not: {_named(missing)}")
        if self.unfinished:
            parts = [*(parts if self.files else parts[1:]), f"{', '.join(self.unfinished)} may be incomplete"]
        if self.kept:
            parts.append(f"finished tiles are kept in {', '.join(self.kept)}")
        return "; ".join(parts)


_current: ContextVar[Written | None] = ContextVar("written", default=None)


@contextmanager
def recording_written() -> Iterator[Written]:
    """Record what is written."""
    written = Written()
    token = _current.set(written)
    try:
        yield written
    finally:
        _current.reset(token)


def note_ended(text: str) -> None:
    """Note what the end of this command means from now on."""
    if written := _current.get():
        written.ended = text


def note_written(*names: str) -> None:
    """Note outputs that are complete."""
    if written := _current.get():
        written.files += names


def note_planned(*names: str) -> None:
    """Note outputs that are to be written, one after another."""
    if written := _current.get():
        written.planned += names


def note_kept(folder: str) -> None:
    """Note a folder of finished tiles."""
    if (written := _current.get()) and folder not in written.kept:
        written.kept.append(folder)


@contextmanager
def noted_stream(name: str) -> Iterator[None]:
    """Note a stream as incomplete while it is written to."""
    written = _current.get()
    if written is None:
        yield
        return
    written.unfinished.append(name)
    yield
    written.unfinished.remove(name)
    written.files.append(name)


def _named(names: list[str]) -> str:
    """List names; of many, the first ones and the last."""
    if len(names) <= _MAX_NAMES:
        return ", ".join(names)
    return f"{', '.join(names[:2])} ... {names[-1]} ({len(names):,} files)"


def _were(names: list[str]) -> str:
    return "was" if len(names) == 1 else "were"
