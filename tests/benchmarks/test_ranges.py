"""The benchmark of proposed ranges: its pictures are what they say, and its scores are overlaps."""

from itertools import islice
from pathlib import Path

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


@pytest.mark.slow
def test_real_pictures_have_a_good_range_among_three(shared_data: Path) -> None:
    """Floods and plants of a field need a part of a class; lists that are bad have a warning."""
    found: dict[str, list[float]] = {}
    silent = 0
    for picture in ranges.pictures(shared_data / "labelled"):
        if not picture.family.startswith("real"):
            break
        first, best = ranges.scores(picture, ranges.by_suggest(picture))
        assert 0 <= first <= best <= 1
        found.setdefault(picture.family, []).append(best)
        silent += best < ranges.BAD and not ranges.suggested(picture).warnings
    means = {family: float(np.mean(scores)) for family, scores in found.items()}
    assert means["real, flood"] > 0.39 and means["real, crop"] > 0.33 and means["real, town"] > 0.31
    assert means["real, pond"] > 0.75 and means["real, mine"] > 0.22 and silent <= 3


def test_scores_are_overlaps_with_the_first_and_the_best_of_three() -> None:
    v = np.full((128, 192), 0.3)
    v[:, 128:] = 0.8
    truth = v > 0.5
    picture = ranges._drawn("halves", v, [truth, ~truth])
    assert ranges.scores(picture, [(0.0, 0.5)]) == (1.0, 0.5)
    assert ranges.scores(picture, [(0.9, 1.0), (0.5, 1.0), (0.0, 0.5)]) == (0.0, 1.0)
    for propose in ranges.METHODS.values():
        assert ranges.scores(picture, propose(picture))[1] == 1.0
