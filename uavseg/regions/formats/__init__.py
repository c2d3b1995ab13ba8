"""Region files: GeoJSON, GeoPackage, FlatGeobuf, Parquet, Shapefile, KML, and label rasters."""
