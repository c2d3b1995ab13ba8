"""Tests of how regions are drawn by their confidence."""

import numpy as np
import pytest

from uavseg.plot.layers.region_layer import PLAIN, styles_by_confidence


def test_higher_confidence_is_drawn_stronger():
    found = styles_by_confidence({"confidence": np.array([0.1, 0.95, 0.8, 0.79, 0.5])}, 5)
    assert [those.tolist() for _, those in found] == [
        [False, True, True, False, False],
        [False, False, False, True, True],
        [True, False, False, False, False],
    ]
    alphas = [style.alpha for style, _ in found]
    assert alphas == sorted(alphas, reverse=True) and len({style.line for style, _ in found}) == 3


def test_what_is_not_known_is_drawn_plainly():
    found = styles_by_confidence({"confidence": np.array([np.nan, 0.9])}, 2)
    assert found[-1][0] is PLAIN and found[-1][1].tolist() == [True, False]
    assert len(found) == 2


@pytest.mark.parametrize(
    "columns", [{}, {"confidence": np.array(["a", None], object)}, {"confidence": np.full(2, np.nan)}]
)
def test_without_numbers_all_are_plain(columns):
    [(style, those)] = styles_by_confidence(columns, 2)
    assert style is PLAIN and those.all()
