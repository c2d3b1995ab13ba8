"""Scores of scenes put together: means over seeds and families, and everybody's best setting."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import astuple, dataclass, field

import numpy as np

from benchmarks.quality.methods import Kind, Method
from benchmarks.quality.metrics import Marks
from benchmarks.quality.run import Score
from benchmarks.quality.scenes import FAMILIES

Choice = Callable[[str, str], Method]
"""Which setting of somebody (the second) is looked at in a family (the first)."""


@dataclass(frozen=True)
class Summary:
    """Means over the seeds of every family.

    Parameters
    ----------
    scores : sequence of Score
    """

    scores: Sequence[Score]
    _means: dict[tuple[str, Method], tuple[Marks, float]] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        found: dict[tuple[str, Method], list[Score]] = {}
        for score in self.scores:
            found.setdefault((score.family, score.method), []).append(score)
        means = {
            key: (mean_marks(score.marks for score in here), float(np.mean([score.cpu_s for score in here])))
            for key, here in found.items()
        }
        object.__setattr__(self, "_means", means)

    @property
    def families(self) -> list[str]:
        """In the order of the scores."""
        return list(dict.fromkeys(family for family, _ in self._means))

    @property
    def ranged(self) -> list[str]:
        """The families whose things a range can find."""
        return [family for family in self.families if not FAMILIES[family].by_texture]

    @property
    def methods(self) -> list[Method]:
        """In the order of the scores."""
        return list(dict.fromkeys(method for _, method in self._means))

    def who(self, kind: Kind) -> list[str]:
        """Those of a kind, in the order of the scores."""
        return list(dict.fromkeys(method.who for method in self.methods if method.kind == kind))

    def marks(self, family: str, method: Method) -> Marks:
        """Means over the seeds."""
        return self._means[family, method][0]

    def iou(self, family: str, method: Method) -> float:
        """Mean over the seeds."""
        return self.marks(family, method).iou

    def default(self, _family: str, who: str) -> Method:
        """Somebody's default setting, whatever the family."""
        return next(method for method in self.methods if method.who == who and method.default)

    def best(self, family: str, who: str) -> Method:
        """The setting with which somebody's IoU is the largest in a family; the first of equals."""
        return max(
            (method for method in self.methods if method.who == who), key=lambda one: self.iou(family, one)
        )

    def over(self, families: Iterable[str], method: Callable[[str], Method]) -> tuple[Marks, float, float]:
        """Means of marks over families, the smallest IoU of a family, and mean processor time."""
        found = [self._means[family, method(family)] for family in families]
        all_marks = [marks for marks, _ in found]
        least = min(marks.iou for marks in all_marks)
        return mean_marks(all_marks), least, float(np.mean([cpu_s for _, cpu_s in found]))


def chosen(choice: Choice, who: str) -> Callable[[str], Method]:
    """Somebody's setting in each family."""
    return lambda family: choice(family, who)


def mean_marks(marks: Iterable[Marks]) -> Marks:
    """The mean of each mark.

    Examples
    --------
    >>> mean_marks([Marks(1, 1, 0, 1, 0), Marks(0, 0.5, 2, 3, 0)])
    Marks(iou=0.5, boundary_f=0.75, vi=1.0, pieces=2.0, area_error=0.0)
    """
    return Marks(*np.mean([astuple(one) for one in marks], axis=0).tolist())
