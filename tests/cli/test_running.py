"""Who works and what is told: the bar on a terminal, and labels as tiles."""

import io
import itertools
import re
import sys
from contextlib import chdir
from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner

from uavseg.cli import main
from uavseg.cli.terminal import say as _run
from uavseg.cli.terminal.say import Reporter
from uavseg.execution.progress_bar import Amount, bar
from uavseg.options.running import ProgressOptions, VerbosityOptions
from uavseg.raster.read.dataset import Dataset

QUARRY = Path(__file__).resolve().parents[2] / "samples" / "quarry.tif"


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_terminal_sees_tiles_speed_and_the_time_left(monkeypatch: pytest.MonkeyPatch) -> None:
    seconds = itertools.count(step=10)
    monkeypatch.setattr(_run, "_seconds", lambda: float(next(seconds)))
    monkeypatch.setattr(sys, "stderr", screen := Terminal())
    reporter = Reporter(VerbosityOptions(), ProgressOptions())
    reporter.begin(Dataset.open(QUARRY).windows(64))  # 9 x 10 tiles of 560 x 640 pixels; ten seconds in
    reporter.progress(1, 2)
    reporter.progress(2, 2)
    reporter.finish()
    half, whole, gone = (line.removesuffix("\x1b[K") for line in screen.getvalue().split("\r")[1:])
    assert half == "[############............]  50 %  45/90 tiles  17.9 kpx/s  0:10 left"
    assert whole == "[########################] 100 %  90/90 tiles  17.9 kpx/s  0:00 left"
    assert gone == ""


@pytest.mark.parametrize("pixels", [1, 10**5, 10**12])
@pytest.mark.parametrize("share", [0.0, 1e-9, 0.5, 1.0])
def test_a_bar_fits_a_terminal(pixels: int, share: float) -> None:
    line = bar(share, 3e4, Amount(pixels // 4096 + 1, pixels))
    assert len(line) < 100 and re.match(r"\[#*\.*\]", line)


@pytest.mark.slow
def test_labels_may_be_tiles_under_a_vrt(tmp_path: Path) -> None:
    grid = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6)}
    image = np.full((2100, 2200), 20, np.uint8)
    image[40:2080, 300:1900:3] = 200
    image[1000:2090] = 240
    runner = CliRunner()
    with chdir(tmp_path):
        with rasterio.open("a.tif", "w", "GTiff", 2200, 2100, 1, dtype="uint8", **grid) as file:
            file.write(image, 1)
        options = ["extract", "a.tif", "--range", "0.55,1", "-q", "--overwrite", "-o", "a.fgb", "--labels"]
        for name in ("l.tif", "l.vrt", "l.vrt"):
            assert runner.invoke(main, [*options, name]).exit_code == 0
        with rasterio.open("l.tif") as one, rasterio.open("l.vrt") as tiled:
            assert one.read(1).any() and np.array_equal(one.read(1), tiled.read(1))
            assert (one.crs, one.transform, one.nodata) == (tiled.crs, tiled.transform, tiled.nodata)
        assert len(list(Path("l.tiles").iterdir())) == 4
        options.remove("--overwrite")
        options[options.index("a.fgb")] = "b.fgb"
        result = runner.invoke(main, [*options, "l.vrt"])
        assert result.exit_code == 1 and "l.vrt exists; give --overwrite" in result.stderr
        assert not Path("b.fgb").exists()
