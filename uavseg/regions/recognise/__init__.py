"""Measures of regions, and names for them by examples that fit what was seen of their outline."""
