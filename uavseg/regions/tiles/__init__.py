"""Regions of a raster tile by tile: of one range, of several classes, or of whole cells."""
