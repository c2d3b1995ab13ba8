"""Collars: constant pixels around the picture of a raster, which are not tagged as nodata."""
