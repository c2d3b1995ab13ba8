"""Free space of a flight: keep-out zones, and shortest paths around them."""
