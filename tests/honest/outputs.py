"""Files of regions, read by GDAL and shapely: the pixels, the numbers and the order of the label raster."""

import json
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

import geopandas
import numpy as np
import rasterio
import shapely
from pyproj import CRS, Transformer

from tests.honest import plain
from tests.honest.findings import command, differ, far, no_constant, unlike
from tests.honest.picture import any_file, any_picture, any_shape, quiet
from tests.hostile.judging import Finding

SUFFIXES = ("geojson", "gpkg", "fgb", "shp", "kml", "parquet")


def case(rng: Random, folder: Path) -> Iterator[Finding]:
    """Regions and their labels, written by the command."""
    picture = any_picture(rng, any_shape(rng, 300))
    path = folder / any_file(rng, folder, picture)
    truth = plain.read(path, (1, 2, 3) if len(picture.values) == 3 else (1,))
    if not truth.valid.any():
        return
    suffix = rng.choice(SUFFIXES if truth.crs is not None else SUFFIXES[1:4])
    low, high = picture.span
    words = [f"--stretch={low!r},{high!r}", "--collar", "keep", "--threads", 1, "--labels", "labels.tif"]
    ends = round(0.5 * rng.random(), 2), round(0.51 + 0.49 * rng.random(), 2)
    refine = rng.choice(["none", "tv"])
    command(
        *("extract", path.name, "--range", f"{ends[0]},{ends[1]}", "--refine", refine, "-o", f"o.{suffix}"),
        *words,
    )
    about = f"{suffix}"
    with quiet(), rasterio.open(folder / "labels.tif") as file:
        labels, transform, crs = file.read(1), file.transform, file.crs
    yield from differ("LABELS PLACE", about, (labels.shape, str(crs)), (truth.valid.shape, str(_crs(path))))
    if not transform.almost_equals(truth.transform, 1e-12):
        yield Finding("LABELS PLACE", about, f"{transform}, not {truth.transform}")
    yield from unlike("LABELS", about, (labels > 0) & ~truth.valid, np.zeros(labels.shape, bool))
    yield from read_back(folder / f"o.{suffix}", labels, truth, about)


def _crs(path: Path) -> Any:
    with quiet(), rasterio.open(path) as file:
        return file.crs


def read_back(path: Path, labels: Any, truth: plain.Plain, about: str) -> Iterator[Finding]:
    """A file of regions against the labels."""
    with quiet():
        frame = geopandas.read_parquet(path) if path.suffix == ".parquet" else geopandas.read_file(path)
    count = int(labels.max())
    yield from differ("COUNT", about, len(frame), count)
    if len(frame) != count or not count:
        return
    if path.suffix == ".kml":
        frame["id"] = frame["Name"]  # GDAL takes the id of a placemark for a field of this name
    frame["id"] = frame["id"].astype(int)
    if path.suffix == ".fgb":
        frame = frame.sort_values("id", ignore_index=True)  # stored by place
    ids = frame["id"].tolist()
    yield from differ("ORDER", about, ids, list(range(1, count + 1)))
    pixels = np.bincount(labels.ravel(), minlength=count + 1)[1:]
    yield from differ("PIXELS", about, [int(n) for n in frame["pixels"]], pixels.tolist())
    place = frame.geometry.values[:12]
    if path.suffix in (".geojson", ".kml") and truth.crs is not None:
        place = _back(place, frame.crs, truth)
    for number, polygon in zip(ids, place, strict=False):
        covered = plain.drawn_pixels(
            list(getattr(polygon, "geoms", [polygon])), labels.shape, truth.transform
        )
        if not np.array_equal(covered, labels == number):
            wrong = np.argwhere(covered != (labels == number))
            yield Finding("PLACE", about, f"id {number}: {len(wrong)} pixels differ, the first at {wrong[0]}")
            break
    if not shapely.is_valid(frame.geometry.values).all():
        yield Finding("GEOMETRY", about, str(shapely.is_valid_reason(frame.geometry.values)[:5]))
    area = plain.area_m2(labels > 0, truth.transform, truth.crs)
    yield from far("AREA", about, float(np.sum(frame["area_m2"].astype(float))), area, 2e-6, 1e-3 * count)
    if path.suffix == ".geojson":
        json.loads(path.read_text(encoding="utf-8"), parse_constant=no_constant)


def _back(polygons: Any, crs: Any, truth: plain.Plain) -> Any:
    """Polygons in degrees as those in the system of their raster, around it."""
    target = CRS.from_user_input(truth.crs)
    transformer = Transformer.from_crs(crs, target, always_xy=True)
    own = truth.transform
    middle = (own * (truth.valid.shape[1] / 2, truth.valid.shape[0] / 2))[0]

    def moved(xy: Any) -> Any:
        x, y = transformer.transform(xy[:, 0], xy[:, 1])
        if target.is_geographic:
            x = x + 360 * np.round((middle - x) / 360)
        return np.column_stack([x, y])

    return shapely.transform(np.asarray(polygons, object), moved)
