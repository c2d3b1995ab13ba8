"""Simulated flights of planned missions, and the length and time of plans over many regions."""
