"""Commands on files of a stranger: one line of error, nothing read elsewhere, no request, no waiting."""

import json
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

import uavseg

QUARRY = Path(uavseg.__file__).parents[1] / "samples" / "quarry.tif"
HOSTILE = Path(uavseg.__file__).parents[2] / "shared" / "hostile"
SECRET = "root:x:0:0:a secret of this machine\n"
READING = {
    "info": ["info", "{}"],
    "preview": ["preview", "{}", "-o", "p.png"],
    "extract": ["extract", "{}", "--range", "0,1", "-o", "o.geojson"],
    "levels": ["levels", "{}", "--width", "0.3", "-o", "o.geojson"],
    "divide": ["divide", "{}", "-o", "o.tif"],
    "suggest": ["suggest", "{}"],
    "classify": ["classify", "{}", "-o", "o.tif"],
    "path": ["path", "{}", "--range", "0,1", "--start", "1,1", "--goal", "2,2", "-o", "o.geojson"],
    "original": ["original", "{}", "-o", "o.tif"],
    "match": ["match", "{}", "--like", "9,9,5", "-o", "o.geojson"],
    "plan": ["plan", "{}", "-o", "m.plan", "--altitude", "50", "--home", "auto"],
    "simulate": ["simulate", "{}", "-o", "o.tif"],
    "build-map": ["build-map", "{}", "-o", "o.tif"],
    "merge-maps": ["merge-maps", "{}", "-o", "o.tif"],
}
LAYERS = ["--regions", "--mission", "--states", "--leaves", "--labels", "--levels", "--path"]


@pytest.fixture
def requests() -> Iterator[tuple[str, list[str]]]:
    """Address of a server on this machine, and the paths that it was asked for."""
    requested: list[str] = []

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            requested.append(self.path)
            self.send_response(404)
            self.end_headers()

        do_HEAD = do_GET  # noqa: N815

        def log_message(self, *_: Any) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}", requested
        server.shutdown()
        thread.join()


def run(folder: Path, words: list[str]) -> subprocess.CompletedProcess[str]:
    search = os.pathsep.join([str(Path(uavseg.__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(
        [sys.executable, "-m", "uavseg", *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": search},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def assert_refused(folder: Path, words: list[str], reason: str = "") -> None:
    before = sorted(folder.rglob("*"))
    found = run(folder, words)
    assert found.returncode == 1, (words, found.stderr)
    assert found.stderr.startswith("uavseg: error: ") and found.stderr.count("\n") == 1, found.stderr
    assert reason in found.stderr
    assert "root:x" not in found.stdout + found.stderr
    assert sorted(folder.rglob("*")) == before


def vrt(source: str) -> str:
    inner = (
        f"<SimpleSource><SourceFilename>{source}</SourceFilename><SourceBand>1</SourceBand></SimpleSource>"
    )
    return (
        "<VRTDataset rasterXSize='64' rasterYSize='64'><VRTRasterBand dataType='Byte' band='1'>"
        f"{inner}</VRTRasterBand></VRTDataset>"
    )


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on this system")
@pytest.mark.parametrize("command", READING)
def test_no_command_waits_for_a_named_pipe(tmp_path: Path, command: str) -> None:
    name = {"plan": "a.geojson", "simulate": "a.json", "classify": "a.yaml"}.get(command, "a.tif")
    os.mkfifo(tmp_path / name)
    assert_refused(tmp_path, [word.format(name) for word in READING[command]], "named pipe")


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on this system")
@pytest.mark.parametrize("layer", LAYERS)
def test_no_layer_of_a_preview_waits_for_a_named_pipe(tmp_path: Path, layer: str) -> None:
    rasters = ("--states", "--leaves", "--labels")
    name = "a.plan" if layer == "--mission" else "a.tif" if layer in rasters else "a.geojson"
    os.mkfifo(tmp_path / name)
    shutil.copy(QUARRY, tmp_path / "q.tif")
    assert_refused(tmp_path, ["preview", "q.tif", layer, name, "-o", "p.png"], "named pipe")


@pytest.mark.slow
@pytest.mark.parametrize(
    "command", [name for name in READING if name not in ("plan", "simulate", "build-map")]
)
def test_no_command_makes_a_request_for_what_a_file_names(
    tmp_path: Path, requests: Any, command: str
) -> None:
    address, requested = requests
    (tmp_path / "a.vrt").write_text(vrt(f"/vsicurl/{address}/a.tif"))
    assert_refused(tmp_path, [word.format("a.vrt") for word in READING[command]], "--allow-network")
    assert requested == []


@pytest.mark.slow
def test_requests_are_made_where_they_are_allowed_or_named_by_the_user(tmp_path: Path, requests: Any) -> None:
    address, requested = requests
    (tmp_path / "a.vrt").write_text(vrt(f"/vsicurl/{address}/a.tif"))
    run(tmp_path, ["info", "a.vrt", "--allow-network"])
    assert "/a.tif" in requested
    requested.clear()
    run(tmp_path, ["info", f"/vsicurl/{address}/b.tif"])
    assert "/b.tif" in requested


@pytest.mark.slow
def test_the_image_of_a_ros_map_lies_beside_it_or_where_the_user_allows(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "secret.pgm").write_text("P2 4 4 255 " + " ".join(["0"] * 16))
    rest = "resolution: 1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
    (tmp_path / "in" / "a.yaml").write_text("image: ../secret.pgm\n" + rest)
    words = ["classify", "a.yaml", "-o", "o.tif"]
    assert_refused(tmp_path / "in", words, "--allow-path")
    found = run(tmp_path / "in", [*words, "--allow-path", str(tmp_path)])
    assert found.returncode == 0, found.stderr


@pytest.mark.slow
def test_a_yaml_bomb_is_refused_by_its_aliases(tmp_path: Path) -> None:
    lines = ["a: &a [x,x,x,x,x,x,x,x,x]"]
    lines += [f"{b}: &{b} [{','.join(9 * [f'*{a}'])}]" for a, b in zip("abcdefg", "bcdefgh", strict=True)]
    (tmp_path / "a.yaml").write_text("\n".join([*lines, "image: *h", "resolution: 1"]))
    assert_refused(tmp_path, ["classify", "a.yaml", "-o", "o.tif"], "aliases")


@pytest.mark.slow
def test_huge_numbers_of_scenes_and_options_are_refused(tmp_path: Path) -> None:
    scene = {"map": {"rows": 8, "cols": 8, "cell": 1}, "poses": [{"at": [1, 1]}]}
    (tmp_path / "s.json").write_text(json.dumps(scene))
    assert_refused(tmp_path, ["simulate", "s.json", "-o", "o.tif", "--sigma", "1e26"], "at most 1e+09 m")
    (tmp_path / "s.json").write_text(json.dumps(scene).replace("8", "8" * 5000))
    assert_refused(tmp_path, ["simulate", "s.json", "-o", "o.tif"], "digits")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("bl0.vrt", ["info", "bl0.vrt"]),
        ("http.vrt", ["info", "http.vrt"]),
        ("raw.vrt", ["preview", "raw.vrt", "-o", "p.png"]),
        ("rawtif.tif", ["info", "rawtif.tif"]),
        ("wms.tif", ["info", "wms.tif"]),
        ("bmh.tif", ["extract", "bmh.tif", "--range", "0.4,1", "-o", "o.geojson"]),
        ("gj.geojson", READING["plan"]),
        ("ovf.geojson", READING["plan"]),
        ("yamlbomb.yaml", READING["classify"]),
        ("bigint.json", READING["simulate"]),
    ],
)
def test_files_made_by_hand_are_refused(tmp_path: Path, name: str, words: list[str]) -> None:
    if not (HOSTILE / "hand").is_dir():
        pytest.skip("the folder of hostile files is not beside the repository")
    for path in (HOSTILE / "hand").iterdir():
        shutil.copyfile(path, tmp_path / path.name)
    assert_refused(tmp_path, [word.format(name) for word in words])
