"""Windowed reads of one raster or a mosaic, from files, arrays and open datasets."""
