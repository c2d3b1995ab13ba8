"""SLIC superpixels of scikit-image, selected by their mean and merged: ``slic.py RASTER OUTPUT``."""

import sys

import geopandas
import numpy as np
import rasterio
import rasterio.features
import shapely.geometry
from skimage.measure import label
from skimage.segmentation import slic

LOW = 0.55
MIN_PIXELS = 64
PIXELS_PER_SEGMENT = 600
RED, GREEN, BLUE = 0.2126, 0.7152, 0.0722

raster, output = sys.argv[1:]
with rasterio.open(raster) as file:
    bands = file.read()
    transform, crs = file.transform, file.crs

white = np.iinfo(bands.dtype).max if bands.dtype.kind == "u" else 1.0
bands = bands.astype("float32") / np.float32(white)
image = RED * bands[0] + GREEN * bands[1] + BLUE * bands[2] if len(bands) == 3 else bands[0]

segments = slic(
    image, n_segments=image.size // PIXELS_PER_SEGMENT, compactness=0.1, channel_axis=None, start_label=0
)
means = np.bincount(segments.ravel(), image.ravel()) / np.bincount(segments.ravel())
labels = label((means >= LOW)[segments], connectivity=1).astype("int32")
labels[np.bincount(labels.ravel())[labels] < MIN_PIXELS] = 0

geometries, numbers = [], []
for polygon, number in rasterio.features.shapes(labels, labels > 0, transform=transform):
    geometries.append(shapely.geometry.shape(polygon))
    numbers.append(int(number))
geopandas.GeoDataFrame({"id": numbers}, geometry=geometries, crs=crs).to_file(output, driver="GPKG")
