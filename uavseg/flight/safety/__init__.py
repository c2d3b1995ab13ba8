"""Safety of flights: keep-out zones, home, fence, and the check of a mission before it is flown."""
