"""Covering a region with lines: strips, cells, the order of cells, and what footprints show."""
