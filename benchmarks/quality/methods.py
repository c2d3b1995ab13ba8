"""Who is measured: each method makes a mask of a scene, with one of its settings."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

from benchmarks.quality import ours, peers
from benchmarks.quality.camera import Mask
from benchmarks.quality.scenes import Scene

Kind = Literal["ours", "peer", "beyond"]


@dataclass(frozen=True, slots=True)
class Method:
    """A method with one setting.

    Parameters
    ----------
    who, setting : str
        Together they name it.
    find : callable
        From a scene to a mask; it must survive pickling.
    kind : {"ours", "peer", "beyond"}
        Beyond the peers is what nobody runs by default, as a goal.
    default : bool
        Whether this is the setting that one gets by naming none.
    middle : int, optional
        Only the square of this side in the middle of a scene is looked at: the method is slow.
    """

    who: str
    setting: str
    find: Callable[[Scene], Mask]
    kind: Kind = "peer"
    default: bool = False
    middle: int | None = None

    @property
    def key(self) -> tuple[str, str]:
        """Its name."""
        return self.who, self.setting


def methods(words: Sequence[str] = ()) -> list[Method]:
    """Everybody; us also with these words of refinement.

    Parameters
    ----------
    words : sequence of str
        See `ours.settings`.
    """
    return _ours(words) + [method for rows in _PEERS for method in rows]


def _ours(words: Sequence[str]) -> list[Method]:
    return [
        Method("uavseg", name, partial(ours.extracted, params=params), "ours", name == ours.DEFAULT)
        for name, params in ours.settings(words).items()
    ]


def _several(
    who: str,
    find: Callable[..., Mask],
    settings: Sequence[dict[str, Any]],
    kind: Kind = "peer",
    middle: int | None = None,
) -> list[Method]:
    """A method with its settings, the default one first."""
    return [
        Method(who, _told(setting), partial(find, **setting), kind, k == 0, middle)
        for k, setting in enumerate(settings)
    ]


def _told(setting: dict[str, Any]) -> str:
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
_SNAKES = [{"mu": mu} for mu in (0.25, 0.05)]
_PEERS = [
    _several("blur and threshold", peers.blurred, _BLURS),
    _several("Otsu", peers.otsu, [{"sigma": sigma} for sigma in (0, 0.7, 1, 1.5, 2, 3, 4)]),
    _several("felzenszwalb", peers.felzenszwalbs, _FELZENSZWALB),
    _several("SLIC", peers.superpixels, _SLIC),
    _several("random walker", peers.walked, _WALKS),
    _several("Chan-Vese", peers.chan_vese, _SNAKES, middle=256),
    _several("total variation", peers.denoised, [{"times": times} for times in (2, 1)], "beyond"),
]
