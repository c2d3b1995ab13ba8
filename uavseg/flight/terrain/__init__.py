"""Terrain following: heights above an elevation model, added points, speeds of legs, ground clearance."""
