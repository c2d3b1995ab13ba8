"""One job over each of many rasters."""
