"""Regions of a raster tile by tile: of one range, of several kinds of cells, or from a block map alone."""
