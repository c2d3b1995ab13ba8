"""The table that decides: uavseg by default beside whoever is best in each family."""

from benchmarks.quality.methods import Method
from benchmarks.quality.summary import Choice, Summary, chosen
from benchmarks.table import rows

ALLOWED = 0.01  # how much worse than the best peer's default a family may be
_HEADS = ("", "uavseg", "best peer, default", "", "best peer, best setting", "", "uavseg against default")


def headline(summary: Summary) -> str:
    """IoU of each family, and means."""
    cells = [[family, *_row(summary, [family])] for family in summary.families]
    cells.append(["**mean**", *_row(summary, summary.families)])
    if summary.ranged:
        cells.append(["**mean without equal means**", *_row(summary, summary.ranged)])
    return rows(_HEADS, cells)


def _row(summary: Summary, families: list[str]) -> list[str]:
    """Us, and who of the others has the largest mean over these families."""
    us = _iou(summary, families, "uavseg", summary.default)
    default, best = (_best_peer(summary, families, choice) for choice in (summary.default, summary.best))
    theirs = _iou(summary, families, default, summary.default)
    most = _iou(summary, families, best, summary.best)
    setting = f": {summary.best(families[0], best).setting}" if len(families) == 1 else ""
    return [f"{us:.3f}", f"{theirs:.3f}", default, f"{most:.3f}", best + setting, f"{us - theirs:+.3f}"]


def verdict(summary: Summary) -> str:
    """What the default is to reach, and where it does not; families of equal means do not count."""
    families = summary.ranged
    if not families:
        return "Only families of equal means, which no range finds."
    us = summary.over(families, chosen(summary.default, "uavseg"))[0]
    who = _best_peer(summary, families, summary.best)
    theirs = summary.over(families, chosen(summary.best, who))[0]
    anybody = summary.over(families, lambda family: _whoever(summary, family, summary.best))[0]
    behind = [family for family in families if _behind(summary, family) > ALLOWED]
    return "\n".join(
        [
            f"- Mean IoU: uavseg {us.iou:.3f}; {who} at its best setting in each family {theirs.iou:.3f}; "
            f"whoever is best in each family, at the best setting, {anybody.iou:.3f}.",
            f"- Regions per true region: uavseg {us.pieces:.2f}; {who} {theirs.pieces:.2f}.",
            f"- uavseg is more than {ALLOWED:g} behind the best peer's default in {len(behind)} of "
            f"{len(families)} families: {', '.join(behind) or 'none'}.",
        ]
    )


def _behind(summary: Summary, family: str) -> float:
    """How far the default is behind the best peer's default."""
    theirs = summary.iou(family, _whoever(summary, family, summary.default))
    return theirs - summary.iou(family, summary.default(family, "uavseg"))


def _whoever(summary: Summary, family: str, choice: Choice) -> Method:
    return choice(family, _best_peer(summary, [family], choice))


def _best_peer(summary: Summary, families: list[str], choice: Choice) -> str:
    return max(summary.who("peer"), key=lambda who: _iou(summary, families, who, choice))


def _iou(summary: Summary, families: list[str], who: str, choice: Choice) -> float:
    return summary.over(families, chosen(choice, who))[0].iou
