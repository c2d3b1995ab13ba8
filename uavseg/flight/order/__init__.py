"""The order of places: short tours over stops with several options (generalised travelling salesman)."""
