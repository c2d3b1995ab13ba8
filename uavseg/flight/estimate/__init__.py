"""Estimates of a flight: time with turns and acceleration, photographs, ground covered, energy."""
