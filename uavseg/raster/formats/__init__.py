"""Rasters written: GeoTIFF, tiles under a VRT, PNG."""
