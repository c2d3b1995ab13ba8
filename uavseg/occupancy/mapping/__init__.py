"""Occupancy grids: log-odds, the beam model, live segmentation."""
