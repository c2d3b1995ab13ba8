"""Smooth outlines: boundaries relaxed within half a pixel (surface nets), with shared borders kept shared."""
