"""The search for a tour of many stops ends soon after Ctrl-C."""

import signal
import time
from types import FrameType

import numpy as np
import pytest

from uavseg.flight.order.tour import Stops, local_search_tour


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="there is no timer on Windows")
def test_a_long_search_can_be_interrupted() -> None:
    def interrupt(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    xy = np.random.default_rng(0).random((3000, 2))
    distances = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    stops = Stops.of([np.array([[n, n]]) for n in range(1, len(xy))])
    local_search_tour(
        Stops.of([np.array([[n, n]]) for n in range(1, 20)]), distances, 0, 0, 1
    )  # compiled by now
    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        begun = time.monotonic()
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        with pytest.raises(KeyboardInterrupt):
            local_search_tour(stops, distances, 0, 0)
        assert time.monotonic() - begun < 10
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
