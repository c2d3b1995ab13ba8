"""True areas and lengths in any coordinate reference system."""
