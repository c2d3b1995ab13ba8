"""Simulated scenes and range finders."""
