"""What was measured, as Markdown."""

from collections.abc import Callable
from importlib.metadata import version

from benchmarks.quality.headline import headline, verdict
from benchmarks.quality.methods import Method
from benchmarks.quality.run import Score
from benchmarks.quality.summary import Summary, chosen
from benchmarks.table import rows


def tables(scores: list[Score], seeds: int) -> str:
    """All tables, the one that decides first."""
    summary = Summary(scores)
    scenes = "One scene" if seeds == 1 else f"Means over {seeds} scenes"
    parts = [
        f"{scenes} of each family; scikit-image {version('scikit-image')}.",
        *("### Intersection over union", headline(summary), verdict(summary)),
        *("### All marks, means over the families that a range can find", _all_marks(summary)),
        *("### Our settings, intersection over union", _ours(summary)),
        *("### Everybody else, intersection over union at the default and at the best setting",),
        *(_others(summary), "### Their best settings", _settings(summary)),
    ]
    return "\n\n".join(parts)


def _all_marks(summary: Summary) -> str:
    heads = ["", "IoU", "least IoU", "boundary F", "VI, bits", "regions / true", "area error", "CPU s"]
    families = summary.ranged
    if not families:
        return ""
    cells = [
        _marks_row(summary, f"uavseg, {method.setting}", lambda _, method=method: method)  # type: ignore[misc]
        for method in summary.methods
        if method.kind == "ours"
    ]
    for who in [*summary.who("peer"), *summary.who("beyond")]:
        for title, choice in (("default", summary.default), ("best", summary.best)):
            cells.append(_marks_row(summary, f"{_name(summary, who)}, {title}", chosen(choice, who)))
    return rows(heads, cells)


def _marks_row(summary: Summary, title: str, method: Callable[[str], Method]) -> list[str]:
    marks, least, cpu_s = summary.over(summary.ranged, method)
    return [
        *(title, f"{marks.iou:.3f}", f"{least:.3f}", f"{marks.boundary_f:.3f}", f"{marks.vi:.3f}"),
        *(f"{marks.pieces:.2f}", f"{marks.area_error:.3f}", f"{cpu_s:.2f}"),
    ]


def _ours(summary: Summary) -> str:
    ours = [method for method in summary.methods if method.kind == "ours"]
    cells = [
        [family, *(f"{summary.iou(family, method):.3f}" for method in ours)] for family in summary.families
    ]
    return rows(["", *(method.setting for method in ours)], cells)


def _others(summary: Summary) -> str:
    others = [*summary.who("peer"), *summary.who("beyond")]
    cells = [
        [
            family,
            *(
                f"{summary.iou(family, summary.default(family, who)):.3f} / "
                f"{summary.iou(family, summary.best(family, who)):.3f}"
                for who in others
            ),
        ]
        for family in summary.families
    ]
    return rows(["", *(_name(summary, who) for who in others)], cells)


def _settings(summary: Summary) -> str:
    others = [*summary.who("peer"), *summary.who("beyond")]
    cells = [[family, *(summary.best(family, who).setting for who in others)] for family in summary.families]
    defaults = ["*the default*", *(summary.default("", who).setting for who in others)]
    return rows(["", *others], [defaults, *cells])


def _name(summary: Summary, who: str) -> str:
    middle = summary.default("", who).middle
    return who if middle is None else f"{who} ({middle}²)"
