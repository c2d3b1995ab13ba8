"""Blocks of TIFF files: which are stored, and which are damaged in ways that GDAL does not report."""
