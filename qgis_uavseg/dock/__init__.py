"""The dock "Regions": a range over the histogram of a raster, regions to tick, and a mission over them."""
