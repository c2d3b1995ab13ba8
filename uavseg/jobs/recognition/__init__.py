"""Jobs that describe regions and name them."""
