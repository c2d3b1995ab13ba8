"""Short tours over stops with several options (generalised travelling salesman problem)."""
