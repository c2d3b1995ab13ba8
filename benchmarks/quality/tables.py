"""What was measured, as Markdown."""

from collections.abc import Callable
from importlib.metadata import version

from benchmarks.quality.methods import Method
from benchmarks.quality.run import Score
from benchmarks.quality.summary import Choice, Summary
from benchmarks.table import rows

ALLOWED = 0.01  # how much worse than the best peer's default a family may be


def tables(scores: list[Score], seeds: int) -> str:
    """All tables, the one that decides first."""
    summary = Summary(scores)
    parts = [
        f"Means over {seeds} scenes of each family; scikit-image {version('scikit-image')}.",
        *("### Intersection over union", _headline(summary), _verdict(summary)),
        *("### All marks, means over the families that a range can find", _all_marks(summary)),
        *("### Our settings, intersection over union", _ours(summary)),
        *("### Everybody else, intersection over union at the default and at the best setting",),
        *(_others(summary), "### Their best settings", _settings(summary)),
    ]
    return "\n\n".join(parts)


def _headline(summary: Summary) -> str:
    heads = ["", "uavseg", "best peer, default", "", "best peer, best setting", "", "uavseg against default"]
    cells = [[family, *_compared(summary, family)] for family in summary.families]
    return rows(heads, cells + _means_of(summary))


def _compared(summary: Summary, family: str) -> list[str]:
    us = summary.iou(family, _us(summary))
    peers = summary.who("peer")
    default = summary.best_of(family, peers, summary.default)
    best = summary.best_of(family, peers, summary.best)
    theirs = summary.iou(family, default)
    return [
        *(f"{us:.3f}", f"{theirs:.3f}", default.who),
        *(f"{summary.iou(family, best):.3f}", f"{best.who}: {best.setting}", f"{us - theirs:+.3f}"),
    ]


def _means_of(summary: Summary) -> list[list[str]]:
    found = []
    for title, families in (("mean", summary.families), ("mean without equal means", summary.ranged)):
        if not families:
            continue
        (us, _, _), default, best = (
            summary.over(families, lambda _: _us(summary)),
            _best_peer(summary, families, summary.default),
            _best_peer(summary, families, summary.best),
        )
        theirs = _mean_iou(summary, families, default, summary.default)
        most = _mean_iou(summary, families, best, summary.best)
        found.append(
            [
                *(f"**{title}**", f"{us.iou:.3f}", f"{theirs:.3f}", default),
                *(f"{most:.3f}", best, f"{us.iou - theirs:+.3f}"),
            ]
        )
    return found


def _verdict(summary: Summary) -> str:
    """What the default is to reach, and where it does not."""
    families = summary.ranged
    if not families:
        return ""
    us = summary.over(families, lambda _: _us(summary))[0]
    best = _best_peer(summary, families, summary.best)
    theirs = summary.over(families, lambda family: summary.best(family, best))[0]
    behind = [family for family in summary.families if float(_compared(summary, family)[-1]) < -ALLOWED]
    return "\n".join(
        [
            f"- Mean IoU without equal means: uavseg {us.iou:.3f}; {best} at its best setting in each family "
            f"{theirs.iou:.3f}.",
            f"- Regions per true region: uavseg {us.pieces:.2f}; {best} {theirs.pieces:.2f}.",
            f"- Families where uavseg is more than {ALLOWED:g} behind the best peer's default: "
            f"{', '.join(behind) or 'none'}.",
        ]
    )


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
            cells.append(_marks_row(summary, f"{_name(summary, who)}, {title}", _chosen(choice, who)))
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


def _us(summary: Summary) -> Method:
    return summary.default("", "uavseg")


def _best_peer(summary: Summary, families: list[str], choice: Choice) -> str:
    return max(summary.who("peer"), key=lambda who: _mean_iou(summary, families, who, choice))


def _mean_iou(summary: Summary, families: list[str], who: str, choice: Choice) -> float:
    return summary.over(families, _chosen(choice, who))[0].iou


def _chosen(choice: Choice, who: str) -> Callable[[str], Method]:
    return lambda family: choice(family, who)


def _name(summary: Summary, who: str) -> str:
    middle = summary.default("", who).middle
    return who if middle is None else f"{who} ({middle}²)"
