"""Regions of a raster, tile by tile: one range, several kinds, or a block map alone."""
