"""Signals end a program within seconds while a library works, whose calls hear none of them."""

import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from rasterio.transform import from_origin

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="Windows ends a program without asking it"),
]
PATIENCE_S = 100
# What stands in for a library never ends. `holding` lets no other thread of Python run, as pyogrio reads
# features; the others do, as GDAL opens files and rasterio reads pixels, and as GEOS and SQLite work. With
# `beside` the main thread hears the signal at once, and another goes on, for which Python waits at its end.
SCRIPT = """
import collections, ctypes, hashlib, itertools, os, sqlite3, sys, threading, time
from importlib import import_module

def begun():
    os.write(2, b"begun\\n")  # at once: print() writes the line and its end apart, and two threads may begin

def holding(*args, **kwargs):
    begun()
    collections.deque(itertools.repeat(None), maxlen=0)

def working(*args, **kwargs):
    begun()
    hashlib.pbkdf2_hmac("sha512", b"", b"", 2**31 - 1)

def query(*args, **kwargs):
    begun()
    endless = "WITH RECURSIVE n(k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM n) SELECT count(*) FROM n"
    sqlite3.connect(":memory:").execute(endless).fetchall()

def beside(*args, **kwargs):
    threading.Thread(target=working).start()
    time.sleep(1000)

module, name, how = {where!r}
owner = import_module(module)
*path, name = name.split(".")
for part in path:
    owner = getattr(owner, part)
setattr(owner, name, locals()[how])
from uavseg.cli import main
main(prog_name="uavseg")
"""
EXTRACT = "extract a.tif --range 0.5,1 -o out.gpkg"
PLAN = "plan regions.geojson --home 47,8 --altitude 60 -o out.plan"
CALLS = {
    "opening a layer": (PLAN, "pyogrio", "list_layers", "working"),
    "counting features": (PLAN, "pyogrio", "read_info", "working"),
    "reading features": (PLAN, "geopandas", "read_file", "holding"),
    "parsing JSON": (PLAN, "uavseg.regions.formats.vector_files", "parse_json", "holding"),
    "repairing polygons": (PLAN, "shapely", "is_valid", "working"),
    "uniting polygons": (f"{PLAN} --home auto", "shapely", "union_all", "working"),
    "features of a picture": (
        "preview a.tif --regions regions.geojson -o out.png",
        "pyogrio.raw",
        "read",
        "holding",
    ),
    "extent of a layer": ("info regions.geojson", "pyogrio", "read_info", "working"),
    "opening a raster": ("info a.tif", "uavseg.raster.access.opening", "rasterio.open", "working"),
    "reading a raster": (EXTRACT, "uavseg.raster.read.raster_file", "RasterFile.read", "working"),
    "reading in threads": (
        f"{EXTRACT} --threads 2",
        "uavseg.raster.read.raster_file",
        "RasterFile.read",
        "working",
    ),
    "a thread that is left": (
        f"{EXTRACT} --threads 1",
        "uavseg.raster.read.raster_file",
        "RasterFile.read",
        "beside",
    ),
    "simplifying": (f"{EXTRACT} --simplify 2", "shapely", "coverage_simplify", "working"),
    "writing a layer": (f"{EXTRACT[:-4]}fgb", "pyogrio.raw", "write", "working"),
    "writing a database": (EXTRACT, "uavseg.regions.formats.geopackage", "write_geopackage", "query"),
    "views of a database": (
        "info base.gpkg",
        "uavseg.raster.access.untrusted",
        "open_database",
        "query",
    ),
    "reprojecting a picture": (
        "map a.tif -o out.html",
        "uavseg.jobs.web_map.content",
        "reproject",
        "working",
    ),
    "drawing a picture": ("preview a.tif -o out.png", "matplotlib.figure", "Figure.savefig", "working"),
}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    values = np.full((256, 256), 60, np.uint8)
    values[60:200, 60:200] = 180
    where = {"crs": "EPSG:4326", "transform": from_origin(8.0, 47.01, 1e-4, 1e-4)}
    shape: dict[str, Any] = {"width": 256, "height": 256, "count": 1, "dtype": "uint8"}
    with rasterio.open("a.tif", "w", driver="GTiff", **shape, **where) as file:
        file.write(values, 1)
    ring = [[8.001, 47.001], [8.003, 47.001], [8.003, 47.002], [8.001, 47.002], [8.001, 47.001]]
    feature = {
        "type": "Feature",
        "properties": {"href": 1},
        "geometry": {"type": "Polygon", "coordinates": [ring]},
    }
    Path("regions.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    Path("base.gpkg").write_bytes(b"SQLite format 3\0" + bytes(1000))
    return tmp_path


def stopped(call: str, number: signal.Signals) -> tuple[int, str]:
    """Exit code and last lines of a program that gets a signal while a library works."""
    line, module, name, how = CALLS[call]
    script = SCRIPT.format(where=(module, name, how))
    command = [sys.executable, "-c", script, *line.split()]
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as process:
        assert process.stderr is not None
        try:
            before = []
            while (text := process.stderr.readline()) not in ("begun\n", ""):
                before.append(text)
            assert text == "begun\n", before
            process.send_signal(number)
            code = process.wait(PATIENCE_S)
            return code, process.stderr.read()
        finally:
            process.kill()


@pytest.mark.parametrize("call", CALLS)
def test_a_signal_ends_a_long_call_and_leaves_nothing(call: str) -> None:
    number = (signal.SIGINT, signal.SIGTERM)[list(CALLS).index(call) % 2]
    before = sorted(Path().iterdir())
    code, said = stopped(call, number)
    word = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}[number]
    if CALLS[call][3] == "holding":  # nobody is there to say anything
        assert (code, said) == (-number, "")
    else:
        assert (code, said.splitlines()[-1:]) == (128 + number, [f"uavseg: {word}; nothing was written"])
    assert sorted(Path().iterdir()) == before
