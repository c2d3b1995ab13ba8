"""Files to grey tiles with a georeference: reading, mosaics, stretch, geodesy, label rasters."""
