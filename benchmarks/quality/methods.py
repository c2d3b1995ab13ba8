"""The methods that are compared: each one segments a scene into a mask, with one of its settings."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

from benchmarks.quality import ours, peers
from benchmarks.quality.camera import Mask
from benchmarks.quality.scenes import Scene

Kind = Literal["uavseg", "peer", "target"]


@dataclass(frozen=True, slots=True)
class Method:
    """A method with one setting.

    Parameters
    ----------
    name, setting : str
        Together they identify it.
    segment : callable
        From a scene to a mask; picklable.
    kind : {"uavseg", "peer", "target"}
        A target is listed below the peers and does not count as one.
    default : bool
        Whether this is the method's default setting.
    crop : int, optional
        Side of the central square of a scene that a slow method is restricted to.
    """

    name: str
    setting: str
    segment: Callable[[Scene], Mask]
    kind: Kind = "peer"
    default: bool = False
    crop: int | None = None

    @property
    def key(self) -> tuple[str, str]:
        """Unique identifier."""
        return self.name, self.setting


def methods(refinements: Sequence[str] = ()) -> list[Method]:
    """All methods, uavseg also with additional refinements.

    Parameters
    ----------
    refinements : sequence of str
        See `ours.settings`.
    """
    return _ours(refinements) + [method for rows in _PEERS for method in rows]


def _ours(refinements: Sequence[str]) -> list[Method]:
    return [
        Method("uavseg", name, partial(ours.extracted, params=params), "uavseg", name == ours.DEFAULT)
        for name, params in ours.settings(refinements).items()
    ]


def _with_settings(
    name: str,
    segment: Callable[..., Mask],
    settings: Sequence[dict[str, Any]],
    kind: Kind = "peer",
    crop: int | None = None,
) -> list[Method]:
    """A method with its settings, the default one first."""
    return [
        Method(name, _setting_text(setting), partial(segment, **setting), kind, k == 0, crop)
        for k, setting in enumerate(settings)
    ]


def _setting_text(setting: dict[str, Any]) -> str:
    return ", ".join(f"{name} {value:g}" for name, value in setting.items() if value is not None)


_BLURS = [{"sigma": sigma} for sigma in (1, 0, 0.7, 1.5, 2, 3, 4, 6)]
_FELZENSZWALB = [
    {"scale": scale, "sigma": sigma, "min_size": 20}
    for scale, sigma in ((1, 0.8), (10, 0.8), (100, 0.8), (1, 2), (10, 2))
]
_SLIC = [
    {"pixels": pixels, "compactness": compactness, "sigma": sigma}
    for pixels, compactness, sigma in (
        (None, 10, 0),
        (50, 0.1, 1),
        (50, 0.05, 2),
        (200, 0.1, 1),
        (200, 0.05, 2),
    )
]
_WALKS = [{"beta": beta, "sigma": sigma} for beta, sigma in ((130, 1), (130, 2), (1000, 1), (1000, 3))]
_CONTOURS = [{"mu": mu} for mu in (0.25, 0.05)]
_PEERS = [
    _with_settings("blur and threshold", peers.blur_threshold, _BLURS),
    _with_settings("Otsu", peers.otsu, [{"sigma": sigma} for sigma in (0, 0.7, 1, 1.5, 2, 3, 4)]),
    _with_settings("felzenszwalb", peers.felzenszwalb_segments, _FELZENSZWALB),
    _with_settings("SLIC", peers.slic_segments, _SLIC),
    _with_settings("random walker", peers.random_walk, _WALKS),
    _with_settings("Chan-Vese", peers.chan_vese, _CONTOURS, crop=256),
    _with_settings("total variation", peers.denoised, [{"times": times} for times in (2, 1)], "target"),
]
