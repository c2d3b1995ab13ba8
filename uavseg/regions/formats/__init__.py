"""Regions in files: GeoJSON, GeoPackage, FlatGeobuf, Parquet, Shapefile, KML, label rasters."""
