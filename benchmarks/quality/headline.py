"""The main comparison: uavseg with its defaults against the best peer of each family."""

from benchmarks.quality.methods import Method
from benchmarks.quality.summary import SettingChoice, Summary, in_each_family
from benchmarks.table import rows

TOLERANCE = 0.01  # IoU by which a family may be behind the best peer's default
_HEADS = (
    *("", "uavseg", "best peer, default", "peer"),
    *("best peer, best setting", "peer and setting", "uavseg minus default"),
)


def headline(summary: Summary) -> str:
    """IoU of each family, and means."""
    cells = [[family, *_row(summary, [family])] for family in summary.families]
    cells.append(["**mean**", *_row(summary, summary.families)])
    if summary.separable:
        cells.append(["**mean without equal-mean families**", *_row(summary, summary.separable)])
    return rows(_HEADS, cells)


def _row(summary: Summary, families: list[str]) -> list[str]:
    """uavseg, and the peers with the largest mean IoU over these families."""
    ours = _iou(summary, families, "uavseg", summary.default)
    default, best = (_best_peer(summary, families, choice) for choice in (summary.default, summary.best))
    theirs = _iou(summary, families, default, summary.default)
    tuned = _iou(summary, families, best, summary.best)
    setting = f": {summary.best(families[0], best).setting}" if len(families) == 1 else ""
    return [f"{ours:.3f}", f"{theirs:.3f}", default, f"{tuned:.3f}", best + setting, f"{ours - theirs:+.3f}"]


def findings(summary: Summary) -> str:
    """The main figures, and the families where the default is behind; without the equal-mean families."""
    families = summary.separable
    if not families:
        return "Only equal-mean families, which no range can separate."
    ours = summary.aggregate(families, in_each_family(summary.default, "uavseg"))[0]
    name = _best_peer(summary, families, summary.best)
    theirs = summary.aggregate(families, in_each_family(summary.best, name))[0]
    best = summary.aggregate(families, lambda family: _best_method(summary, family, summary.best))[0]
    behind = [family for family in families if _behind(summary, family) > TOLERANCE]
    return "\n".join(
        [
            f"- Mean IoU: uavseg {ours.iou:.3f}; {name} at its best setting in each family {theirs.iou:.3f}; "
            f"the best peer of each family at its best setting {best.iou:.3f}.",
            f"- Regions per true region: uavseg {ours.region_ratio:.2f}; {name} {theirs.region_ratio:.2f}.",
            f"- uavseg is more than {TOLERANCE:g} behind the best peer's default in {len(behind)} of "
            f"{len(families)} families: {', '.join(behind) or 'none'}.",
        ]
    )


def _behind(summary: Summary, family: str) -> float:
    """IoU by which the default is behind the best peer's default."""
    theirs = summary.iou(family, _best_method(summary, family, summary.default))
    return theirs - summary.iou(family, summary.default(family, "uavseg"))


def _best_method(summary: Summary, family: str, choice: SettingChoice) -> Method:
    return choice(family, _best_peer(summary, [family], choice))


def _best_peer(summary: Summary, families: list[str], choice: SettingChoice) -> str:
    return max(summary.names("peer"), key=lambda name: _iou(summary, families, name, choice))


def _iou(summary: Summary, families: list[str], name: str, choice: SettingChoice) -> float:
    return summary.aggregate(families, in_each_family(choice, name))[0].iou
