"""Every command over an honest raster: files that other readers open, or a refusal that names its reason."""

import json
from collections.abc import Iterator
from pathlib import Path
from random import Random

import geopandas
import numpy as np
import rasterio
import shapely
from PIL import Image

from tests.honest import plain
from tests.honest.findings import RefusedError, command, differ, digest, no_constant
from tests.honest.picture import any_file, any_picture, any_shape, quiet
from tests.hostile.judging import Finding

LINES = (
    "preview {} -o p.png --width 300",
    "map {} -o m.html",
    "suggest {}",
    "suggest {} --json",
    "info {}",
    "info {} --json",
    "levels {} --breaks otsu:3 -o r.gpkg",
    "levels {} --breaks quantile:4 -o r.fgb --min-area 9px",
    "levels {} --width 0.2 -o r.geojson",
    "extract {} --percentile 80,100 -o r.gpkg --labels l.tif",
    "extract {} --class low=0,0.4 --class high=0.4,1 -o r.gpkg --labels l.tif",
    "extract {} --range 0.4,1 -o r.gpkg --smooth-outline 0.3 --simplify 0.3",
    "extract {} --range 0.4,1 -o r.gpkg --regularize 3",
    "levels {} --width 0.2 -o r.gpkg --regularize 3",
    "extract {} --range 0.4,1 -o r.gpkg --refine pixels --connectivity 8",
    "levels {} --width 0.2 -o r.geojson --connectivity 8 --min-area 4px",
    "extract {} --range 0.4,1 -o r.gpkg --thin-lines",
    "extract {} --range 0.4,1 -o r.gpkg --detail 5px",
    "extract {} --range 0.4,1 -o r.gpkg --flatten 60px",
    "extract {} --range 0.3,1 -o r.gpkg --method paper --fill-holes 9px --min-area 4px",
    "divide {} -o b.tif",
    "original {} -o l.tif --sweeps 4",
)
REASONS = (  # for which an honest raster may be refused
    "it has no place on a map; give it one",
    "crosses the antimeridian, where a map in Web Mercator is cut",
    "a map in Web Mercator shows up to 85",
)


def case(rng: Random, folder: Path) -> Iterator[Finding]:
    """One command over one raster."""
    picture = any_picture(rng, any_shape(rng, 300))
    path = folder / any_file(rng, folder, picture)
    truth = plain.read(path, (1, 2, 3) if len(picture.values) == 3 else (1,))
    if not truth.valid.any():
        return
    words = rng.choice(LINES).format(path.name).split()
    about = " ".join(words[:1] + [word for word in words if word.startswith("--")])
    try:
        said = command(*words)
    except RefusedError as error:
        if not any(reason in str(error) for reason in REASONS):
            yield Finding("REFUSED", f"{about}: {digest(str(error))}", f"{picture.place}: {error}")
        return
    if "--json" in words:
        json.loads(said, parse_constant=no_constant)
    elif "-o" not in words:
        yield from differ("SILENT", about, bool(said.strip()), True)
    for made in folder.glob("[!xc]*"):  # beside the raster
        yield from opened(made, truth, about)


def opened(path: Path, truth: plain.Plain, about: str) -> Iterator[Finding]:
    """What another reader finds wrong with a file."""
    if path.suffix == ".png":
        with Image.open(path) as image:
            image.load()
    elif path.suffix == ".html":
        text = path.read_text(encoding="utf-8")
        for part in text.split('type="application/json"')[1:]:
            json.loads(part.split("</script>")[0].partition(">")[2], parse_constant=no_constant)
    elif path.suffix == ".tif":
        with quiet(), rasterio.open(path) as file:
            pixels = file.read(1)
        if path.name == "l.tif":
            yield from differ("LABELS", about, pixels.shape, truth.valid.shape)
            yield from differ("BEYOND", about, np.count_nonzero(pixels[~truth.valid]), 0)
    elif path.suffix in (".gpkg", ".fgb", ".geojson"):
        with quiet():
            frame = geopandas.read_file(path)
        wrong = [shapely.is_valid_reason(one) for one in frame.geometry if not one.is_valid]
        yield from differ("GEOMETRY", about, wrong[:3], [])
