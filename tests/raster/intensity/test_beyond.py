"""What the stretch clips, in greys."""

import numpy as np

from uavseg.raster.intensity.stretch import _LIMIT, Stretch, greys_beyond


def test_values_near_the_largest_float_are_bounded_without_a_warning() -> None:
    """numpy's warnings are errors here."""
    values = np.array([[[0.0, 2.0, 1e308, -1e308]]])
    stretch = Stretch(0.0, 1.5, "percentile:2,98")
    grey = np.array([[0, 65535, 65535, 0]], np.uint16)
    found = greys_beyond(values, None, grey, stretch)
    assert found is not None
    assert found.tolist() == [[0, round(65535 * (2 / 1.5 - 1)), _LIMIT, -_LIMIT]]


def test_nothing_lies_beyond_a_stretch_that_is_infinitely_wide() -> None:
    values = np.array([[[-1.7e308, 0.0, 1.7e308]]])
    stretch = Stretch(-1.7e308, 1.7e308, "minmax")
    assert greys_beyond(values, None, np.array([[0, 0, 65535]], np.uint16), stretch) is None
