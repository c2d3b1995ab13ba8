"""The selected method for proposed ranges is the best one on scenes with known classes."""

from collections.abc import Iterable

import numpy as np
import pytest

pytest.importorskip("scipy")

from benchmarks import suggestions
from benchmarks.classscenes import FAMILIES, HELD_OUT

pytestmark = pytest.mark.slow

SAMPLE = dict(list((FAMILIES | HELD_OUT).items())[::2])
SELECTED = "multi-Otsu, number by valleys (selected)"


@pytest.fixture(scope="module")
def scored() -> list[suggestions.Score]:
    return list(suggestions.scores(SAMPLE, [200]))


def mean(values: Iterable[float]) -> float:
    return float(np.mean(list(values)))


def test_the_selected_method_is_the_best(scored: list[suggestions.Score]) -> None:
    rows = {method: [row for row in scored if row.method == method] for method in suggestions.METHODS}
    given = {method: mean(row.given for row in own) for method, own in rows.items()}
    estimated = {method: mean(row.estimated for row in own) for method, own in rows.items()}
    assert given[SELECTED] == max(given.values()) and estimated[SELECTED] == max(estimated.values())


def test_the_number_of_classes_is_correct_in_nine_scenes_of_ten(scored: list[suggestions.Score]) -> None:
    assert mean(row.correct for row in scored if row.method == SELECTED) >= 0.9


def test_only_the_true_classes_have_full_overlap() -> None:
    truth = FAMILIES["three even"](1).truth
    assert suggestions.overlap((truth + 1).astype(np.uint8), truth) == 1
    assert suggestions.overlap(np.ones(truth.shape, np.uint8), truth) < 0.4


def test_the_table_names_every_family(scored: list[suggestions.Score]) -> None:
    text = suggestions.table(scored)
    assert all(f"| {name} |" in text for name in [*SAMPLE, *suggestions.METHODS])
