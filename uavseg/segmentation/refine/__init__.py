"""Refinement of region boundaries to the pixel: scans, total variation, specks."""
