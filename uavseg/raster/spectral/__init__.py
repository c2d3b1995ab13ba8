"""Spectral bands by name, spectral indices and band arithmetic."""
