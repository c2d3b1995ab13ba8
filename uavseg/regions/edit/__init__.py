"""Edit regions: fill small holes, drop or eliminate small regions, simplify outlines; region adjacency."""
