"""Path planning over free cells: A*, clearance, any-angle paths."""
