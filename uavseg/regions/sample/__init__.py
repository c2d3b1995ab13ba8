"""Regions like a sample: where it lies, its model, scores of cells, rejection."""
