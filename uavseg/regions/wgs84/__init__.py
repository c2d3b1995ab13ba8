"""Polygons in WGS 84: reprojected, densified, cut at the antimeridian, rounded."""
