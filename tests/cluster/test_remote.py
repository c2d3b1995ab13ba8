"""A cloud-optimised GeoTIFF read over HTTP, by this process and by workers: the same bytes as from the disk."""

import re
import threading
from collections.abc import Iterator
from contextlib import chdir
from functools import partial
from http import HTTPStatus
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner

from uavseg.cli import main

RANGE = ("--range", "0.55,1")


class Ranges(SimpleHTTPRequestHandler):
    """Files, and parts of files; notes what was given."""

    protocol_version = "HTTP/1.1"

    def __init__(self, *arguments: Any, given: list[int], **how: Any) -> None:
        self.given = given
        super().__init__(*arguments, **how)

    def do_GET(self) -> None:
        path = Path(self.translate_path(self.path))
        wanted = re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("Range", ""))
        if not path.is_file() or wanted is None:
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        size, first, last = path.stat().st_size, int(wanted[1]), int(wanted[2])
        part = path.read_bytes()[first : last + 1]
        self.send_response(HTTPStatus.PARTIAL_CONTENT)
        self.send_header("Content-Range", f"bytes {first}-{first + len(part) - 1}/{size}")
        self.send_header("Content-Length", str(len(part)))
        self.end_headers()
        self.wfile.write(part)
        self.given.append(len(part))

    def log_message(self, *_: Any) -> None:
        """Say nothing."""


@pytest.fixture
def cog(tmp_path: Path) -> Path:
    rng = np.random.default_rng(2)
    image = np.kron(rng.integers(20, 240, (30, 30)), np.ones((40, 40))) + rng.normal(0, 9, (1200, 1200))
    place = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6), "dtype": "uint16"}
    path = tmp_path / "tile.tif"
    with rasterio.open(path, "w", "COG", 1200, 1200, 1, blocksize=256, **place) as file:
        file.write((np.clip(image, 1, 255) * 90).astype(np.uint16), 1)
    return path


@pytest.fixture
def server(cog: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[str, list[int]]]:
    """Where the folder is served, and the lengths of what was given."""
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    given: list[int] = []
    handler = partial(Ranges, directory=str(cog.parent), given=given)
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as http:
        thread = threading.Thread(target=http.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{http.server_port}", given
        http.shutdown()
        thread.join()


def extracted(raster: object, output: Path, *options: object) -> bytes:
    arguments = ["extract", raster, *RANGE, "-o", output, "-q", *options]
    result = CliRunner().invoke(main, [str(argument) for argument in arguments])
    assert result.exit_code == 0, result.output
    return output.read_bytes()


def test_a_file_on_a_server_is_the_file(server: tuple[str, list[int]], cog: Path, tmp_path: Path) -> None:
    url, given = server
    wanted = extracted(cog, tmp_path / "disk.fgb")
    assert len(wanted) > 1000
    assert extracted(f"/vsicurl/{url}/tile.tif", tmp_path / "vsicurl.fgb", "--threads", 2) == wanted
    assert given and max(given) < cog.stat().st_size
    assert extracted(f"{url}/./tile.tif", tmp_path / "http.fgb") == wanted


def test_workers_read_it_themselves(
    processes: Any, server: tuple[str, list[int]], cog: Path, tmp_path: Path
) -> None:
    url, given = server
    how = ("--tile", 256, "--scheduler", processes.address)
    assert extracted(f"{url}/tile.tif", tmp_path / "http.fgb", *how) == extracted(cog, tmp_path / "disk.fgb")
    assert sum(given) > cog.stat().st_size


def test_a_block_map_finds_its_raster_on_the_server(
    server: tuple[str, list[int]], cog: Path, tmp_path: Path
) -> None:
    url, _ = server
    with chdir(tmp_path):
        divide = ["divide", f"{url}/tile.tif", "-o", "blocks.tif", "-q"]
        assert CliRunner().invoke(main, divide).exit_code == 0
    assert extracted(tmp_path / "blocks.tif", tmp_path / "b.fgb") == extracted(cog, tmp_path / "disk.fgb")


def test_a_file_that_no_server_has_is_one_line(server: tuple[str, list[int]]) -> None:
    arguments = ["extract", f"{server[0]}/gone.tif", *RANGE, "-o", "-"]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 1 and len(result.stderr.splitlines()) == 1
    assert "gone.tif cannot be opened as a raster" in result.stderr
