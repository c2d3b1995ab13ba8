"""Estimates in words, the same wherever a flight is described."""

import math


def estimate_text(distance_m: float, duration_s: float) -> str:
    """Length and duration of flights.

    Examples
    --------
    >>> estimate_text(4410.3, 425)
    '4.41 km, about 7 min 05 s'
    """
    return f"{distance_m / 1000:.2f} km, {duration_text(duration_s)}"


def duration_text(seconds: float | None) -> str:
    """A duration in words: about 7 min 05 s; a sum of waits may be larger than any number."""
    if seconds is None or not math.isfinite(seconds):
        return "without end"
    minutes, rest = divmod(round(seconds), 60)
    return f"about {minutes} min {rest:02d} s"
