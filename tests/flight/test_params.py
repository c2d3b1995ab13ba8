"""Parameters of a mission check themselves."""

import math
from typing import Any

import pytest

from uavseg.errors import ParameterError
from uavseg.flight.params.plan import PlanParams


@pytest.mark.parametrize(
    "params",
    [
        {"altitude_m": 0},
        {"altitude_m": -5},
        {"altitude_m": 1001},
        {"altitude_m": math.nan},
        {"speed_m_s": 0},
        {"speed_m_s": 51},
        {"pattern": "spiral"},
        {"autopilot": "dji"},
        {"pattern": "survey"},
        {"spacing_m": 10},
        {"angle_deg": 10},
        {"pattern": "survey", "spacing_m": 0},
        {"pattern": "survey", "spacing_m": 10, "angle_deg": math.inf},
        {"tolerance_m": -1},
    ],
)
def test_parameters_check_themselves(params: dict[str, Any]) -> None:
    with pytest.raises(ParameterError):
        PlanParams(**{"altitude_m": 60} | params)
