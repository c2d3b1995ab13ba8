"""The section `quality` of ``python -m benchmarks``."""

from collections.abc import Callable, Sequence

from benchmarks.quality.methods import methods
from benchmarks.quality.run import scores
from benchmarks.quality.scenes import FAMILIES
from benchmarks.quality.tables import tables


def quality(
    seeds: int, words: Sequence[str], families: Sequence[str] | None, tell: Callable[[str], None]
) -> str:
    """Everybody on all families, or on some, as Markdown.

    Parameters
    ----------
    seeds : int
        Scenes of each family.
    words : sequence of str
        Refinements of uavseg beside those that are always measured.
    families : sequence of str, optional
        Keys of `FAMILIES`; all, if left out.
    tell : callable
        Told of every scene that is done.

    Raises
    ------
    uavseg.errors.ParameterError
        If a refinement is unknown.
    """
    return tables(scores(methods(words), seeds, families or list(FAMILIES), tell=tell), seeds)


def meant(beginnings: Sequence[str]) -> list[str]:
    """The families whose names begin so.

    Raises
    ------
    ValueError
        If there is none.

    Examples
    --------
    >>> meant(["roads", "san"])
    ['roads, noise 0.05', 'roads, noise 0.15', 'sand']
    """
    found = [family for family in FAMILIES if family.startswith(tuple(beginnings))]
    if not found:
        raise ValueError(f"no family begins with {' or '.join(beginnings)}; there are {'; '.join(FAMILIES)}")
    return found
