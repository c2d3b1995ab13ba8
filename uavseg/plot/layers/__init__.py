"""Layers of a picture, one file each."""
