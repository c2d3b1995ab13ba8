"""What was measured, as Markdown, and where it stands in README.md."""

import datetime
from collections.abc import Sequence
from pathlib import Path

from benchmarks.kernels import Speed
from benchmarks.machine import machine, software
from benchmarks.measure import Outcome
from benchmarks.robot import Step
from benchmarks.startup import Start

README = Path(__file__).resolve().with_name("README.md")


def rows(heads: Sequence[str], cells: Sequence[Sequence[str]]) -> str:
    """A Markdown table; the first column is text, the others are numbers and stand to the right.

    Examples
    --------
    >>> print(rows(["who", "s"], [["us", "1"], ["them", "20"]]))
    | who  |  s |
    |------|---:|
    | us   |  1 |
    | them | 20 |
    """
    widths = [max(len(line[k]) for line in [heads, *cells]) for k in range(len(heads))]
    lines = [[_placed(text, widths[k], k) for k, text in enumerate(line)] for line in [heads, *cells]]
    rule = ["-" * (widths[0] + 2), *("-" * (width + 1) + ":" for width in widths[1:])]
    body = ["| " + " | ".join(line) + " |" for line in lines]
    return "\n".join([body[0], "|" + "|".join(rule) + "|", *body[1:]])


def _placed(text: str, width: int, column: int) -> str:
    return text.ljust(width) if column == 0 else text.rjust(width)


def processes(outcomes: Sequence[Outcome], rounds: int) -> str:
    """Whole processes: a table for each scene, in the order given, and why somebody is missing."""
    scenes = list(dict.fromkeys(outcome.scene for outcome in outcomes))
    parts = [
        f"Medians of {rounds} rounds, the competitors in turn within each." if rounds > 1 else "One round."
    ]
    for scene in scenes:
        here = [outcome for outcome in outcomes if outcome.scene == scene]
        parts += [f"### {scene.title}", _scene_table([outcome for outcome in here if outcome.costs])]
        parts += [f"- {outcome.competitor.name}: {outcome.remark}" for outcome in here if outcome.remark]
    return _signed("\n\n".join(parts))


def _scene_table(outcomes: Sequence[Outcome]) -> str:
    heads = ["", "wall s", "CPU s", "peak MB", "polygons", "km²", "invalid", "wall / uavseg"]
    walls = {outcome.competitor.name: outcome.median().wall_s for outcome in outcomes}
    return rows(heads, [_scene_row(outcome, walls.get("uavseg")) for outcome in outcomes])


def _scene_row(outcome: Outcome, ours_s: float | None) -> list[str]:
    cost = outcome.median()
    polygons, area, invalid = outcome.answer or (0, 0.0, 0)
    numbers = [f"{cost.wall_s:.2f}", f"{cost.cpu_s:.2f}", f"{cost.peak_bytes / 1e6:.0f}"]
    ratio = f"{cost.wall_s / ours_s:.2f}" if ours_s else ""
    return [outcome.competitor.title, *numbers, str(polygons), f"{area / 1e6:.3f}", str(invalid), ratio]


def starting(starts: Sequence[Start]) -> str:
    """What starting costs."""
    heads = ["", "wall s", "CPU s", "imports s", "imports / CPU"]
    cells = [
        [s.title, f"{s.wall_s:.3f}", f"{s.cpu_s:.3f}", f"{s.imports_s:.3f}", f"{s.imports_s / s.cpu_s:.0%}"]
        for s in starts
    ]
    return _signed(rows(heads, cells))


def kernels(speeds: Sequence[Speed]) -> str:
    """Nanoseconds per pixel of the kernels."""
    heads = ["", "ns / pixel", "copying its arrays", "ratio", "makes"]
    cells = [
        [s.title, f"{s.ns:.2f}", f"{s.floor_ns:.2f}", f"{s.ns / s.floor_ns:.0f}", s.remark] for s in speeds
    ]
    return _signed(rows(heads, cells))


def robot(steps: Sequence[Step]) -> str:
    """What a robot does at sensor rate."""
    heads = ["", "ms", "merging", "segmenting", "blocks", "of"]
    cells = [
        [
            s.title,
            f"{s.ms:.2f}",
            f"{s.merging_ms:.2f}" if s.merging_ms else "",
            f"{s.ms - s.merging_ms:.2f}",
            f"{s.blocks:.0f}",
            s.remark,
        ]
        for s in steps
    ]
    return _signed(rows(heads, cells))


def _signed(text: str) -> str:
    return f"{text}\n\n*{datetime.date.today().isoformat()}: {machine()}. {software()}.*"


def replaced(document: str, section: str, text: str) -> str:
    """A document with what stands between the marks of a section replaced.

    Raises
    ------
    ValueError
        If the document has no such marks.

    Examples
    --------
    >>> replaced("<!-- a -->old<!-- /a -->, and more", "a", "new")
    '<!-- a -->\\n\\nnew\\n\\n<!-- /a -->, and more'
    """
    first, last = f"<!-- {section} -->", f"<!-- /{section} -->"
    before, found, rest = document.partition(first)
    _, ended, after = rest.partition(last)
    if not found or not ended:
        raise ValueError(f"the document has no lines {first} and {last} to write between")
    return f"{before}{first}\n\n{text}\n\n{last}{after}"


def keep(section: str, text: str, path: Path = README) -> None:
    """Write a section into README.md."""
    path.write_text(replaced(path.read_text(), section, text))
