"""Cameras: ground sampling distance, footprint, overlap, and the cameras that operators own."""
