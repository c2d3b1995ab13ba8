"""Ranges of v, of values and of percentiles, as requested and as detected."""
