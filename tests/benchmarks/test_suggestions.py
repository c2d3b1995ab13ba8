"""What is kept for proposing ranges is what proves best on scenes whose classes are known."""

from collections.abc import Iterable

import numpy as np
import pytest

pytest.importorskip("scipy")

from benchmarks import suggestions
from benchmarks.classscenes import FAMILIES, HELD_OUT

SOME = dict(list((FAMILIES | HELD_OUT).items())[::2])
KEPT = "multi-Otsu, number by valleys (kept)"


@pytest.fixture(scope="module")
def found() -> list[suggestions.Score]:
    return list(suggestions.scores(SOME, [200]))


def mean(values: Iterable[float]) -> float:
    return float(np.mean(list(values)))


def test_what_is_kept_is_best(found: list[suggestions.Score]) -> None:
    told = {who: mean(row.told for row in found if row.who == who) for who in suggestions.METHODS}
    alone = {who: mean(row.found for row in found if row.who == who) for who in suggestions.METHODS}
    assert told[KEPT] == max(told.values()) and alone[KEPT] == max(alone.values())


def test_the_number_of_classes_is_nearly_always_right(found: list[suggestions.Score]) -> None:
    assert mean(row.right for row in found if row.who == KEPT) >= 0.9


def test_the_truth_overlaps_with_itself_alone() -> None:
    truth = FAMILIES["three even"](1).truth
    assert suggestions.overlap((truth + 1).astype(np.uint8), truth) == 1
    assert suggestions.overlap(np.ones(truth.shape, np.uint8), truth) < 0.4


def test_the_table_names_every_family(found: list[suggestions.Score]) -> None:
    text = suggestions.table(found)
    assert all(f"| {name} |" in text for name in [*SOME, *suggestions.METHODS])
