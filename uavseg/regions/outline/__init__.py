"""Region outlines along pixel edges: traced per tile, linked to rings, stitched, rasterised."""
