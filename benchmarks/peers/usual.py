"""A script as in the usual tutorials, with scipy, rasterio and geopandas: ``usual.py RASTER OUTPUT``."""

import sys

import geopandas
import numpy as np
import rasterio
import rasterio.features
import shapely.geometry
from scipy import ndimage

LOW = 0.55
MIN_PIXELS = 64
RED, GREEN, BLUE = 0.2126, 0.7152, 0.0722

raster, output = sys.argv[1:]
with rasterio.open(raster) as file:
    bands = file.read()
    transform, crs = file.transform, file.crs

white = np.iinfo(bands.dtype).max if bands.dtype.kind == "u" else 1.0
if len(bands) == 3:
    intensity = RED * bands[0].astype("float32") + GREEN * bands[1] + BLUE * bands[2]
else:
    intensity = bands[0].astype("float32")
smooth = ndimage.gaussian_filter(intensity / np.float32(white), sigma=1)

labels, count = ndimage.label(smooth >= LOW)
sizes = np.bincount(labels.ravel(), minlength=count + 1)
labels[sizes[labels] < MIN_PIXELS] = 0

geometries, numbers = [], []
for polygon, number in rasterio.features.shapes(labels, labels > 0, transform=transform):
    geometries.append(shapely.geometry.shape(polygon))
    numbers.append(int(number))
geopandas.GeoDataFrame({"id": numbers}, geometry=geometries, crs=crs).to_file(output, driver="GPKG")
