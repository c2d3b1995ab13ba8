"""What commands print here depends neither on compiled kernels nor on how busy the machine is."""

import math

import pytest

from uavseg._jit import messages
from uavseg.execution import progress_bar


@pytest.fixture(autouse=True)
def compiled_silently(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(messages, "announce", lambda name: None)


@pytest.fixture(autouse=True)
def without_lines_of_long_phases(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress_bar, "_LINES_EACH_S", math.inf)
