"""The benchmark of proposed ranges: its pictures are what they say, and its scores are overlaps."""

from itertools import islice

import numpy as np
import pytest

from benchmarks import ranges


@pytest.mark.slow
def test_small_things_are_small_and_found() -> None:
    for picture in islice(ranges.small_things(7), 3):
        [truth] = picture.truths
        assert 0.002 < truth.mean() < 0.05 and picture.valid.all()
        first, best = ranges.scores(picture, ranges.by_suggest(picture))
        assert 0 <= first <= best <= 1 and best > 0.3


def test_scores_are_overlaps_with_the_first_and_the_best_of_three() -> None:
    v = np.full((128, 192), 0.3)
    v[:, 128:] = 0.8
    truth = v > 0.5
    picture = ranges._drawn("halves", v, [truth, ~truth])
    assert ranges.scores(picture, [(0.0, 0.5)]) == (1.0, 0.5)
    assert ranges.scores(picture, [(0.9, 1.0), (0.5, 1.0), (0.0, 0.5)]) == (0.0, 1.0)
    for propose in ranges.METHODS.values():
        assert ranges.scores(picture, propose(picture))[1] == 1.0
