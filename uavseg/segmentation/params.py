"""Parameters of the segmentation, checked when they are made."""

from dataclasses import dataclass
from math import inf
from typing import Literal

from uavseg.errors import ParameterError

Method = Literal["paper", "adaptive"]
Refinement = Literal["none", "scan", "smooth", "tv"]


@dataclass(frozen=True, slots=True)
class DivisionParams:
    """When a block is divided into its four children.

    Parameters
    ----------
    threshold : float
        X: a block is divided where R = G_max / G_min is larger.
    step : float
        Tau: a block is also divided where the means of its children differ by more; infinite for no
        intensity test.
    """

    threshold: float
    step: float


@dataclass(frozen=True, slots=True)
class SegmentParams:
    """Parameters of the segmentation.

    Parameters
    ----------
    method : {"adaptive", "paper"}
        Division by texture and intensity, or by texture alone.
    threshold : float
        X, at least 0: a block is divided where R = G_max / G_min is larger.
    intensity_step : float
        Tau, 0 to 1: the adaptive method also divides where the means of the children differ by more.
    refine : {"tv", "scan", "none", "smooth"}
        Refinement of boundaries to the pixel. The default is total variation, and scans with the paper's
        method.

    Raises
    ------
    ParameterError
        If a parameter is out of bounds.
    """

    method: Method = "adaptive"
    threshold: float = 1.2
    intensity_step: float = 0.05
    refine: Refinement = None  # type: ignore[assignment]  # the default depends on the method

    def __post_init__(self) -> None:
        if self.refine is None:
            object.__setattr__(self, "refine", "scan" if self.method == "paper" else "tv")  # type: ignore[unreachable]
        if self.method not in ("paper", "adaptive"):
            raise ParameterError(f"a method is paper or adaptive, not {self.method!r}")
        if self.refine not in ("none", "scan", "smooth", "tv"):
            raise ParameterError(f"a refinement is none, scan, smooth or tv, not {self.refine!r}")
        if not self.threshold >= 0:
            raise ParameterError(f"the threshold X of the division is at least 0, not {self.threshold:g}")
        if not 0 <= self.intensity_step <= 1:
            raise ParameterError(f"an intensity step lies in 0..1, not {self.intensity_step:g}")

    @property
    def division(self) -> DivisionParams:
        """X, and tau as the method applies it: the paper's method has no intensity test."""
        return DivisionParams(self.threshold, self.intensity_step if self.method == "adaptive" else inf)
