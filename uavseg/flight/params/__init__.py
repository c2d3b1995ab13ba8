"""Parameters of a flight: pattern, limits, terrain, and the plan that holds them."""
