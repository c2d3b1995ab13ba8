"""Labels to polygons with attributes."""
