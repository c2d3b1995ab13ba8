"""Polygons become a mission that flies."""
