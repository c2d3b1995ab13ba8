"""Flights over the ground of an elevation model: heights, added points, speeds on slopes, the way home."""
