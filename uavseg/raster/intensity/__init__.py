"""Intensity to grey: stretch, quantisation, histograms, Otsu thresholds."""
