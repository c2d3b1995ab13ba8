"""Log-odds to probabilities and grey."""

import numpy as np

from uavseg.occupancy.mapping.log_odds import probabilities_and_grey


def test_probabilities_are_those_of_the_log_odds() -> None:
    odds = np.linspace(-6, 6, 100_001).astype(np.float32)
    p, grey = probabilities_and_grey(odds)
    exact = 1 / (1 + np.exp(-odds.astype(np.float64)))
    assert np.abs(p - exact).max() < 4e-8
    assert (p == exact.astype(np.float32)).mean() > 0.9999
    assert (np.diff(p) >= 0).all() and (np.diff(grey.astype(int)) >= 0).all()
    assert probabilities_and_grey(np.zeros(1, np.float32))[0] == 0.5
