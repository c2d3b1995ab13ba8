"""What a job reads: rasters, maps and block maps, and how they are opened."""
