"""Ranges in words: exactly one of three kinds, and errors that name the kind that was meant."""

from typing import Any

import numpy as np
import pytest

import uavseg
from uavseg.errors import IntensityRangeError, ParameterError
from uavseg.options.classes import AnyRange, parse_range, requested_range
from uavseg.options.regions import RangeOptions
from uavseg.raster.intensity.value_range import ValueRange
from uavseg.segmentation.params.segment import IntensityRange


def range_of_words(interval: Any, values: Any, percentile: Any) -> AnyRange:
    return requested_range(RangeOptions(range=interval, values=values, percentile=percentile))


@pytest.mark.parametrize("word", ["0.5,1", (0.5, 1), [0.5, 1.0], np.array([0.5, 1])])
def test_a_range_is_two_numbers_or_a_text(word: Any) -> None:
    assert range_of_words(word, None, None) == IntensityRange(0.5, 1)


@pytest.mark.parametrize(
    ("text", "low", "high"),
    [("20,40", 20, 40), ("300,", 300, None), (" , -3.5", None, -3.5), ("1e3,2e3", 1e3, 2e3)],
)
def test_ends_of_values_may_be_left_out(text: str, low: float | None, high: float | None) -> None:
    assert parse_range("--values", text) == range_of_words(None, (low, high), None) == ValueRange(low, high)
    assert range_of_words(None, text, None) == ValueRange(low, high)


def test_percentiles_are_ranks() -> None:
    assert parse_range("--percentile", "90,") == ValueRange(90, None, by_rank=True)


@pytest.mark.parametrize("words", [(None, None, None), ((0, 1), (3, 4), None), (None, "3,4", "5,6")])
def test_exactly_one_kind_is_given(words: tuple[Any, Any, Any]) -> None:
    with pytest.raises(ParameterError, match="a range is one of range"):
        range_of_words(*words)


@pytest.mark.parametrize(
    "word", ["3", "a,b", "1,2,3", "nan,2", "", (1,), (1, 2, 3), ("1", 2), (True, 2), 7, (float("inf"), 3)]
)
def test_what_is_no_range_is_refused(word: Any) -> None:
    with pytest.raises(ParameterError):
        range_of_words(None, word, None)
    with pytest.raises(ParameterError):
        range_of_words(word, None, None)


def test_a_range_of_v_is_not_open() -> None:
    for word in ("0.5,", (None, 1)):
        with pytest.raises(ParameterError):
            range_of_words(word, None, None)


@pytest.mark.parametrize(
    ("ends", "texts", "absent"),
    [
        ((140, 255), ["values=(140,255)"], ["percentile"]),
        ((55, 100), ["values=(55,100)", "percentile=(55,100)"], []),
        ((-5, 20), ["values=(-5,20)"], ["percentile"]),
        ((1, 0.5), [], ["values", "percentile"]),
    ],
)
def test_a_range_beyond_v_says_what_was_meant(
    ends: tuple[float, float], texts: list[str], absent: list[str]
) -> None:
    with pytest.raises(IntensityRangeError) as caught:
        uavseg.extract(np.zeros((64, 64)), ends)
    assert all(text in str(caught.value) for text in texts)
    assert not any(word in str(caught.value) for word in absent)


def test_a_path_takes_values() -> None:
    field = np.full((64, 64), 20, np.uint8)
    field[:, 30:34] = 200
    field[40:44] = 20
    ways = [
        uavseg.path(field, given, (2, 2), (60, 2), values=values)
        for given, values in (((0, 0.45), None), (None, (None, 114)))
    ]
    assert ways[0].xy.tolist() == ways[1].xy.tolist()
    with pytest.raises(uavseg.errors.PathError):
        uavseg.path(field, None, (2, 2), (60, 2), values=(None, 10))
