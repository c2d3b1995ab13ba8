"""One picture in several forms (mosaics, VRTs, other formats, block maps): the same regions, to the pixel."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import rasterio
import rasterio.shutil
from rasterio.enums import Resampling
from rasterio.vrt import WarpedVRT

import uavseg
from tests.honest import plain
from tests.honest.files import whole
from tests.honest.findings import command, unlike
from tests.honest.picture import Picture, any_layout, any_picture, any_shape, quiet, write_tiff
from tests.honest.places import is_upright
from tests.hostile.judging import Finding


def case(rng: Random, folder: Path) -> Iterator[Finding]:
    """A picture in some form, asked for a range, against the plain file."""
    picture = any_picture(rng, any_shape(rng, 300))
    form = rng.choice(FORMS)
    picture = fitted(form, picture)
    write_tiff(folder / "plain.tif", picture, {"compress": "lzw"})
    source = form(rng, folder, picture)
    if source is None:
        return
    about = f"{form.__name__} {picture.by}"
    file = folder / ("turned.tif" if form is warped_vrt else "plain.tif")
    truth = plain.read(file, (1, 2, 3) if len(picture.values) == 3 else (1,))
    if form is not block_map:
        yield from whole(source, truth, about, picture)
    if truth.valid.any():
        yield from same_regions(rng, source, file, truth, about, picture.span)


def same_regions(
    rng: Random, source: Any, file: Path, truth: plain.Plain, about: str, span: tuple[float, float]
) -> Iterator[Finding]:
    """A range of both gives the same pixels and the same numbers."""
    low, high = round(0.6 * rng.random(), 2), round(0.61 + 0.39 * rng.random(), 2)
    refine = rng.choice(["none", "tv", "scan"])
    if form_of(source) == "b.tif" and not truth.valid.all() and refine == "none":
        refine = "tv"  # a block map does not know which pixels of a cell are valid
    how: dict[str, Any] = {"range": (low, high), "refine": refine, "collar": "keep"}
    how |= {"stretch": f"{span[0]!r},{span[1]!r}", "threads": 1}
    requested = dict(how)
    if form_of(source) == "b.tif":
        requested.pop("stretch"), requested.pop("collar")
    expected, found = uavseg.extract(file, **how), uavseg.extract(source, **requested)
    about = f"{about} {how['refine']}"
    at = truth.valid.shape, truth.transform
    yield from unlike(
        "SAME PIXELS",
        about,
        plain.drawn_pixels(found.geometry, *at),
        plain.drawn_pixels(expected.geometry, *at),
    )
    columns = ["pixels", "area_m2", "mean", "holes"]
    columns += ["mean_value"] * (form_of(source) != "b.tif")  # it knows clipped means alone
    for column in columns:
        one, other = np.array(found[column], float), np.array(expected[column], float)
        if len(one) == len(other) and not np.allclose(one, other, rtol=1e-9, equal_nan=True):
            yield Finding("SAME NUMBERS", f"{about} {column}", f"{one[:5]}, not {other[:5]}")


def form_of(source: Any) -> str:
    """The name of a file, or nothing."""
    return source.name if isinstance(source, Path) else ""


def fitted(form: Any, picture: Picture) -> Picture:
    """A picture that a form can hold."""
    if form in (mosaic, overlapping_mosaic) and picture.by == "sidecar":
        return replace(picture, by="mask")
    if form is picture_file:
        dtype = picture.values.dtype.name
        return (
            replace(picture, by="all", valid=picture.valid | True)
            if dtype in ("uint8", "uint16")
            else picture
        )
    return picture


def mosaic(rng: Random, folder: Path, picture: Picture) -> Any:
    """Tiles in any order, each in a layout of its own."""
    rows, cols = picture.shape
    down, right = rng.choice([17, 64, 100, 128]), rng.choice([17, 64, 100, 128])
    names = []
    for row in range(0, rows, down):
        for col in range(0, cols, right):
            part = picture.part(row, col, min(down, rows - row), min(right, cols - col))
            name = folder / f"t{row}_{col}.tif"
            how = {} if rng.random() < 0.5 else without_loss(any_layout(rng, part))
            write_tiff(name, part, how)
            names.append(str(name))
    rng.shuffle(names)
    return names


def overlapping_mosaic(rng: Random, folder: Path, picture: Picture) -> Any:
    """Two parts that share pixels, and agree on them."""
    rows, cols = picture.shape
    if rows < 3:
        return None
    first, second = rng.randint(2, rows), rng.randint(0, 1)
    names = [str(folder / "a.tif"), str(folder / "b_.tif")]
    write_tiff(folder / "a.tif", picture.part(0, 0, first, cols), {"compress": "deflate"})
    write_tiff(folder / "b_.tif", picture.part(second, 0, rows - second, cols), {"tiled": True})
    rng.shuffle(names)
    return names


def vrt(rng: Random, folder: Path, picture: Picture) -> Any:
    """A VRT of the file, as GDAL writes it."""
    with quiet():
        rasterio.shutil.copy(folder / "plain.tif", folder / "v.vrt", driver="VRT")
    return folder / "v.vrt"


def warped_vrt(rng: Random, folder: Path, picture: Picture) -> Any:
    """A file that a VRT turned north up by nearest neighbours: its pixels are its own."""
    if picture.crs is None or len(picture.values) == 3 or not is_upright(picture.transform):
        return None
    with quiet(), rasterio.open(folder / "plain.tif") as file:
        try:
            with WarpedVRT(file, resampling=Resampling.nearest, add_alpha=False) as turned:
                rasterio.shutil.copy(turned, folder / "w.vrt", driver="VRT")
                rasterio.shutil.copy(turned, folder / "turned.tif", driver="GTiff")
        except rasterio.errors.RasterioError:
            return None
    return folder / "w.vrt"


def cog(rng: Random, folder: Path, picture: Picture) -> Any:
    """A cloud-optimised file with overviews."""
    compress, block = rng.choice(["deflate", "lzw", "zstd", "none"]), rng.choice([128, 256, 512])
    predictor = {} if compress == "none" else {"predictor": rng.choice(["yes", "no"])}
    try:
        with quiet():
            rasterio.shutil.copy(
                folder / "plain.tif",
                folder / "c.tif",
                driver="COG",
                compress=compress,
                blocksize=block,
                overview_count=rng.choice([0, 1, 2]),
                **predictor,
            )
    except SystemError:
        return None  # GDAL does not write this one
    return folder / "c.tif"


def block_map(rng: Random, folder: Path, picture: Picture) -> Any:
    """A block map, and its raster beside it."""
    low, high = picture.span
    if not plain.read(folder / "plain.tif", (1, 2, 3) if len(picture.values) == 3 else (1,)).valid.any():
        return None
    command(
        "divide",
        "plain.tif",
        "-o",
        "b.tif",
        f"--stretch={low!r},{high!r}",
        "--collar",
        "keep",
        "--threads",
        1,
    )
    return folder / "b.tif"


def picture_file(rng: Random, folder: Path, picture: Picture) -> Any:
    """Another format of rasters that GDAL writes without loss."""
    dtype, bands = picture.values.dtype.name, len(picture.values)
    drivers = ["HFA", "ENVI"] if dtype != "int8" else []
    if dtype in ("uint8", "uint16") and picture.by == "all":
        drivers += ["PNG", "JP2OpenJPEG"]
    if (
        bands == 1
        and dtype in ("int32", "float32")
        and picture.by in ("all", "nodata")
        and is_square(picture)
    ):
        drivers += ["AAIGrid"]
    if picture.by not in ("all", "nodata", "nan") or not drivers:
        return None
    driver = rng.choice(drivers)
    suffix = {"HFA": ".img", "ENVI": ".bsq", "PNG": ".png", "JP2OpenJPEG": ".jp2", "AAIGrid": ".asc"}[driver]
    how = {"PNG": {"worldfile": "YES"}, "JP2OpenJPEG": {"quality": "100", "reversible": "YES"}}.get(
        driver, {}
    )
    if driver == "AAIGrid":
        how = {"significant_digits": "17"}
    with quiet():
        rasterio.shutil.copy(folder / "plain.tif", folder / f"p{suffix}", driver=driver, **how)
        with rasterio.open(folder / f"p{suffix}") as file, rasterio.open(folder / "plain.tif") as other:
            if not np.array_equal(file.read(), other.read(), equal_nan=dtype.startswith("float")):
                return None  # the format does not hold it
            if not file.transform.almost_equals(other.transform, 1e-9) or file.crs != other.crs:
                return None
            if file.nodata != other.nodata and picture.by == "nodata" and picture.nodata == picture.nodata:
                return None
    return folder / f"p{suffix}"


def is_square(picture: Picture) -> bool:
    """Whether a picture is north up with square pixels."""
    t = picture.transform
    return is_upright(t) and t.a == -t.e and t.a > 0


def without_loss(how: dict[str, Any]) -> dict[str, Any]:
    """A layout without JPEG and LERC."""
    return {} if str(how.get("compress", "")).startswith(("jpeg", "lerc", "webp")) else how


FORMS = (mosaic, mosaic, overlapping_mosaic, vrt, warped_vrt, cog, block_map, picture_file)
