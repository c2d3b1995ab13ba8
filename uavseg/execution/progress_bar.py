"""Progress as a line of text, on a terminal or in a notebook.

Not `click.progressbar`: `api` and notebooks draw this bar without click, and a phase is drawn by its own
thread, so a bar of click would replace 9 lines. Not tqdm: a dependency for the same.
"""

import sys
import threading
import time

from uavseg.dataclass import dataclass
from uavseg.execution.executors import OWN_THREAD, working_seconds

_WIDTH = 24
_REDRAW_S = 0.1
_WATCH_S, _LONG_S = 0.5, 2.0
_EACH_S, _LINES_EACH_S = 1.0, 30.0


class ProgressLine:
    """Progress on stderr as one line that is drawn again and again; notebooks show it too."""

    def __init__(self) -> None:
        self._begun = self._drawn = working_seconds()

    def __call__(self, done: int, total: int) -> None:
        """Take in that `done` of `total` steps are done."""
        now, share = working_seconds(), done / max(total, 1)
        if sys.stderr is None or (now - self._drawn < _REDRAW_S and share < 1):
            return
        self._drawn = now
        end = "\n" if share >= 1 else ""
        print(f"\r{bar(share, now - self._begun):<60}", end=end, file=sys.stderr, flush=True)


class PhaseLine:
    """The phase of a job that takes long, on stderr; a watcher of `executors.watched`.

    A terminal shows one line from two seconds on, drawn again each second; elsewhere it is a line each thirty
    seconds. A thread draws it, so that one long step is shown too.
    """

    def __init__(self) -> None:
        self._phase: str | None = None
        self._steps = 0, 0
        self._begun = self._drawn = time.monotonic()
        self._is_drawn = False
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._draw_often, name=f"{OWN_THREAD}bar", daemon=True)

    def __enter__(self) -> "PhaseLine":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()
        self._clear()

    def __call__(self, phase: str | None, done: int, total: int) -> None:
        """Take in that a phase begins (or, as None, ends), or where it is empty, how many steps are done."""
        if phase != "":
            self._phase, self._begun, self._drawn = phase, time.monotonic(), -_LINES_EACH_S
            self._clear()
        self._steps = done, total

    def _draw_often(self) -> None:
        while not self._ended.wait(_WATCH_S):
            self.draw_if_due()

    def draw_if_due(self) -> None:
        """Draw the line, if the phase takes long and it was not drawn just now."""
        now, phase = time.monotonic(), self._phase
        first, every = (_LONG_S, _EACH_S) if _is_terminal() else (_LINES_EACH_S, _LINES_EACH_S)
        if phase is not None and now - self._begun >= first and now - self._drawn >= every:
            self._drawn = now
            self._draw(phase, now - self._begun, *self._steps)

    def _draw(self, phase: str, seconds: float, done: int, total: int) -> None:
        share = f"{int(100 * done / total)} %, " if total else ""
        text = f"{phase}: {share}{clock(seconds)}"
        if _is_terminal():
            print(f"\r{text}\x1b[K", end="", file=sys.stderr, flush=True)
            self._is_drawn = True
        elif sys.stderr is not None:
            print(f"uavseg: {text}", file=sys.stderr, flush=True)

    def _clear(self) -> None:
        if self._is_drawn:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
            self._is_drawn = False


def _is_terminal() -> bool:
    return sys.stderr is not None and sys.stderr.isatty()


@dataclass(frozen=True, slots=True)
class Amount:
    """How much there is to do."""

    tiles: int
    pixels: int  # 0 if they are not known
    unit: str = "tiles"  # what is counted as tiles


def bar(share: float, seconds: float, amount: Amount | None = None) -> str:
    """Return one line: how much is done, tiles, pixels per second and the time left.

    A tile is passed several times, and counts by the share of all passes that is done. `share` (0 to 1) is
    how much of the work is done, after so many seconds.

    Examples
    --------
    >>> bar(0.25, 60, Amount(80, 240_000_000))
    '[######..................]  25 %  20/80 tiles  1.0 Mpx/s  3:00 left'
    >>> bar(0, 0.1)
    '[........................]   0 %'
    """
    filled = int(share * _WIDTH)
    parts = [f"[{'#' * filled}{'.' * (_WIDTH - filled)}] {int(100 * share):3d} %"]
    if amount is not None:
        parts.append(f"{int(share * amount.tiles):,}/{amount.tiles:,} {amount.unit}")
    if share > 0 and seconds > 0:
        if amount is not None and amount.pixels:
            parts.append(f"{_si(share * amount.pixels / seconds)}px/s")
        parts.append(f"{clock(seconds * (1 - share) / share)} left")
    return "  ".join(parts)


def clock(seconds: float) -> str:
    """Return a time as one reads it.

    Examples
    --------
    >>> clock(59.6), clock(3 * 3600 + 62)
    ('1:00', '3:01:02')
    """
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


def _si(number: float) -> str:
    for size, prefix in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if number >= size:
            return f"{number / size:.1f} {prefix}"
    return f"{number:.0f} "
