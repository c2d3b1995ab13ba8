"""Estimates in words, the same wherever a flight is described."""


def estimate_text(distance_m: float, duration_s: float) -> str:
    """Length and duration of flights.

    Examples
    --------
    >>> estimate_text(4410.3, 425)
    '4.41 km, about 7 min 05 s'
    """
    return f"{distance_m / 1000:.2f} km, about {duration_text(duration_s)}"


def duration_text(seconds: float) -> str:
    """A duration in words: 7 min 05 s."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s"
