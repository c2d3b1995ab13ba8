"""Inputs are kept: no output replaces a file that the same command reads, under any name, in either face."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner

from uavseg.cli import main
from uavseg.errors import OutputError
from uavseg.jobs.divide import divide
from uavseg.jobs.source.open_source import open_source
from uavseg.plot.preview import preview
from uavseg.segmentation.blocks.block_file import write_block_map
from uavseg.segmentation.params.segment import SegmentParams

GRID = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6)}


def run(*words: str) -> tuple[int, str]:
    result = CliRunner().invoke(main, [word for part in words for word in part.split()])
    return result.exit_code, result.stderr


def made(*words: str) -> None:
    code, said = run(*words)
    assert code == 0, said


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One of each kind of input."""
    folder = tmp_path_factory.mktemp("sources")
    image = np.kron(np.random.default_rng(0).integers(20, 230, (8, 8)), np.ones((20, 20))).astype(np.uint8)
    for name, suffix in (("a.tif", "GTiff"), ("a.png", "PNG"), ("b.tif", "GTiff")):
        with rasterio.open(folder / name, "w", suffix, 160, 160, 1, dtype="uint8", **GRID) as file:
            file.write(image, 1)
    former = Path.cwd()
    os.chdir(folder)
    try:
        made("extract a.tif --range 0.5,1 -o r.geojson -q --labels l.vrt")
        made("extract a.tif --range 0.5,1 -o r.shp -q")
        made("divide a.tif -o blocks.tif -q")
        made("simulate lens --poses 2 -o lens.tif -q")
        made("classify lens.tif -o m.yaml -q")
    finally:
        os.chdir(former)
    (folder / "s.json").write_text(
        '{"map": {"rows": 9, "cols": 9, "cell": 0.1}, "poses": [{"at": [0.5, 0.5]}]}'
    )
    return folder


@pytest.fixture
def folder(sources: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of them to work in."""
    shutil.copytree(sources, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def bytes_of(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


CASES = [
    ("divide a.tif -o a.tif", "a.tif"),
    ("divide b.tif a.tif -o a.tif", "a.tif"),
    ("original a.tif -o a.tif", "a.tif"),
    ("extract a.tif --range 0.5,1 -o o.geojson --labels a.tif", "a.tif"),
    ("extract blocks.tif --range 0.5,1 -o o.geojson --labels blocks.tif", "blocks.tif"),
    ("extract l.vrt --range 0.5,1 -o o.geojson --labels l.tiles/0000-0000.tif", "0000-0000.tif"),
    ("extract l.tiles/0000-0000.tif --range 0.5,1 -o o.geojson --labels l.vrt", "0000-0000.tif"),
    ("levels a.tif --width 0.5 -o o.geojson --labels a.tif", "a.tif"),
    ("match a.tif --like r.geojson -o r.geojson", "r.geojson"),
    ("match a.tif --like r.shp -o r.shp", "r.shp"),
    ("suggest a.png -o a.png", "a.png"),
    ("preview a.png -o a.png", "a.png"),
    ("classify lens.tif -o lens.tif", "lens.tif"),
    ("classify m.yaml -o m.yaml", "m.yaml"),
    ("classify m.pgm --stretch none -o m.yaml", "m.pgm"),
    ("simulate s.json -o s.json", "s.json"),
    ("simulate s.json -o o.tif --png s.json", "s.json"),
]


@pytest.mark.parametrize(("words", "name"), CASES)
def test_an_output_that_is_an_input_is_refused(folder: Path, words: str, name: str) -> None:
    before = bytes_of(folder)
    code, said = run(words, "--overwrite")
    assert code == 1 and said.count("\n") == 1
    assert f"would replace {name}" in said or f"{name}, which is read for it" in said, said
    assert "which is read for it; name another output" in said
    assert bytes_of(folder) == before


@pytest.mark.parametrize(
    "other",
    [
        lambda place: place.symlink_to("a.tif"),
        lambda place: os.link("a.tif", place),
    ],
)
def test_another_name_of_the_same_file_is_the_same_file(folder: Path, other: Callable[[Path], None]) -> None:
    other(folder / "other.tif")
    before = bytes_of(folder)
    code, said = run("divide a.tif -o other.tif --overwrite")
    assert code == 1 and "other.tif would replace a.tif, which is read for it" in said
    assert bytes_of(folder) == before


def test_a_sidecar_of_an_input_is_kept_too(folder: Path) -> None:
    (folder / "a.shp.xml").unlink(missing_ok=True)
    os.link(folder / "r.dbf", folder / "o.dbf")
    before = bytes_of(folder)
    code, said = run("match a.tif --like r.shp -o o.shp --overwrite")
    assert code == 1 and "o.shp would replace r.shp, which is read for it" in said
    assert bytes_of(folder) == before


def test_the_raster_of_a_block_map_is_kept(folder: Path) -> None:
    made("divide a.tif -o blocks.tif -q --overwrite")
    before = bytes_of(folder)
    code, said = run("extract blocks.tif --range 0.5,1 -o o.geojson --labels a.tif --overwrite")
    assert code == 1 and "a.tif, which is read for it" in said
    assert bytes_of(folder) == before


def test_other_files_are_replaced(folder: Path) -> None:
    shutil.copy("a.tif", "o.tif")
    made("divide a.tif -o o.tif -q --overwrite")
    made("divide a.tif -o fresh.tif -q")
    assert Path("o.tif").read_bytes() == Path("fresh.tif").read_bytes() != Path("a.tif").read_bytes()


def test_python_refuses_it_too(folder: Path) -> None:
    before = bytes_of(folder)
    with pytest.raises(OutputError, match=r"a\.png would replace a\.png, which is read for it"):
        preview("a.png", "a.png", overwrite=True)
    with pytest.raises(OutputError, match=r"a\.png would replace .*a\.png, which is read for it"):
        preview(open_source("a.png").dataset, "a.png", overwrite=True)  # type: ignore[union-attr]
    saved = divide(open_source("a.tif")).saved
    with pytest.raises(OutputError, match=r"a\.tif would replace .*a\.tif, which is read for it"):
        write_block_map("a.tif", saved, SegmentParams().division, overwrite=True)
    assert bytes_of(folder) == before
