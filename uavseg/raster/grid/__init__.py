"""Georeference and integer arithmetic of windows, tiles and masks."""
