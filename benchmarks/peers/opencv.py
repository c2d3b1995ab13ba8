"""An optimised script with OpenCV: ``opencv.py RASTER OUTPUT``."""

import sys
from itertools import chain

import cv2
import numpy as np
import pyogrio.raw
import rasterio
import rasterio.features
import shapely

LOW = 0.55
MIN_PIXELS = 64
RED, GREEN, BLUE = 0.2126, 0.7152, 0.0722

raster, output = sys.argv[1:]
with rasterio.open(raster, num_threads="all_cpus") as file:
    image = file.read(1) if file.count == 1 else np.moveaxis(file.read((1, 2, 3)), 0, -1)
    transform, crs = file.transform, file.crs.to_string()

white = np.iinfo(image.dtype).max if image.dtype.kind == "u" else 1.0
if image.ndim == 3:
    image = cv2.transform(image, np.array([[RED, GREEN, BLUE]]))
image = cv2.GaussianBlur(image, (5, 5), 0, dst=image)
mask = cv2.compare(image, LOW * white, cv2.CMP_GE)
del image

# connectedComponents is multi-threaded, connectedComponentsWithStats is not: counting strip by strip is
# faster.
count, labels = cv2.connectedComponents(mask, connectivity=4, ltype=cv2.CV_32S)
sizes = np.zeros(count, np.int64)
for top in range(0, len(labels), 256):
    sizes += np.bincount(labels[top : top + 256].ravel(), minlength=count)
keep = (sizes >= MIN_PIXELS).astype(np.uint8)
keep[0] = 0
mask = keep[labels]
del labels

# Vectorised: one shapely call for all rings, one for all polygons.
rings, owners = [], []
for number, (polygon, _) in enumerate(
    rasterio.features.shapes(mask, mask, connectivity=4, transform=transform)
):
    rings += polygon["coordinates"]
    owners += [number] * len(polygon["coordinates"])
coordinates = np.fromiter(chain.from_iterable(chain.from_iterable(rings)), float).reshape(-1, 2)
of_ring = np.repeat(np.arange(len(rings)), [len(ring) for ring in rings])
polygons = shapely.polygons(shapely.linearrings(coordinates, indices=of_ring), indices=owners)

pyogrio.raw.write(
    output,
    geometry=shapely.to_wkb(polygons),
    field_data=[np.arange(1, len(polygons) + 1)],
    fields=["id"],
    geometry_type="Polygon",
    crs=crs,
    driver="GPKG",
)
