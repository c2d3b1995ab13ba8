"""Parameters out of bounds are refused; the method decides what applies."""

from typing import Any

import numpy as np
import pytest

from uavseg.errors import ParameterError
from uavseg.segmentation.params.segment import DivisionParams, SegmentParams


def test_the_method_of_the_paper_scans_and_the_adaptive_one_denoises() -> None:
    assert (SegmentParams().refine, SegmentParams("paper").refine) == ("tv", "scan")
    assert SegmentParams("paper", refine="tv").refine == "tv"


@pytest.mark.parametrize(
    "bad, message",
    [
        ({"method": "fast"}, "paper or adaptive, not 'fast'"),
        ({"refine": "yes"}, "none, pixels, scan, smooth or tv, not 'yes'"),
        ({"threshold": -0.1}, "at least 0, not -0.1"),
        ({"threshold": np.nan}, "at least 0, not nan"),
        ({"intensity_step": 1.5}, r"lies in 0\.\.1, not 1.5"),
        ({"intensity_step": -1e-9}, r"lies in 0\.\.1, not -1e-09"),
        ({"intensity_step": np.nan}, r"lies in 0\.\.1, not nan"),
    ],
)
def test_a_bad_parameter_is_refused_with_what_it_should_be(bad: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        SegmentParams(**bad)


def test_the_method_of_the_paper_has_no_intensity_test() -> None:
    assert SegmentParams("paper", 1.3, 0.1).division == DivisionParams(1.3, np.inf)
    assert SegmentParams("adaptive", 1.3, 0.1).division == DivisionParams(1.3, 0.1)


def test_parameters_at_their_ends_are_allowed() -> None:
    for threshold, step in ((0, 0), (np.inf, 1)):
        SegmentParams(threshold=threshold, intensity_step=step)
