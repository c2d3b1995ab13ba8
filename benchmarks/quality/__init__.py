"""Segmentation quality: seeded scenes with ground truth, metrics, and the methods to compare.

``python -m benchmarks --quality`` runs it; docs/quality.md holds the tables and explains them.
"""
