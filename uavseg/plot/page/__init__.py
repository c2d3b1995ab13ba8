"""The page of a picture: frame, map furniture, polygons, PNG file."""
