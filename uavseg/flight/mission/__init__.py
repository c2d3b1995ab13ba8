"""Missions as values: items, tracks, fences and the vehicle that flies them."""
