"""Retransmission timer: how long to wait before a message is repeated."""

FIRST_S = 0.5  # before a round trip was measured
SHORTEST_S, LONGEST_S = 0.1, 1.5
QUICK = 4  # repetitions
_ROUND_TRIPS = 3.0
_SMOOTHING = 0.2


class Patience:
    """Waiting time that follows the round trips of a link, and doubles after the fourth repetition.

    The first repetitions are quick, because a vehicle may give up after few (MAVSDK after five, or 2.5 s). A
    fixed time does not fit all links: 250 ms repeat a third of all messages over a telemetry radio, and are
    long over a network. Round trips of repeated messages are not measured, because the answer may be to any
    of them (Karn and Partridge, 1987, "Improving Round-Trip Time Estimates in Reliable Transport Protocols").

    Examples
    --------
    >>> patience = Patience()
    >>> patience.wait_s
    0.5
    >>> patience.answered(0.06)
    >>> round(patience.wait_s, 3)
    0.18
    >>> for _ in range(6):
    ...     patience.repeated()
    >>> round(patience.wait_s, 3)
    0.72
    """

    def __init__(self) -> None:
        self._round_trip_s: float | None = None
        self._repeats = 0

    @property
    def wait_s(self) -> float:
        """Seconds to wait for an answer."""
        first = FIRST_S if self._round_trip_s is None else _ROUND_TRIPS * self._round_trip_s
        return float(min(max(first, SHORTEST_S) * 2 ** min(max(self._repeats - QUICK, 0), 10), LONGEST_S))

    def repeated(self) -> None:
        """A message had to be repeated."""
        self._repeats += 1

    def answered(self, seconds: float) -> None:
        """An answer came so many seconds after the message was sent, or sent last."""
        if not self._repeats:
            known = self._round_trip_s
            self._round_trip_s = seconds if known is None else known + _SMOOTHING * (seconds - known)
        self._repeats = 0
