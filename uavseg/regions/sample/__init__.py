"""Regions like a sample: its pixels and texture model, scores of cells, rejection of unlike cells."""
