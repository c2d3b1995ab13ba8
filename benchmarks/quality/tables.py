"""Results as Markdown tables."""

from collections.abc import Callable
from importlib.metadata import version

from benchmarks.quality.headline import findings, headline
from benchmarks.quality.methods import Method
from benchmarks.quality.run import Score
from benchmarks.quality.summary import Summary, in_each_family
from benchmarks.table import rows


def tables(scores: list[Score], seeds: int) -> str:
    """All tables, the main comparison first."""
    summary = Summary(scores)
    scenes = "One scene" if seeds == 1 else f"Means over {seeds} scenes"
    parts = [
        f"{scenes} of each family; scikit-image {version('scikit-image')}.",
        *("### Intersection over union", headline(summary), findings(summary)),
        *("### All metrics, means over the families with different mean intensities", _all_metrics(summary)),
        *("### Settings of uavseg, intersection over union", _settings_of_uavseg(summary)),
        *("### Peers, intersection over union with the default and with the best setting", _peers(summary)),
        *("### Best settings of the peers", _best_settings(summary)),
    ]
    return "\n\n".join(parts)


def _all_metrics(summary: Summary) -> str:
    heads = ["", "IoU", "minimum IoU", "boundary F", "VI, bits", "regions / true", "area error", "CPU s"]
    families = summary.separable
    if not families:
        return ""
    cells = [
        _metrics_row(summary, f"uavseg, {method.setting}", lambda _, method=method: method)  # type: ignore[misc]
        for method in summary.methods
        if method.kind == "uavseg"
    ]
    for name in [*summary.names("peer"), *summary.names("target")]:
        for title, choice in (("default", summary.default), ("best", summary.best)):
            cells.append(
                _metrics_row(
                    summary, f"{_column_title(summary, name)}, {title}", in_each_family(choice, name)
                )
            )
    return rows(heads, cells)


def _metrics_row(summary: Summary, title: str, method: Callable[[str], Method]) -> list[str]:
    metrics, minimum, cpu_s = summary.aggregate(summary.separable, method)
    return [
        *(title, f"{metrics.iou:.3f}", f"{minimum:.3f}", f"{metrics.boundary_f:.3f}", f"{metrics.vi:.3f}"),
        *(f"{metrics.region_ratio:.2f}", f"{metrics.area_error:.3f}", f"{cpu_s:.2f}"),
    ]


def _settings_of_uavseg(summary: Summary) -> str:
    ours = [method for method in summary.methods if method.kind == "uavseg"]
    cells = [
        [family, *(f"{summary.iou(family, method):.3f}" for method in ours)] for family in summary.families
    ]
    return rows(["", *(method.setting for method in ours)], cells)


def _peers(summary: Summary) -> str:
    peers = [*summary.names("peer"), *summary.names("target")]
    cells = [
        [
            family,
            *(
                f"{summary.iou(family, summary.default(family, name)):.3f} / "
                f"{summary.iou(family, summary.best(family, name)):.3f}"
                for name in peers
            ),
        ]
        for family in summary.families
    ]
    return rows(["", *(_column_title(summary, name) for name in peers)], cells)


def _best_settings(summary: Summary) -> str:
    peers = [*summary.names("peer"), *summary.names("target")]
    cells = [[family, *(summary.best(family, name).setting for name in peers)] for family in summary.families]
    defaults = ["*default*", *(summary.default("", name).setting for name in peers)]
    return rows(["", *peers], [defaults, *cells])


def _column_title(summary: Summary, name: str) -> str:
    crop = summary.default("", name).crop
    return name if crop is None else f"{name} ({crop}²)"
