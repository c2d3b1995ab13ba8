"""Classes and breaks: what belongs to which, and what is refused."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from uavseg.errors import IntensityRangeError, ParameterError
from uavseg.segmentation.params.segment import (
    Breaks,
    IntensityRange,
    Levels,
    ValueClass,
    ValueClasses,
    partition_of_levels,
)

V = np.arange(65536) / 65535


def classes(*ranges: tuple[float, float]) -> ValueClasses:
    return ValueClasses(tuple(ValueClass(f"c{n}", IntensityRange(*pair)) for n, pair in enumerate(ranges)))


@settings(max_examples=60)
@given(st.lists(st.integers(0, 65535), min_size=2, max_size=8, unique=True), st.randoms())
def test_a_grey_has_the_class_in_whose_range_it_lies_and_a_shared_end_the_lower(greys, random) -> None:  # type: ignore[no-untyped-def]
    ends = [grey / 65535 for grey in sorted(greys)]
    ranges = list(pairwise(ends))[:: random.choice([1, 2])]
    random.shuffle(ranges)
    table = classes(*ranges).partition.grey_table
    for n, (low, high) in enumerate(ranges):
        own = (low <= V) & (high >= V)
        if any(other[1] == low for other in ranges):
            own &= low < V
        assert np.array_equal(table == n + 1, own)
    if len(ranges) == 1:
        assert np.flatnonzero(table)[[0, -1]].tolist() == list(IntensityRange(*ranges[0]).greys)


def test_levels_of_a_width_are_breaks_at_its_edges() -> None:
    levels = Levels(0.3)
    assert partition_of_levels(levels) == partition_of_levels(Breaks(levels.edges))
    assert partition_of_levels(levels).grey_table.tolist()[:: 65535 // 3] == [1, 2, 3, 4]


@pytest.mark.parametrize("pairs", [((0, 0.4), (0.3, 0.5)), ((0.3, 0.5), (0, 1)), ((0.2, 0.6), (0.2, 0.6))])
def test_classes_that_overlap_are_refused_by_name(pairs: tuple[tuple[float, float], ...]) -> None:
    with pytest.raises(IntensityRangeError, match=r"c\d .* and c\d .* overlap"):
        classes(*pairs)


def test_names_of_classes_are_there_and_differ() -> None:
    half, rest = IntensityRange(0, 0.5), IntensityRange(0.5, 1)
    with pytest.raises(ParameterError, match="2 classes have the name a"):
        ValueClasses((ValueClass("a", half), ValueClass("a", rest)))
    with pytest.raises(ParameterError, match="has no name"):
        ValueClass(" ", half)
    for name in ("a\nb", "a\x00", "x" * 81):
        with pytest.raises(ParameterError, match="printable"):
            ValueClass(name, half)
    with pytest.raises(ParameterError, match="1 to 127 classes, got 0"):
        ValueClasses(())
    ends = np.linspace(0, 1, 129)
    with pytest.raises(ParameterError, match="1 to 127 classes, got 128"):
        classes(*pairwise(ends.tolist()))


@pytest.mark.parametrize("edges", [(0.5, 0.2), (0.5, 0.5), (0.0, 0.5), (0.5, 1.0), (float("nan"),)])
def test_breaks_increase_between_0_and_1(edges: tuple[float, ...]) -> None:
    with pytest.raises(ParameterError, match="breaks increase"):
        Breaks(edges)
