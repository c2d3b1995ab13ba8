"""Results as Markdown tables, and the sections of the documents that they are written to."""

import datetime
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from benchmarks.accuracy import Hazard, Score
from benchmarks.kernels import Speed
from benchmarks.machine import machine, software
from benchmarks.measure import Cost, Outcome
from benchmarks.obstacles import Kept
from benchmarks.paths import Search
from benchmarks.phases import Phase
from benchmarks.robot import Step
from benchmarks.scale import Reuse, Run
from benchmarks.scenes import Scene
from benchmarks.smallmap import Task
from benchmarks.startup import Imported, Start
from benchmarks.vectors import Vectorised

README = Path(__file__).resolve().with_name("README.md")


def rows(heads: Sequence[str], cells: Sequence[Sequence[str]]) -> str:
    """A Markdown table with the first column left-aligned and the others right-aligned.

    Examples
    --------
    >>> print(rows(["who", "s"], [["us", "1"], ["them", "20"]]))
    | who  |  s |
    |------|---:|
    | us   |  1 |
    | them | 20 |
    """
    widths = [max(len(line[k]) for line in [heads, *cells]) for k in range(len(heads))]
    lines = [[_aligned(text, widths[k], k) for k, text in enumerate(line)] for line in [heads, *cells]]
    rule = ["-" * (widths[0] + 2), *("-" * (width + 1) + ":" for width in widths[1:])]
    body = ["| " + " | ".join(line) + " |" for line in lines]
    return "\n".join([body[0], "|" + "|".join(rule) + "|", *body[1:]])


def _aligned(text: str, width: int, column: int) -> str:
    return text.ljust(width) if column == 0 else text.rjust(width)


def processes(outcomes: Sequence[Outcome], rounds: int) -> str:
    """Whole processes: a table for each scene, and the reason for each missing competitor."""
    scenes = list(dict.fromkeys(outcome.scene for outcome in outcomes))
    parts = [
        f"Medians of {rounds} rounds; the competitors run in turn within each round."
        if rounds > 1
        else "One round."
    ]
    for scene in scenes:
        of_scene = [outcome for outcome in outcomes if outcome.scene == scene]
        parts += [f"### {scene.title}", _scene_table([outcome for outcome in of_scene if outcome.costs])]
        parts += [f"- {outcome.competitor.name}: {outcome.remark}" for outcome in of_scene if outcome.remark]
    return with_provenance("\n\n".join(parts))


def _scene_table(outcomes: Sequence[Outcome]) -> str:
    heads = ["", "wall s", "CPU s", "peak MB", "polygons", "km²", "invalid", "wall / uavseg"]
    walls = {outcome.competitor.name: outcome.median().wall_s for outcome in outcomes}
    return rows(heads, [_scene_row(outcome, walls.get("uavseg")) for outcome in outcomes])


def _scene_row(outcome: Outcome, uavseg_s: float | None) -> list[str]:
    cost = outcome.median()
    polygons, area, invalid = outcome.stats or (0, 0.0, 0)
    ratio = f"{cost.wall_s / uavseg_s:.2f}" if uavseg_s else ""
    return [outcome.competitor.title, *_cost(cost), str(polygons), f"{area / 1e6:.3f}", str(invalid), ratio]


def starting(starts: Sequence[Start], imports: Sequence[Imported], most: int = 10) -> str:
    """Start-up times, and the packages whose import takes longest."""
    heads = ["", "wall s", "CPU s", "of rasterio, shapely", "imports s"]
    cells = [
        [s.title, f"{s.wall_s:.3f}", f"{s.cpu_s:.3f}", f"{s.ratio:.2f}", f"{s.imports_s:.3f}"] for s in starts
    ]
    others = imports[most:]
    shown = [
        *imports[:most],
        Imported("others", sum(one.modules for one in others), sum(one.seconds for one in others)),
    ]
    packages = [[one.package, f"{one.modules}", f"{one.seconds * 1000:.1f}"] for one in shown]
    return with_provenance(
        rows(heads, cells) + "\n" + rows(["imported for GeoJSON", "modules", "ms"], packages)
    )


def kernels(speeds: Sequence[Speed]) -> str:
    """Nanoseconds per pixel of the kernels."""
    heads = ["", "ns / pixel", "copy, ns / pixel", "ratio", "output"]
    cells = [
        [s.title, f"{s.ns:.2f}", f"{s.copy_ns:.2f}", f"{s.ns / s.copy_ns:.0f}", s.remark] for s in speeds
    ]
    return with_provenance(rows(heads, cells))


def phases(scene: Scene, spent: Sequence[Phase], decoding_s: float) -> str:
    """Time of one thread by function."""
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
            "for comparison: decoding the file once",
            f"{decoding_s:.2f}",
            f"{decoding_s / whole:.0%}",
            f"{decoding_s / scene.side**2 * 1e9:.2f}",
        ]
    )
    return with_provenance(
        f"{scene.title}, one thread, one run.\n\n" + rows(["", "s", "share", "ns / pixel"], cells)
    )


def scaling(runs: Sequence[Run], rounds: int) -> str:
    """Whole processes on rasters of increasing size."""
    heads = ["", "wall s", "CPU s", "peak MB", "wall ns / pixel", "CPU ns / pixel", "decoding once s"]
    cells = [
        [
            run.scene.title,
            *_cost(run.cost),
            f"{run.cost.wall_s / run.scene.side**2 * 1e9:.1f}",
            f"{run.cost.cpu_s / run.scene.side**2 * 1e9:.1f}",
            f"{run.decoding_s:.2f}",
        ]
        for run in runs
    ]
    return with_provenance(f"Medians of {rounds}.\n\n" + rows(heads, cells))


def pixel_types(runs: Sequence[Run], rounds: int) -> str:
    """Whole processes on different pixel types; ratios are relative to the first."""
    heads = ["", "wall s", "CPU s", "peak MB", "ns / decoded byte", "ratio", "decoding once s"]
    per_byte = [run.cost.wall_s / run.decoded_bytes * 1e9 for run in runs]
    cells = [
        [run.scene.title, *_cost(run.cost), f"{ns:.1f}", f"{ns / per_byte[0]:.2f}", f"{run.decoding_s:.2f}"]
        for run, ns in zip(runs, per_byte, strict=True)
    ]
    return with_provenance(f"Medians of {rounds}.\n\n" + rows(heads, cells))


def reuse(side: int, found: Reuse, rounds: int) -> str:
    """A second range from a saved block map."""
    heads = ["", "wall s", "CPU s", "peak MB", "wall / first"]
    named = {
        "`extract RASTER`": found.first,
        "`divide RASTER`": found.division,
        "`extract blocks.tif`, another range, unrefined": found.second,
    }
    cells = [
        [title, *_cost(spent), f"{spent.wall_s / found.first.wall_s:.2f}"] for title, spent in named.items()
    ]
    summary = (
        f"Within one process, with imports and kernels loaded: first range {found.first_s:.2f} s, "
        f"second range from the block map {found.second_s:.2f} s, ratio {found.second_s / found.first_s:.2f}."
    )
    return with_provenance(f"{side}², medians of {rounds}.\n\n{rows(heads, cells)}\n\n{summary}")


def commands(found: Mapping[str, Mapping[str, Mapping[int, Cost]]], rounds: int) -> str:
    """Commands that read a whole raster, by pixel type and side; the first is the unit of CPU time."""
    parts = [f"Medians of {rounds}."]
    for pixels, by_command in found.items():
        first, *_ = by_command.values()
        sides = sorted(first)
        cells = [
            [
                name,
                *(f"{costs[side].wall_s:.2f}" for side in sides),
                _slope(sides, [costs[side].wall_s for side in sides]),
                *(f"{costs[side].peak_bytes / 1e6:.0f}" for side in sides),
                f"{costs[sides[-1]].cpu_s / first[sides[-1]].cpu_s:.2f}",
            ]
            for name, costs in by_command.items()
        ]
        heads = ["", *(f"{side}² s" for side in sides), "slope"]
        heads += [*(f"{side}² MB" for side in sides), "CPU / first"]
        parts.append(f"### {pixels}\n\n{rows(heads, cells)}")
    return with_provenance("\n\n".join(parts))


def _slope(sides: Sequence[int], seconds: Sequence[float]) -> str:
    """Return the exponent of the number of pixels in the time of the two largest; 1 is linear."""
    if len(sides) < 2:
        return ""
    return f"{math.log(seconds[-1] / seconds[-2]) / math.log((sides[-1] / sides[-2]) ** 2):.2f}"


def threads(side: int, found: Sequence[tuple[int, float, float]], rounds: int) -> str:
    """Speed-up by threads, and that of independent work."""
    _, one, alone = found[0]
    cells = [
        [str(count), f"{segmenting:.2f}", f"{one / segmenting:.2f}", f"{alone / computing:.2f}"]
        for count, segmenting, computing in found
    ]
    heads = ["threads", "segmentation s", "speed-up", "speed-up of independent work"]
    return with_provenance(f"{side}², medians of {rounds}.\n\n" + rows(heads, cells))


def vectors(found: Vectorised, rounds: int) -> str:
    """A label image to polygons."""
    cells = [
        ["**uavseg**: `trace.trace`, `Shapes`, all threads", f"{found.uavseg_s:.2f}", "1.00"],
        ["the same, one thread", f"{found.one_thread_s:.2f}", f"{found.one_thread_s / found.uavseg_s:.2f}"],
        [
            "rasterio.features.shapes, shapely.geometry.shape",
            f"{found.rasterio_s:.2f}",
            f"{found.rasterio_s / found.uavseg_s:.2f}",
        ],
    ]
    summary = (
        f"{found.regions} regions in {found.parts} connected parts, {found.vertices} vertices; "
        f"{found.identical} parts have identical rings in both results. Medians of {rounds}."
    )
    return with_provenance(f"{summary}\n\n{rows(['', 's', 'ratio'], cells)}")


def _cost(spent: Cost) -> list[str]:
    return [f"{spent.wall_s:.2f}", f"{spent.cpu_s:.2f}", f"{spent.peak_bytes / 1e6:.0f}"]


def paths(searches: Sequence[Search]) -> str:
    """Seconds of shortest paths, also relative to uavseg."""
    heads = ["", "library", "seconds", "cost", "seconds / uavseg"]
    cells = [
        [s.field, s.library, f"{s.seconds:.4f}", f"{s.cost:,.1f}", f"{s.seconds / s.uavseg_s:,.1f}"]
        for s in searches
    ]
    return with_provenance(f"{rows(heads, cells)}\n\nscikit-image cuts corners, so its paths may be shorter.")


def accuracy(scores: Sequence[Score], hazards: Sequence[Hazard]) -> str:
    """Intersection over union of states, and the share of obstacles that is classified as free."""
    parts = []
    for scene in dict.fromkeys(score.scene for score in scores):
        cells = [
            [s.method, *(f"{value:.3f}" for value in (s.free, s.unknown, s.occupied)), f"{s.noise:.1f}"]
            for s in scores
            if s.scene == scene
        ]
        heads = ["intersection over union", "free", "unknown", "occupied", "noise objects"]
        parts += [f"### {scene}", rows(heads, cells)]
    found = [
        [hazard.map, f"{hazard.cells:,}", f"{hazard.before:.0%}", f"{hazard.after:.0%}"] for hazard in hazards
    ]
    if found:
        heads = ["real map", "cells with v > 0.502", "classified as free", "after refinement"]
        parts += ["### thin walls", rows(heads, found)]
    return "\n\n".join(parts)


def obstacles(kept: Sequence[Kept]) -> str:
    """Obstacles that states lose with the method of the paper and with the default method."""
    heads = ["map", "obstacles", "lost", "cells kept", "noise objects", "IoU of free", "CPU, ms"]
    cells = [
        [
            k.map,
            f"{k.obstacles:,}",
            _pair("{:,}", k.lost),
            _pair("{:.1%}", k.cells),
            _pair("{}", k.noise),
            _pair("{:.3f}", k.free),
            _pair("{:.1f}", k.cpu_ms),
        ]
        for k in kept
    ]
    return with_provenance(rows(heads, cells))


def _pair(form: str, values: Sequence[float]) -> str:
    return " / ".join(form.format(value) for value in values)


def small_maps(tasks: Sequence[Task]) -> str:
    """Milliseconds on maps of 320 x 320 cells."""
    cells = [[task.title, f"{task.lens_ms:.1f}", f"{task.circles_ms:.1f}"] for task in tasks]
    return with_provenance(rows(["320 x 320 cells", "lens, ms", "circles, ms"], cells))


def robot(steps: Sequence[Step]) -> str:
    """Times of incremental occupancy mapping."""
    heads = ["", "ms", "merging", "segmenting", "blocks", "remark"]
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
    return with_provenance(rows(heads, cells))


def with_provenance(text: str) -> str:
    """A text, and below it the date, the machine and the versions of its measurement."""
    return f"{text}\n\n*{datetime.date.today().isoformat()}: {machine()}. {software()}.*"


def replace_section(document: str, section: str, text: str) -> str:
    """Replace the text between the markers of a section.

    Raises
    ------
    ValueError
        If the document has no such markers.

    Examples
    --------
    >>> replace_section("<!-- a -->old<!-- /a -->, and more", "a", "new")
    '<!-- a -->\\n\\nnew\\n\\n<!-- /a -->, and more'
    """
    first, last = f"<!-- {section} -->", f"<!-- /{section} -->"
    before, found, rest = document.partition(first)
    _, ended, after = rest.partition(last)
    if not found or not ended:
        raise ValueError(f"the document has no markers {first} and {last}")
    return f"{before}{first}\n\n{text}\n\n{last}{after}"


def write_section(section: str, text: str, path: Path = README) -> None:
    """Write a section of a document."""
    path.write_text(replace_section(path.read_text(), section, text))


def mean_rows(found: Mapping[str, Sequence[Sequence[float]]], names: Sequence[str]) -> str:
    """A row with the number and the means of the values of each name, "all" last.

    Parameters
    ----------
    found : mapping of str to sequence of sequences of float
    names : sequence of str
        Title of the names, of the number, and of each value.
    """
    lines = [
        [
            name,
            str(len(values)),
            *(f"{sum(column) / len(values):.3f}" for column in zip(*values, strict=True)),
        ]
        for name, values in sorted(found.items(), key=lambda item: (item[0] == "all", item[0]))
    ]
    return rows(names, lines)
