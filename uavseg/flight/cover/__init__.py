"""Coverage of a region with lines: cells, strips, corridors, and the order of lines."""
