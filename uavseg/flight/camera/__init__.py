"""Cameras: ground sampling distance, footprint, overlap, and a catalogue."""
