"""Patterns of a flight over regions: points, outlines, lines and circles, with notes for the pilot."""
