"""Texture similarity: G against a sample, likelihood ratios."""
