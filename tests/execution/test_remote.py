"""A cloud-optimised GeoTIFF read over HTTP, locally and by workers: the same bytes as from the disk."""

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import chdir
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner

from uavseg.cli import main

RANGE = ("--range", "0.55,1")
pytestmark = pytest.mark.slow


@pytest.fixture
def cog(tmp_path: Path) -> Path:
    rng = np.random.default_rng(2)
    image = np.kron(rng.integers(20, 240, (30, 30)), np.ones((40, 40))) + rng.normal(0, 9, (1200, 1200))
    place = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6), "dtype": "uint16"}
    path = tmp_path / "tile.tif"
    with rasterio.open(path, "w", "COG", 1200, 1200, 1, blocksize=256, **place) as file:
        file.write((np.clip(image, 1, 255) * 90).astype(np.uint16), 1)
    return path


class Server:
    """A process that serves a folder; not a thread, since GDAL may hold the GIL while it waits."""

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        assert process.stdout is not None
        self.url = f"http://127.0.0.1:{process.stdout.readline().strip()}"
        self._process = process

    def served(self) -> list[int]:
        """Lengths of the parts that were served; stops the server."""
        self._process.terminate()
        return [int(line) for line in self._process.communicate()[0].split()]


@pytest.fixture
def server(cog: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    """A server of the folder of the raster."""
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    program = Path(__file__).with_name("ranges.py")
    command = [sys.executable, "-u", str(program), str(cog.parent)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        yield Server(process)
        process.kill()


def extracted(raster: object, output: Path, *options: object) -> bytes:
    """The bytes of the regions, in a format that does not say where the raster is."""
    arguments = ["extract", raster, *RANGE, "-o", output, "-q", *options]
    result = CliRunner().invoke(main, [str(argument) for argument in arguments])
    assert result.exit_code == 0, result.output
    return b"".join(output.with_suffix(suffix).read_bytes() for suffix in (".shp", ".dbf"))


def test_a_file_on_a_server_gives_the_same_bytes(server: Server, cog: Path, tmp_path: Path) -> None:
    expected = extracted(cog, tmp_path / "disk.shp")
    assert len(expected) > 1000
    assert extracted(f"/vsicurl/{server.url}/tile.tif", tmp_path / "vsicurl.shp", "--threads", 2) == expected
    assert extracted(f"{server.url}/./tile.tif", tmp_path / "http.shp") == expected
    served = server.served()
    assert len(served) > 2 and max(served) < cog.stat().st_size


def test_workers_read_from_the_server_themselves(
    processes: Any, server: Server, cog: Path, tmp_path: Path
) -> None:
    how = ("--tile", 256, "--scheduler", processes.address)
    assert extracted(f"{server.url}/tile.tif", tmp_path / "http.shp", *how) == extracted(
        cog, tmp_path / "disk.shp"
    )
    assert sum(server.served()) > cog.stat().st_size


def test_a_block_map_finds_its_raster_on_the_server(server: Server, cog: Path, tmp_path: Path) -> None:
    with chdir(tmp_path):
        divide = ["divide", f"{server.url}/tile.tif", "-o", "blocks.tif", "-q"]
        assert CliRunner().invoke(main, divide).exit_code == 0
    found = extracted(tmp_path / "blocks.tif", tmp_path / "b.shp", "--allow-network")
    assert found == extracted(cog, tmp_path / "disk.shp")


def test_an_asset_of_an_item_on_the_server_is_the_file(server: Server, cog: Path, tmp_path: Path) -> None:
    (cog.parent / "items" / "north east").mkdir(parents=True)
    (cog.parent / "items" / "north east" / "tile.tif").write_bytes(cog.read_bytes())
    hrefs = {"near": "north%20east/tile.tif", "space": "./north east/tile.tif", "above": "../tile.tif"}
    hrefs |= {"root": "/tile.tif", "full": f"{server.url}/tile.tif"}
    refused = {
        "other": ("http://127.0.0.1:9/a.tif", "names the address http://127.0.0.1:9/a.tif; allow requests"),
        "network": ("//127.0.0.1:9/a.tif", "names the address http://127.0.0.1:9/a.tif; allow requests"),
        "lookalike": (f"{server.url}0/a.tif", f"names the address {server.url}0/a.tif; allow requests"),
        "bucket": ("s3://bucket/a.tif", "names the address s3://bucket/a.tif; allow requests"),
        "local": (f"file://{cog}", "neither a file nor an address"),
        "described": ("a.vrt", f"names the address {server.url}/items/a.vrt; allow requests"),
    }
    assets = {key: {"href": href} for key, href in hrefs.items()}
    assets |= {key: {"href": href} for key, (href, _) in refused.items()}
    item = {"type": "Feature", "stac_version": "1.1.0", "assets": assets}
    (cog.parent / "items" / "item.json").write_text(json.dumps(item))
    expected = extracted(cog, tmp_path / "disk.shp")
    for key in hrefs:
        assert extracted(f"{server.url}/items/item.json#{key}", tmp_path / "o.shp", "--overwrite") == expected
    assert extracted(f"/vsicurl/{server.url}/items/item.json?a=1#near", tmp_path / "v.shp") == expected
    told = {key: text for key, (_, text) in refused.items()}
    told |= {"": "is a STAC item", "rot": "has no asset 'rot' with an address; of its assets, name one: "}
    for key, text in told.items():
        result = CliRunner().invoke(main, ["info", f"{server.url}/items/item.json#{key}"])
        assert result.exit_code == 1 and len(result.stderr.splitlines()) == 1 and text in result.stderr


@pytest.mark.parametrize(
    ("path", "text"), [("gone.json", "HTTP Error 404"), ("list.json", "a value in it is of a wrong kind")]
)
def test_an_address_without_an_item_is_one_line(server: Server, cog: Path, path: str, text: str) -> None:
    (cog.parent / "list.json").write_text("[]")
    for end in ("", "#red"):
        result = CliRunner().invoke(main, ["info", f"{server.url}/{path}{end}"])
        assert result.exit_code == 1 and len(result.stderr.splitlines()) == 1
        assert f"{server.url}/{path} cannot be read as a STAC item ({text}" in result.stderr


def test_a_file_missing_on_the_server_is_one_line(server: Server) -> None:
    arguments = ["extract", f"{server.url}/gone.tif", *RANGE, "-o", "-"]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 1 and len(result.stderr.splitlines()) == 1
    assert "gone.tif cannot be opened as a raster" in result.stderr
