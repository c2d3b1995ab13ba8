"""The options of access, and the setting of PROJ, on both faces; bounds on what a command may use."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner

import uavseg
from uavseg.cli import main
from uavseg.cli.command import _proj_requests
from uavseg.errors import AccessError

VRT = """<VRTDataset rasterXSize="64" rasterYSize="64"><VRTRasterBand dataType="Byte" band="1"><SimpleSource>
<SourceFilename relativeToVRT="0">{}</SourceFilename><SourceBand>1</SourceBand></SimpleSource></VRTRasterBand>
</VRTDataset>
"""


@pytest.fixture
def vrt(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A VRT whose source lies in another folder."""
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
    how = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6)}
    with rasterio.open(tmp_path / "other" / "a.tif", "w", "GTiff", 64, 64, 1, dtype="uint8", **how) as file:
        file.write(np.random.default_rng(0).integers(1, 255, (64, 64), np.uint8), 1)
    (tmp_path / "one" / "a.vrt").write_text(VRT.format(tmp_path / "other" / "a.tif"))
    monkeypatch.chdir(tmp_path)
    return tmp_path / "one" / "a.vrt"


@pytest.mark.parametrize(
    ("words", "name"),
    [
        (("extract", "--range", "0,1", "-o", "o.gpkg"), "o.gpkg"),
        (("divide", "-o", "o.tif"), "o.tif"),
        (("levels", "--width", "0.5", "-o", "o.gpkg"), "o.gpkg"),
        (("classify", "--stretch", "dtype", "-o", "o.tif"), "o.tif"),
        (("preview", "-o", "o.png"), "o.png"),
    ],
)
def test_a_folder_is_opened_only_where_it_is_allowed(vrt: Path, words: tuple[str, ...], name: str) -> None:
    command, *options = words
    refused = CliRunner().invoke(main, [command, str(vrt), *options])
    assert refused.exit_code == 1 and "--allow-path" in refused.stderr and not Path(name).exists()
    allowed = CliRunner().invoke(main, [command, str(vrt), *options, "--allow-path", "other"])
    assert allowed.exit_code == 0 and Path(name).exists()


def test_python_has_the_same_words(vrt: Path) -> None:
    with pytest.raises(AccessError, match="allow_path"):
        uavseg.divide(vrt)
    with pytest.warns(UserWarning, match="no place on the map"):
        blocks = uavseg.divide(vrt, allow_path="other")
    assert blocks.counts.sum() == 64 * 64


@pytest.mark.parametrize("before", [None, "ON"])
def test_proj_makes_requests_only_where_they_are_allowed(
    monkeypatch: pytest.MonkeyPatch, before: str | None
) -> None:
    if before is None:
        monkeypatch.delenv("PROJ_NETWORK", raising=False)
    else:
        monkeypatch.setenv("PROJ_NETWORK", before)
    with _proj_requests(False):
        assert os.environ["PROJ_NETWORK"] == "OFF"
    assert os.environ.get("PROJ_NETWORK") == before
    with _proj_requests(True):
        assert os.environ.get("PROJ_NETWORK") == before


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the limit is one of Linux")
@pytest.mark.parametrize("megabytes", [100, 200, 250])
def test_too_little_memory_is_one_line(vrt: Path, megabytes: int) -> None:
    limit = f"ulimit -v {megabytes * 1024}"
    command = f"{limit}; exec '{sys.executable}' -m uavseg extract other/a.tif --range 0,1 -o o.gpkg"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=False)
    lines = done.stderr.splitlines()
    known = ("uavseg: ", "OpenBLAS error: Memory allocation ")  # OpenBLAS ends the process itself
    assert done.returncode != 0 and all(line.startswith(known) for line in lines), lines
    assert sum("error: " in line for line in lines) == 1, lines
    assert not Path("o.gpkg").exists()
