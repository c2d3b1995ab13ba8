"""Aggregated scores: means over seeds and families, and the best setting of each method."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import astuple, dataclass, field

import numpy as np

from benchmarks.quality.methods import Kind, Method
from benchmarks.quality.metrics import Metrics
from benchmarks.quality.run import Score
from benchmarks.quality.scenes import FAMILIES

SettingChoice = Callable[[str, str], Method]
"""Selects the setting of a method for a family: (family, method name) -> method."""


@dataclass(frozen=True)
class Summary:
    """Means over the seeds of every family.

    Parameters
    ----------
    scores : sequence of Score
    """

    scores: Sequence[Score]
    _means: dict[tuple[str, Method], tuple[Metrics, float]] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        found: dict[tuple[str, Method], list[Score]] = {}
        for score in self.scores:
            found.setdefault((score.family, score.method), []).append(score)
        means = {
            key: (
                mean_metrics(score.metrics for score in group),
                float(np.mean([score.cpu_s for score in group])),
            )
            for key, group in found.items()
        }
        object.__setattr__(self, "_means", means)

    @property
    def families(self) -> list[str]:
        """In the order of the scores."""
        return list(dict.fromkeys(family for family, _ in self._means))

    @property
    def separable(self) -> list[str]:
        """Families whose objects a range can separate from the background."""
        return [family for family in self.families if not FAMILIES[family].equal_means]

    @property
    def methods(self) -> list[Method]:
        """In the order of the scores."""
        return list(dict.fromkeys(method for _, method in self._means))

    def names(self, kind: Kind) -> list[str]:
        """Names of the methods of a kind, in the order of the scores."""
        return list(dict.fromkeys(method.name for method in self.methods if method.kind == kind))

    def metrics(self, family: str, method: Method) -> Metrics:
        """Mean of each metric over the seeds."""
        return self._means[family, method][0]

    def iou(self, family: str, method: Method) -> float:
        """Mean IoU over the seeds."""
        return self.metrics(family, method).iou

    def default(self, _family: str, name: str) -> Method:
        """The default setting of a method, whatever the family."""
        return next(method for method in self.methods if method.name == name and method.default)

    def best(self, family: str, name: str) -> Method:
        """The setting of a method with the largest IoU in a family; the first one in case of ties."""
        return max(
            (method for method in self.methods if method.name == name),
            key=lambda method: self.iou(family, method),
        )

    def aggregate(
        self, families: Iterable[str], method: Callable[[str], Method]
    ) -> tuple[Metrics, float, float]:
        """Mean metrics over families, the smallest IoU of a family, and the mean processor time."""
        found = [self._means[family, method(family)] for family in families]
        per_family = [one for one, _ in found]
        minimum = min(one.iou for one in per_family)
        return mean_metrics(per_family), minimum, float(np.mean([cpu_s for _, cpu_s in found]))


def in_each_family(choice: SettingChoice, name: str) -> Callable[[str], Method]:
    """The selected setting of a method, as a function of the family."""
    return lambda family: choice(family, name)


def mean_metrics(metrics: Iterable[Metrics]) -> Metrics:
    """The mean of each metric.

    Examples
    --------
    >>> mean_metrics([Metrics(1, 1, 0, 1, 0), Metrics(0, 0.5, 2, 3, 0)])
    Metrics(iou=0.5, boundary_f=0.75, vi=1.0, region_ratio=2.0, area_error=0.0)
    """
    return Metrics(*np.mean([astuple(one) for one in metrics], axis=0).tolist())
