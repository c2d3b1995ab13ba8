"""Polygons in WGS 84: densified, split at the antimeridian, in seven decimals."""
