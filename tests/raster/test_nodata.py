"""The nodata value of a user counts beside that of the files; "only:V" counts alone, and "none" is none."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine

from uavseg.errors import ParameterError
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.dataset import Dataset

NAN = math.nan
Write = Callable[..., Path]


def valid(dataset: Dataset) -> list[bool]:
    """Of the first row."""
    shape = dataset.geobox.shape
    found = dataset.read(Window(0, 0, *shape))[1]
    return [True] * shape[1] if found is None else found[0].tolist()


def but(*invalid: int) -> list[bool]:
    return [number not in invalid for number in range(5)]


@pytest.mark.parametrize(
    ("dtype", "tagged", "named", "expected", "warns"),
    [
        ("float32", -9999.0, None, but(0), ""),
        (
            "float32",
            -9999.0,
            0,
            but(0, 1),
            "nodata 0 counts beside that of the file, -9999; for 0 alone, give",
        ),
        ("float32", -9999.0, "0", but(0, 1), "--nodata only:0 (nodata='only:0')"),
        ("float32", -9999.0, "only:0", but(1), ""),
        ("float32", -9999.0, "none", but(), ""),
        ("float32", -9999.0, -9999, but(0), ""),
        ("float32", -9999.0, NAN, but(0), "nodata nan counts beside"),
        ("float32", -9999.0, "only:nan", but(), ""),
        ("float32", None, 0, but(1), ""),
        ("float32", NAN, 0, but(1), "nodata 0 counts beside that of the file, nan"),
        ("float64", 0.1, np.float32(0.1), but(), "beside"),
        ("int16", -9999, 0, but(0, 1), "beside"),
        ("int16", -9999, 1e6, but(0), "nodata 1e+06 does not fit int16"),
        ("int16", -9999, "only:1e6", but(), "nodata 1e+06 does not fit int16"),
        ("int16", -9999, NAN, but(0), "nodata nan does not fit int16"),
        ("int16", None, "only:7", but(2), ""),
    ],
)
def test_which_values_count_for_nothing(
    write_raster: Write, dtype: str, tagged: float | None, named: Any, expected: list[bool], warns: str
) -> None:
    row = np.array([[-9999, 0, 7, 9, 3]], dtype)
    dataset = Dataset.open(write_raster(row, nodata=tagged), nodata=named)
    assert valid(dataset) == expected
    assert warns in " ".join(dataset.warnings) and bool(dataset.warnings) == bool(warns)


def test_a_tag_that_fits_no_pixel_leaves_the_value_of_the_user_alone(write_raster: Write) -> None:
    path = write_raster(np.array([[7, 9, 0, 1, 2]], np.int16))
    (vrt := path.with_suffix(".vrt")).write_text(
        f"""<VRTDataset rasterXSize="5" rasterYSize="1"><GeoTransform>3e5,1,0,4e6,0,-1</GeoTransform>
        <VRTRasterBand dataType="Int16" band="1"><NoDataValue>1e9</NoDataValue><SimpleSource>
        <SourceFilename relativeToVRT="1">{path.name}</SourceFilename></SimpleSource></VRTRasterBand>
        </VRTDataset>"""
    )
    dataset = Dataset.open(vrt, nodata=9)
    assert valid(dataset) == but(1)
    assert not any("beside" in text for text in dataset.warnings)


@pytest.mark.parametrize(
    ("named", "expected"), [(None, but(0)), (255, but(0, 1)), ("only:255", but(1)), ("none", but())]
)
def test_colours_count_for_nothing_where_all_bands_have_one_of_the_two(
    write_raster: Write, named: Any, expected: list[bool]
) -> None:
    planes = np.array([[[0, 255, 0, 255, 9]], [[0, 255, 0, 255, 9]], [[0, 255, 255, 0, 9]]], np.uint8)
    path = write_raster(planes, nodata=0, colors="red green blue")
    assert valid(Dataset.open(path, nodata=named)) == expected


@pytest.mark.parametrize("named", [9, "only:9", "none"])
def test_masks_and_alpha_count_for_nothing_beside_it(write_raster: Write, named: Any) -> None:
    row = np.array([[7, 9, 3, 4, 5]], np.uint8)
    expected = but(2) if named == "none" else but(1, 2)
    opaque = np.array([[255, 255, 0, 255, 255]], np.uint8)
    masked = write_raster(row, mask=opaque)
    shown = write_raster(np.stack([row, opaque]), colors="gray alpha")
    assert valid(Dataset.open(masked, nodata=named)) == expected
    assert valid(Dataset.open(shown, nodata=named)) == expected


def test_each_file_of_a_mosaic_keeps_its_own(write_raster: Write) -> None:
    files = [
        write_raster(np.array([[tag, 9, 0, 3, 4]], np.int16), nodata=tag, transform=Affine(1, 0, x, 0, -1, 9))
        for tag, x in ((-1, 0), (-2, 5), (-3, 10))
    ]
    dataset = Dataset.open(files, nodata=0)
    assert valid(dataset) == but(0, 2) * 3
    assert sum("nodata" in text for text in dataset.warnings) == 1
    assert "beside that of the file, -1 and -2 and -3;" in " ".join(dataset.warnings)
    assert valid(Dataset.open(files, nodata="only:0")) == but(2) * 3


def test_each_band_of_a_formula_keeps_its_own(write_raster: Write) -> None:
    from uavseg.raster.spectral.formula import BandWords

    planes = np.array([[[1, 2, 3, 4, 5]], [[5, 4, 3, 2, 1]]], np.float32)
    path = write_raster(planes)
    with rasterio.open(path, "r+") as file:
        file.nodata = 2
    dataset = Dataset.open(path, nodata=5, words=BandWords(expr="b1 + b2"))
    assert valid(dataset) == but(0, 1, 3, 4)
    assert valid(Dataset.open(path, nodata="only:5", words=BandWords(expr="b1 + b2"))) == but(0, 4)


@pytest.mark.parametrize("text", ["", "only", "only:", "only:none", "only:only:3", "7m", "None of it"])
def test_another_text_is_refused(write_raster: Write, text: str) -> None:
    with pytest.raises(ParameterError, match="nodata is a number, only:NUMBER"):
        Dataset.open(write_raster(np.ones((1, 5), np.uint8)), nodata=text)
