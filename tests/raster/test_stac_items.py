"""An asset of a STAC item is the raster itself, by the rules of what the content of a file names."""

import json
import os
import shutil
import socket
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from click.testing import CliRunner, Result
from rasterio.windows import Window

import uavseg
from uavseg.access import allowing
from uavseg.cli import main
from uavseg.errors import AccessError, RasterReadError, UavsegError
from uavseg.raster.elevation.dem import Dem
from uavseg.raster.read import source_list
from uavseg.raster.read.source_list import expand_sources, is_list, item_and_asset, stem_of

SAMPLES = Path(uavseg.__file__).parents[1] / "samples"
COG = "image/tiff; application=geotiff; profile=cloud-optimized"


def stac_item(**hrefs: Any) -> dict[str, Any]:
    """An item of STAC 1.0 with these assets."""
    return {
        "type": "Feature",
        "stac_version": "1.0.0",
        "id": "flight-1",
        "geometry": {"type": "Point", "coordinates": [-123.0, 40.0]},
        "bbox": [-123.0, 40.0, -123.0, 40.0],
        "properties": {"datetime": "2024-05-01T10:00:00Z"},
        "links": [],
        "assets": {key.replace("_", "-"): {"href": href, "type": COG} for key, href in hrefs.items()},
    }


def write_item(path: str, **hrefs: Any) -> None:
    Path(path).write_text(json.dumps(stac_item(**hrefs)), encoding="utf-8")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with an item of one raster; beside the folder is another raster."""
    inside = tmp_path / "in"
    (inside / "data").mkdir(parents=True)
    shutil.copy(SAMPLES / "quarry.tif", inside / "data" / "quarry.tif")
    shutil.copy(SAMPLES / "quarry.tif", tmp_path / "outside.tif")
    monkeypatch.chdir(inside)
    write_item("item.json", visual="./data/quarry.tif", near_infrared="nir.tif", notes="notes.txt")
    return inside


def run(*words: object) -> Result:
    return CliRunner().invoke(main, [*map(str, words)])


def extracted(*sources: object) -> bytes:
    """The bytes of the regions of these sources."""
    result = run("extract", *sources, "--range", "0.55,1", "-o", "out.geojson", "--overwrite")
    assert result.exit_code == 0, result.output
    return Path("out.geojson").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        ("extract", "SOURCE", "--range", "0.55,1", "-o", "out.geojson"),
        (
            "extract",
            "SOURCE",
            "--each",
            "--range",
            "0.55,1",
            "-o",
            "out-{stem}.geojson",
            "--report",
            "out.csv",
        ),
        ("levels", "SOURCE", "--width", "0.3", "-o", "out.geojson"),
        ("divide", "SOURCE", "-o", "out.tif"),
        ("preview", "SOURCE", "-o", "out.png", "--width", "300"),
        ("classify", "SOURCE", "-o", "out.tif", "--stretch", "dtype"),
        ("compare", "SOURCE", "SOURCE", "--range", "0.55,1", "-o", "out.geojson"),
        ("suggest", "SOURCE", "--json"),
        ("info", "SOURCE", "--json"),
    ],
    ids=" ".join,
)
def test_an_asset_gives_the_bytes_of_its_file(command: tuple[str, ...]) -> None:
    found = []
    for source in ("data/quarry.tif", "item.json#visual"):
        result = run(*(source if word == "SOURCE" else word for word in command))
        assert result.exit_code == 0, result.output
        files = {path.name: path.read_bytes() for path in Path().glob("out*")}
        said = result.stdout.replace("'item.json#visual'", "data/quarry.tif") if not files else ""
        found.append((files, said))
        for name in files:
            Path(name).unlink()
    assert found[0] == found[1] and found[0] != ({}, "")


@pytest.mark.slow
def test_python_gives_the_bytes_of_the_file() -> None:
    expected = uavseg.extract("data/quarry.tif", range=(0.55, 1))
    for source in ("item.json#visual", Path("item.json#visual"), ["item.json#visual"]):
        found = uavseg.extract(source, range=(0.55, 1))
        assert found.to_json() == expected.to_json() and len(found) > 0
    assert uavseg.info("item.json#visual").as_dict() | {"command": ""} == uavseg.info(
        "data/quarry.tif"
    ).as_dict() | {"command": ""}


def halves() -> list[str]:
    """Two files, the left and the right half of the raster."""
    with rasterio.open("data/quarry.tif") as file:
        for name, col in (("left", 0), ("right", file.width // 2)):
            window = Window(col, 0, file.width // 2, file.height)
            place = {"width": window.width, "transform": file.window_transform(window)}
            with rasterio.open(f"data/{name}.tif", "w", **file.profile | place) as half:
                half.write(file.read(window=window))
    return ["data/left.tif", "data/right.tif"]


@pytest.mark.slow
def test_a_mosaic_of_assets_is_that_of_their_files() -> None:
    files = halves()
    write_item("data/left.json", tile="left.tif")
    write_item("right.json", tile="data/right.tif")
    sources = ["data/left.json#tile", "right.json#tile"]
    expected = extracted(*files)
    assert extracted(*sources) == expected != extracted(files[0])
    assert extracted(files[0], sources[1]) == expected
    Path("list.txt").write_text("".join(f"{name}\n" for name in sources))
    assert extracted("@list.txt") == expected
    assert extracted("data/quarry.tif") == extracted("item.json#visual")


def test_an_elevation_model_may_be_an_asset_or_in_a_folder() -> None:
    dem = {"driver": "GTiff", "width": 9, "height": 9, "count": 1, "dtype": "float32", "crs": "EPSG:32610"}
    with rasterio.open("dem.tif", "w", **dem, transform=rasterio.Affine(9, 0, 5e5, 0, -9, 4e6)) as file:
        file.write(np.arange(81, dtype=np.float32).reshape(1, 9, 9))
    write_item("dem.json", elevation="dem.tif")
    Path("dems").mkdir()
    shutil.copy("dem.tif", "dems")
    for source in ("dem.json#elevation", "dem.tif", "dems", "d*m.tif"):
        assert Dem.open(source).name == "dem.tif"


def test_a_picture_without_its_polarity_is_refused_as_an_asset_too() -> None:
    Path("map.pgm").write_bytes(b"P5 8 8 255\n" + bytes(range(64)))
    write_item("map.json", states="map.pgm")
    for source in ("map.pgm", "map.json#states"):
        result = run("classify", source, "-o", "out.tif")
        assert result.exit_code == 1 and "map.pgm is a picture without its YAML file" in result.stderr


def test_an_item_is_not_replaced_by_an_output() -> None:
    Path("item.json").rename("item.geojson")
    before = Path("item.geojson").read_bytes()
    source = "item.geojson#visual"
    result = run("extract", source, "--range", "0.55,1", "-o", "item.geojson", "--overwrite")
    assert result.exit_code == 1 and Path("item.geojson").read_bytes() == before


def test_a_file_of_that_name_is_the_file() -> None:
    shutil.copy("data/quarry.tif", "item.json#visual")
    shutil.copy("data/quarry.tif", "a#b.tif")
    for name in ("item.json#visual", "a#b.tif"):
        assert not is_list(name) and expand_sources([name]) == [name]
    assert extracted("a#b.tif") != extracted("data/quarry.tif")  # the source is named in the file
    Path("a#b").mkdir()
    shutil.move("item.json", "a#b/item.json")
    shutil.move("data", "a#b/data")
    assert expand_sources(["a#b/item.json#visual"]) == ["a#b/data/quarry.tif"]


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("item.json#a", ("item.json", "a")),
        ("d/Item.GeoJSON#b#c", ("d/Item.GeoJSON", "b#c")),
        ("https://h/api/items/S2A#red", ("https://h/api/items/S2A", "red")),
        ("/vsicurl/http://h/i.json?k=1#red", ("http://h/i.json?k=1", "red")),
        ("https://h/i.json", ("https://h/i.json", "")),
        ("https://h/i.json?k=1", ("https://h/i.json?k=1", "")),
        ("https://h/a.tif", None),
        ("a.tif#b", None),
        ("s3://bucket/i.json#red", None),
        ("/vsizip/a.zip/i.json#red", None),
        ("a.tif", None),
    ],
)
def test_which_names_are_those_of_assets(source: str, expected: tuple[str, str] | None) -> None:
    assert item_and_asset(source) == expected
    assert is_list(source) == (expected is not None)


@pytest.mark.parametrize("how", [lambda path: path, os.path.abspath, lambda path: f"../in/{path}"])
def test_assets_are_relative_to_their_item(how: Callable[[str], str]) -> None:
    assert expand_sources([f"{how('item.json')}#visual"]) == [how("data/quarry.tif")]
    assert stem_of(f"{how('item.json')}#visual") == "quarry"


def test_pystac_finds_the_same_files() -> None:
    pystac = pytest.importorskip("pystac", reason="pystac is not installed")
    item = pystac.Item.from_file("item.json")
    found = Path(expand_sources(["item.json#visual"])[0])
    assert Path(item.assets["visual"].get_absolute_href()) == found.absolute()
    item.set_self_href("made.json")
    item.add_asset("again", pystac.Asset("data/quarry.tif", media_type=pystac.MediaType.COG))
    item.save_object(include_self_link=False)
    assert expand_sources(["made.json#again"]) == ["data/quarry.tif"]


HREFS = {
    "../outside.tif": "names ../outside.tif, which lies outside of its folder",
    "data/../../outside.tif": "which lies outside of its folder",
    "/etc/passwd": "names /etc/passwd, which lies outside of its folder",
    "link.tif": "which lies outside of its folder",
    "http://example.org/a.tif": "names the address http://example.org/a.tif; allow requests",
    "s3://bucket/a.tif": "names the address s3://bucket/a.tif; allow requests",
    "/vsicurl/https://example.org/a.tif": "names the address /vsicurl/https://example.org/a.tif; allow",
    "//example.org/a.tif": "which lies outside of its folder",
    "https://example.org/a.vrt": "names the address https://example.org/a.vrt; allow requests",
    "https://example.org/a.xml?b.tif": "allow requests",
    "https://example.org/a.nc": "allow requests",
    " https://example.org/a.tif": "there is no file  https:/example.org/a.tif",
    "/vsizip/data/a.zip/a.tif": "neither a file nor an address",
    "file:///etc/passwd": "names 'file:///etc/passwd', neither a file nor an address",
    "zip://a.zip!a.tif": "neither a file nor an address",
    "GTIFF_DIR:1:data/quarry.tif": "neither a file nor an address",
    "<VRTDataset/>": "neither a file nor an address",
    "data/a\0.tif": "neither a file nor an address",
    "": "neither a file nor an address",
    "gone.tif": "there is no file gone.tif",
    "data": "data is a folder",
    "\ud800.tif": "no valid path",
}


@pytest.mark.parametrize("href", HREFS)
def test_what_an_item_may_not_name_is_refused_in_one_line(href: str) -> None:
    Path("link.tif").symlink_to("../outside.tif")
    write_item("item.json", visual=href)
    result = run("extract", "item.json#visual", "--range", "0.5,1", "-o", "out.geojson")
    assert result.exit_code == 1 and len(result.stderr.splitlines()) == 1
    assert result.stderr.startswith("uavseg: error: item.json names") and HREFS[href] in result.stderr
    assert not Path("out.geojson").exists()
    with pytest.raises(UavsegError):
        uavseg.extract("item.json#visual", range=(0.5, 1))


def test_folders_and_addresses_may_be_allowed() -> None:
    write_item("item.json", out="../outside.tif", s3="s3://bucket/a.tif", file="file:///etc/passwd")
    with allowing(".."):
        assert expand_sources(["item.json#out"]) == ["../outside.tif"]
    assert extracted("item.json#out", "--allow-path", "..") == extracted("../outside.tif")
    with allowing(allow_network=True):
        assert expand_sources(["item.json#s3"]) == ["s3://bucket/a.tif"]
        with pytest.raises(AccessError, match="neither a file nor an address"):
            expand_sources(["item.json#file"])


def test_an_https_address_that_the_user_names_is_opened_but_not_one_in_a_list() -> None:
    write_item("item.json", red="https://example.org/a.tif?key=1", plain="HTTPS://example.org/a")
    assert expand_sources(["item.json#red"]) == ["https://example.org/a.tif?key=1"]
    assert expand_sources(["item.json#plain"]) == ["HTTPS://example.org/a"]
    Path("list.txt").write_text("item.json#red\n")
    with pytest.raises(AccessError, match=r"item\.json names the address https://example\.org"):
        expand_sources(["@list.txt"])
    with allowing(allow_network=True):
        assert expand_sources(["@list.txt"]) == ["https://example.org/a.tif?key=1"]
    Path("list.txt").write_text("https://127.0.0.1:9/item.json#red\n")
    with pytest.raises(AccessError, match=r"list\.txt names the address"):
        expand_sources(["@list.txt"])


@pytest.mark.parametrize(
    ("source", "text"),
    [
        (
            "item.json",
            "item.json is a STAC item; of its assets, name one: item.json#visual (images: visual, near-",
        ),
        (
            "item.json#",
            "item.json is a STAC item; of its assets, name one: item.json#visual (images: visual, ",
        ),
        (
            "item.json#near-infared",
            "has no asset 'near-infared' with an address; of its assets, name one: item.json#near-",
        ),
        ("item.json#none", "name one: item.json#visual (images: visual, near-infrared)"),
        ("empty.json", "empty.json is a STAC item; of its assets, none is an image"),
        ("gone.json#a", "gone.json cannot be read as a STAC item (No such file or directory)"),
        ("data.json#a", "data.json is a folder"),
    ],
)
@pytest.mark.parametrize("command", ["info", "extract"])
def test_assets_are_listed_the_nearest_first(command: str, source: str, text: str) -> None:
    write_item("empty.json", notes="notes.txt", number=3, nothing=None)
    Path("data.json").mkdir()
    options = ["--range", "0,1", "-o", "out.geojson"] if command == "extract" else []
    result = run(command, source, *options)
    assert result.exit_code == 1 and len(result.stderr.splitlines()) == 1 and text in result.stderr
    assert "notes" not in result.stderr


ITEM = json.dumps(stac_item(visual="data/quarry.tif"))
CONTENTS = {
    "not JSON": (b"II*\0", "Expecting value"),
    "cut": (ITEM[:-9].encode(), "Unterminated string"),
    "not UTF-8": (ITEM.encode("utf-16"), "not UTF-8"),
    "a list": (b"[]", "of a wrong kind"),
    "empty": (b"{}", "'type' is missing"),
    "a collection": (
        ITEM.replace('"Feature"', '"Collection"').encode(),
        "its type is 'Collection', not 'Feature'",
    ),
    "no assets": (ITEM.replace('"assets"', '"asset"').encode(), "'assets' is missing"),
    "a list of assets": (json.dumps(stac_item() | {"assets": ["a"]}).encode(), "of a wrong kind"),
    "an asset of text": (
        json.dumps(stac_item() | {"assets": {"visual": "a.tif"}}).encode(),
        "of a wrong kind",
    ),
    "a number as address": (json.dumps(stac_item(visual=3)).encode(), "no asset 'visual' with an address"),
    "deep": (
        ITEM.replace('"links": []', '"links": ' + 99 * "[" + 99 * "]").encode(),
        "nested more than 64 deep",
    ),
    "a long number": (ITEM.replace("40.0", "4" * 999).encode(), "a number has 999 digits"),
    "large": (ITEM.encode() + b" " * 5000, "it has more than 5,000 bytes"),
}


@pytest.mark.parametrize("name", CONTENTS)
def test_what_is_no_item_is_refused_in_one_line(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(source_list, "MAX_ITEM", 5000)
    content, text = CONTENTS[name]
    Path("item.json").write_bytes(content)
    with pytest.raises(RasterReadError, match=r"^item\.json ") as caught:
        uavseg.extract("item.json#visual", range=(0.5, 1))
    result = run("info", "item.json#visual")
    assert result.exit_code == 1 and result.stderr == f"uavseg: error: {caught.value}\n"
    assert text in result.stderr and len(result.stderr.splitlines()) == 1


def test_a_file_of_regions_is_no_item() -> None:
    extracted("data/quarry.tif")
    assert item_and_asset("out.geojson") is None
    assert "regions" in run("info", "out.geojson").stdout
    result = run("extract", "out.geojson", "--range", "0.5,1", "-o", "other.geojson")
    assert result.exit_code == 1 and "holds a description in text, not an image" in result.stderr


ANSWERS = {
    "not HTTP": (b"SSH-2.0-OpenSSH\r\n", "SSH-2.0"),
    "nothing": (b"", "without response"),
    "an error": (b"HTTP/1.0 403 No\r\n\r\n", "HTTP Error 403: No"),
    "a way to a file": (b"HTTP/1.0 302 Found\r\nLocation: file:///etc/passwd\r\n\r\n", "HTTP Error 302"),
    "no JSON": (b"HTTP/1.0 200 OK\r\n\r\n<html>", "Expecting value"),
    "too much": (b"HTTP/1.0 200 OK\r\n\r\n" + bytes(9000), "it has more than 5,000 bytes"),
}


@pytest.mark.parametrize("name", ANSWERS)
def test_what_is_no_item_at_an_address_is_refused_in_one_line(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    monkeypatch.setattr(source_list, "MAX_ITEM", 5000)
    answer, text = ANSWERS[name]

    def serve() -> None:
        connection = server.accept()[0]
        with connection:
            connection.recv(4096)
            connection.sendall(answer)

    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=serve)
        thread.start()
        source = f"http://127.0.0.1:{server.getsockname()[1]}/item.json#visual"
        result = run("info", source)
        thread.join()
    assert result.exit_code == 1 and len(result.stderr.splitlines()) == 1
    assert "/item.json cannot be read as a STAC item (" in result.stderr and text in result.stderr
