"""The section `quality` of ``python -m benchmarks``."""

from collections.abc import Callable, Sequence

from benchmarks.quality.methods import methods
from benchmarks.quality.run import scores
from benchmarks.quality.scenes import FAMILIES
from benchmarks.quality.tables import tables


def quality(
    seeds: int, refinements: Sequence[str], families: Sequence[str] | None, report: Callable[[str], None]
) -> str:
    """Tables of all methods on all or some families, as Markdown.

    Parameters
    ----------
    seeds : int
        Number of scenes of each family.
    refinements : sequence of str
        Refinements of uavseg in addition to those that are always measured.
    families : sequence of str, optional
        Keys of `FAMILIES`; all by default.
    report : callable
        Receives a line for each finished scene.

    Raises
    ------
    uavseg.errors.ParameterError
        If a refinement is unknown.
    """
    return tables(scores(methods(refinements), seeds, families or list(FAMILIES), report=report), seeds)


def select_families(prefixes: Sequence[str]) -> list[str]:
    """Families whose names begin with one of these prefixes.

    Raises
    ------
    ValueError
        If no family matches.

    Examples
    --------
    >>> select_families(["roads", "san"])
    ['roads, noise 0.05', 'roads, noise 0.15', 'sand']
    """
    found = [family for family in FAMILIES if family.startswith(tuple(prefixes))]
    if not found:
        raise ValueError(f"no family begins with {' or '.join(prefixes)}; there are {'; '.join(FAMILIES)}")
    return found
