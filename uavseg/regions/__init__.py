"""Labels become polygons with what is known of them."""
