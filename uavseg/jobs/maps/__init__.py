"""Jobs over occupancy maps: classify, build, merge, simulate, find a path."""
