"""A local server for maps of large rasters: the page of `uavseg map` with jobs."""
