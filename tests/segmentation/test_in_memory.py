"""Segmentation of an array in memory agrees with the reference implementation."""

import numpy as np
import pytest

from uavseg.errors import IntensityRangeError
from uavseg.segmentation import in_memory
from uavseg.segmentation.params.segment import IntensityRange, SegmentParams


@pytest.mark.parametrize("seed", range(0, 40, 2))
@pytest.mark.parametrize("refine", ["scan", "smooth"])
def test_regions_of_an_array_are_those_of_the_reference(reference, seed, refine):
    values, valid, low, high = reference.random_raster(seed)
    lo, hi, threshold, tau = reference.random_choices(seed)
    grey = reference.grey(values, valid, low, high)
    method, step = ("paper", 0.0) if tau is None else ("adaptive", tau)
    params = SegmentParams(method, threshold, step, refine)
    labels = in_memory.label_regions(grey, IntensityRange(lo, hi), valid, params)
    if refine == "scan":
        expected = reference.extract(values, valid, low, high, lo, hi, X=threshold, tau=tau)
        assert np.array_equal(labels, expected)
    assert not labels[~valid].any()


def test_ratios_of_an_array_are_those_of_the_reference(reference):
    values, valid, low, high = reference.random_raster(3)
    grey = reference.grey(values, valid, low, high)
    blocks = in_memory.block_map_of_array(grey, valid)
    for (row, col, side), ratio in reference.ratios(grey, valid).items():
        many = 64 // side
        first = {64: 0, 32: 1, 16: 5}[side]
        place = first + row % 64 // side * many + col % 64 // side
        assert blocks.ratios[row // 64, col // 64, place] == pytest.approx(ratio, rel=1e-6)


def test_a_range_upside_down_is_refused():
    with pytest.raises(IntensityRangeError, match="low < high"):
        IntensityRange(0.7, 0.2)
