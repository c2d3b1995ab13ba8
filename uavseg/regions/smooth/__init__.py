"""Smooth outlines: boundaries relaxed within half a pixel, shared borders stay shared."""
