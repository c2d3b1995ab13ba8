"""Edits of regions: small holes and regions, elimination, adjacency, simplification."""
