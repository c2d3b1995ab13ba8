"""Opening of raster files that may be hostile: drivers by extension, named files, sizes."""
