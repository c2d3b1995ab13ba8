"""Heights of the ground from elevation models (DEM): files, units, and interpolation at positions."""
