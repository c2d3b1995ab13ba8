"""Log-odds to probabilities and grey."""

import numpy as np

from uavseg.occupancy.mapping.log_odds import add_one_free, free_only_values, probabilities_and_grey


def test_probabilities_are_those_of_the_log_odds() -> None:
    odds = np.linspace(-6, 6, 100_001).astype(np.float32)
    p, grey = probabilities_and_grey(odds)
    exact = 1 / (1 + np.exp(-odds.astype(np.float64)))
    assert np.abs(p - exact).max() < 4e-8
    assert (p == exact.astype(np.float32)).mean() > 0.9999
    assert (np.diff(p) >= 0).all() and (np.diff(grey.astype(int)) >= 0).all()
    assert probabilities_and_grey(np.zeros(1, np.float32))[0] == 0.5


def test_cells_with_free_observations_only_have_the_values_of_their_log_odds() -> None:
    odds, p, grey = free_only_values()
    assert odds[0] == 0 and (np.diff(odds) < 0).all()
    assert all(odds[k + 1] == add_one_free(odds[k]) for k in range(3))
    assert add_one_free(odds[3]) == odds[3]  # the minimum: more observations change nothing
    assert all(
        (found == of_odds).all()
        for found, of_odds in zip((p, grey), probabilities_and_grey(odds), strict=True)
    )
