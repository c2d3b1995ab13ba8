"""The content of a web map: picture and tiles in Web Mercator, cells and their values."""
