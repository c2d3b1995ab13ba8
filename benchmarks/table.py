"""What was measured, as Markdown, and where it stands in README.md."""

import datetime
from collections.abc import Sequence
from pathlib import Path

from benchmarks.accuracy import Hazard, Score
from benchmarks.kernels import Speed
from benchmarks.machine import machine, software
from benchmarks.measure import Cost, Outcome
from benchmarks.paths import Search
from benchmarks.phases import Phase
from benchmarks.robot import Step
from benchmarks.scale import Again, Run
from benchmarks.scenes import Scene
from benchmarks.smallmap import Task
from benchmarks.startup import Start
from benchmarks.vectors import Vectorised

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
    ratio = f"{cost.wall_s / ours_s:.2f}" if ours_s else ""
    return [outcome.competitor.title, *_cost(cost), str(polygons), f"{area / 1e6:.3f}", str(invalid), ratio]


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


def phases(scene: Scene, spent: Sequence[Phase], decoding_s: float) -> str:
    """Where the time of one thread goes."""
    whole = spent[-1].seconds
    cells = [
        [
            phase.title,
            f"{phase.seconds:.2f}",
            f"{phase.seconds / whole:.0%}",
            f"{phase.seconds / scene.side**2 * 1e9:.2f}",
        ]
        for phase in spent
    ]
    cells.append(
        [
            "decoding the file once, nothing else",
            f"{decoding_s:.2f}",
            f"{decoding_s / whole:.0%}",
            f"{decoding_s / scene.side**2 * 1e9:.2f}",
        ]
    )
    return _signed(f"{scene.title}, one thread, one run.\n\n" + rows(["", "s", "share", "ns / pixel"], cells))


def growing(runs: Sequence[Run], rounds: int) -> str:
    """Whole processes over larger and larger rasters."""
    heads = ["", "wall s", "CPU s", "peak MB", "wall ns / pixel", "CPU ns / pixel", "decoding once s"]
    cells = [
        [
            run.scene.title,
            *_cost(run.taken),
            f"{run.taken.wall_s / run.scene.side**2 * 1e9:.1f}",
            f"{run.taken.cpu_s / run.scene.side**2 * 1e9:.1f}",
            f"{run.decoding_s:.2f}",
        ]
        for run in runs
    ]
    return _signed(f"Medians of {rounds}.\n\n" + rows(heads, cells))


def kinds(runs: Sequence[Run], rounds: int) -> str:
    """Whole processes over other kinds of pixels; the first is what the others are compared with."""
    heads = ["", "wall s", "CPU s", "peak MB", "ns / decoded byte", "ratio", "decoding once s"]
    per_byte = [run.taken.wall_s / run.decoded_bytes * 1e9 for run in runs]
    cells = [
        [run.scene.title, *_cost(run.taken), f"{ns:.1f}", f"{ns / per_byte[0]:.2f}", f"{run.decoding_s:.2f}"]
        for run, ns in zip(runs, per_byte, strict=True)
    ]
    return _signed(f"Medians of {rounds}.\n\n" + rows(heads, cells))


def again(side: int, found: Again, rounds: int) -> str:
    """A second question, from a saved block map."""
    heads = ["", "wall s", "CPU s", "peak MB", "wall / first"]
    named = {
        "`extract RASTER`": found.first,
        "`divide RASTER`": found.dividing,
        "`extract blocks.tif`, another range at block edges": found.another,
    }
    cells = [
        [title, *_cost(taken), f"{taken.wall_s / found.first.wall_s:.2f}"] for title, taken in named.items()
    ]
    told = (
        f"Within one process that has loaded all it needs: the first range {found.first_s:.2f} s, the other "
        f"from the block map {found.another_s:.2f} s, a share of {found.another_s / found.first_s:.2f}."
    )
    return _signed(f"{side}², medians of {rounds}.\n\n{rows(heads, cells)}\n\n{told}")


def threads(side: int, found: Sequence[tuple[int, float, float]], rounds: int) -> str:
    """What threads gain, beside what they gain on work that shares nothing."""
    _, one, alone = found[0]
    cells = [
        [str(count), f"{segmenting:.2f}", f"{one / segmenting:.2f}", f"{alone / computing:.2f}"]
        for count, segmenting, computing in found
    ]
    heads = ["threads", "segmentation s", "gain", "gain on work that shares nothing"]
    return _signed(f"{side}², medians of {rounds}.\n\n" + rows(heads, cells))


def vectors(found: Vectorised, rounds: int) -> str:
    """A label image to polygons."""
    cells = [
        ["**uavseg**: `outline.trace`, `Shapes`, all threads", f"{found.ours_s:.2f}", "1.00"],
        ["the same, one thread", f"{found.alone_s:.2f}", f"{found.alone_s / found.ours_s:.2f}"],
        [
            "rasterio.features.shapes, shapely.geometry.shape",
            f"{found.theirs_s:.2f}",
            f"{found.theirs_s / found.ours_s:.2f}",
        ],
    ]
    told = (
        f"{found.regions} regions in {found.pieces} pieces, {found.vertices} vertices; "
        f"{found.equal} pieces have the same rings on both sides. Medians of {rounds}."
    )
    return _signed(f"{told}\n\n{rows(['', 's', 'ratio'], cells)}")


def _cost(taken: Cost) -> list[str]:
    return [f"{taken.wall_s:.2f}", f"{taken.cpu_s:.2f}", f"{taken.peak_bytes / 1e6:.0f}"]


def paths(searches: Sequence[Search]) -> str:
    """Seconds of shortest paths, and how many times ours."""
    heads = ["", "who", "seconds", "cost", "seconds / uavseg"]
    cells = [
        [s.field, s.who, f"{s.seconds:.4f}", f"{s.cost:,.1f}", f"{s.seconds / s.ours_s:,.1f}"]
        for s in searches
    ]
    return _signed(f"{rows(heads, cells)}\n\nscikit-image cuts corners, so its paths may be shorter.")


def accuracy(scores: Sequence[Score], hazards: Sequence[Hazard]) -> str:
    """Intersection over union of states, and the share of obstacles that is called free."""
    parts = []
    for scene in dict.fromkeys(score.scene for score in scores):
        cells = [
            [s.who, *(f"{value:.3f}" for value in (s.free, s.unknown, s.occupied))]
            for s in scores
            if s.scene == scene
        ]
        parts += [f"### {scene}", rows(["intersection over union", "free", "unknown", "occupied"], cells)]
    found = [
        [hazard.map, f"{hazard.cells:,}", f"{hazard.unrefined:.0%}", f"{hazard.refined:.0%}"]
        for hazard in hazards
    ]
    if found:
        heads = ["real map", "cells with v > 0.502", "called free", "after refinement"]
        parts += ["### thin walls", rows(heads, found)]
    return "\n\n".join(parts)


def small_maps(tasks: Sequence[Task]) -> str:
    """Milliseconds on maps of 320 x 320 cells."""
    cells = [[task.who, f"{task.lens_ms:.1f}", f"{task.circles_ms:.1f}"] for task in tasks]
    return _signed(rows(["320 x 320 cells", "lens, ms", "circles, ms"], cells))


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
