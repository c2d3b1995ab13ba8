"""`uavseg original`: labels as a GeoTIFF, and what is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner, Result

from uavseg.cli import main
from uavseg.occupancy.ros.ros_map import write_ros_map
from uavseg.raster.grid.geobox import local_geobox
from uavseg.segmentation.lbpc import LbpcParams, segment_lbpc

UTM = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6)}


def scene() -> np.ndarray:
    rng = np.random.default_rng(4)
    image = rng.integers(1, 60, (150, 200)).astype(np.uint8)
    image[:, 90:] += (np.arange(150)[:, None] % 4 * 40).astype(np.uint8)
    return image


def write(path: Path, image: np.ndarray, **how: Any) -> None:
    size = {"count": 1, "height": image.shape[0], "width": image.shape[1], "dtype": image.dtype.name}
    with rasterio.open(path, "w", "GTiff", **size, **(UTM | how)) as file:
        file.write(image, 1)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "scene.tif", scene())
    return tmp_path


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["original", *map(str, arguments)])


def labels_of(*arguments: object) -> np.ndarray:
    result = run(*arguments, "-o", "labels.tif", "--overwrite")
    assert result.exit_code == 0, result.output
    with rasterio.open("labels.tif") as file:
        labels: np.ndarray = file.read(1)
        assert file.crs.to_epsg() == 32618 and file.nodata == 0 and file.dtypes == ("uint32",)
        assert f"segments    {labels.max()} -> labels.tif" in result.stderr
    return labels


def test_labels_are_those_of_the_image_in_memory() -> None:
    grey = scene().astype(np.uint16) * 257
    assert np.array_equal(labels_of("scene.tif"), segment_lbpc(grey))
    params = LbpcParams(1.1, 3.0, 0.2, 5, 4)
    how = ("--threshold", 1.1, "--merge-stop", 3, "--untested", 0.2, "--radius", 5, "--sweeps", 4)
    assert np.array_equal(labels_of("scene.tif", *how), segment_lbpc(grey, params=params))


def test_nodata_has_no_label_and_tiles_and_threads_change_nothing() -> None:
    whole = labels_of("scene.tif", "--nodata", "7")
    assert np.array_equal(whole == 0, scene() == 7)
    content = Path("labels.tif").read_bytes()
    labels_of("scene.tif", "--nodata", "7", "--tile", "64", "--threads", "2")
    assert Path("labels.tif").read_bytes() == content


BAD = {
    ("--merge-stop", "0.1"): "at least 1",
    ("--merge-stop", "nan"): "at least 1",
    ("--radius", "0"): "1 to 128",
    ("--sweeps", "-1"): "at least 0",
    ("--untested", "1.5"): "0..1",
    ("--threshold", "nan"): "at least 0",
    ("--stretch", "sideways"): "a stretch is one of",
    ("-o", "labels.png"): "GeoTIFF",
    ("-o", "scene.tif"): "--overwrite",
}


@pytest.mark.parametrize("option", BAD, ids=" ".join)
def test_what_cannot_be_is_reported_in_one_line_and_nothing_is_written(option: tuple[str, str]) -> None:
    before = Path("scene.tif").read_bytes()
    output = () if option[0] == "-o" else ("-o", "labels.tif")
    result = run("scene.tif", *option, *output)
    assert result.exit_code == 1 and BAD[option] in result.stderr
    assert result.stderr.startswith("uavseg: error: ") and result.stderr.count("\n") == 1
    assert [path.name for path in Path().iterdir()] == ["scene.tif"]
    assert Path("scene.tif").read_bytes() == before


def test_a_raster_that_is_too_large_is_refused_before_it_is_read(folder: Path) -> None:
    how = {"sparse_ok": True, "tiled": True, "count": 1, "height": 5000, "width": 5000, "dtype": "uint8"}
    rasterio.open(folder / "large.tif", "w", "GTiff", **UTM, **how).close()
    result = run("large.tif", "-o", "labels.tif")
    assert result.exit_code == 1 and "5,000 x 5,000" in result.stderr and "gdal_translate" in result.stderr
    assert not Path("labels.tif").exists()


def test_a_ros_map_has_segments_as_the_raster_of_its_probabilities(folder: Path) -> None:
    states = np.full((70, 130), 2, np.uint8)
    states[10:50, 20:90] = 1
    states[20:30, 40:60] = 3
    box = local_geobox(states.shape, 0.1, (0, 0))
    write_ros_map("map.yaml", states, box)
    values = np.array([0.5, 0, 0.5, 1], np.float32)[states]
    write(folder / "map.tif", values, crs=None, transform=box.transform)
    labels = []
    for name, how in (("map.yaml", ()), ("map.tif", ("--stretch", "none"))):
        result = run(name, *how, "-o", "labels.tif", "--overwrite")
        assert result.exit_code == 0, result.stderr
        with rasterio.open("labels.tif") as file:
            labels.append(file.read(1))
            assert file.transform.almost_equals(box.transform)
    assert labels[0].max() > 1 and np.array_equal(*labels)
