"""Folders, patterns and lists become names of rasters, in an order that depends on the names alone."""

import os
from contextlib import chdir
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from uavseg.access import allowing
from uavseg.errors import AccessError, RasterReadError
from uavseg.raster.read.source_list import expand_sources, is_list, parse_list, stem_of

NAMES = ("b.tif", "a.TIF", "c.jp2", "tiles.vrt", ".hidden.tif", "a.tif.aux.xml", "regions.gpkg", "notes.txt")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in NAMES:
        place = Path("tiles", name)
        place.parent.mkdir(exist_ok=True)
        place.touch()
    Path("tiles/deep.tif").mkdir()
    Path("tiles/deep.tif/d.tif").touch()


def test_a_folder_is_its_image_files() -> None:
    images = ["a.TIF", "b.tif", "c.jp2"]
    assert expand_sources(["tiles"]) == [f"tiles/{name}" for name in images]
    assert expand_sources([Path("tiles"), "x.tif"]) == [*(f"tiles/{name}" for name in images), "x.tif"]
    with chdir("tiles"):
        assert expand_sources(["."]) == [f"./{name}" for name in images]


def test_a_pattern_is_the_files_that_match() -> None:
    assert expand_sources(["tiles/*.tif"]) == ["tiles/b.tif"]
    assert expand_sources(["tiles/**/*.tif"]) == ["tiles/b.tif", "tiles/deep.tif/d.tif"]
    assert expand_sources(["tiles/[bc].*"]) == ["tiles/b.tif", "tiles/c.jp2"]


@pytest.mark.slow
@given(names=st.lists(st.text(st.characters(exclude_characters="\0\n\r/", codec="utf-8"), min_size=1)))
def test_a_list_gives_back_what_was_written(names: list[str]) -> None:
    zeros = b"".join(os.fsencode(name) + b"\0" for name in names)
    assert parse_list(zeros) == names
    lines = "".join(f"{name}\n" for name in names).encode()
    assert parse_list(lines) == [name for name in names if name.encode().strip() and name[0] != "#"]
    assert parse_list(lines.replace(b"\n", b"\r\n")) == parse_list(lines)


def test_a_list_is_named_with_an_at() -> None:
    Path("list.txt").write_text("# the first flight\nnorth.tif\n\nsouth of it.tif\r\n")
    assert expand_sources(["@list.txt"]) == ["north.tif", "south of it.tif"]
    assert stem_of("@list.txt") == "north"


def test_a_file_is_itself_whatever_its_name() -> None:
    for name in ("@list.tif", "a[1].tif", "what?.tif"):
        assert is_list(name)
        Path(name).touch()
        assert not is_list(name) and expand_sources([name]) == [name]


@pytest.mark.parametrize(
    "name", ["/vsicurl/https://a.org/b?c=*", "https://a.org/b.tif?x=[1]", "missing.tif", "-"]
)
def test_other_names_are_themselves(name: str) -> None:
    assert expand_sources([name]) == [name]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("empty", "empty is a folder without rasters"),
        ("none*.tif", r"no file matches none\*.tif"),
        ("tiles/d*", r"no file matches tiles/d\*"),
        ("@none.txt", "there is no file none.txt"),
        ("@empty.txt", "empty.txt names no rasters"),
        ("@tiles", "tiles is a folder"),
    ],
)
def test_what_names_no_raster_is_refused(name: str, text: str) -> None:
    Path("empty").mkdir()
    Path("empty/.tif").touch()
    Path("empty.txt").write_text("# nothing\n\n")
    with pytest.raises(RasterReadError, match=text):
        expand_sources([name])


def test_a_list_names_addresses_where_they_are_allowed() -> None:
    Path("list.txt").write_text("/vsicurl/https://example.org/a.tif\n")
    with pytest.raises(AccessError, match=r"list\.txt names the address"):
        expand_sources(["@list.txt"])
    with allowing(allow_network=True):
        assert expand_sources(["@list.txt"]) == ["/vsicurl/https://example.org/a.tif"]


def test_stems_of_outputs() -> None:
    Path("sheets.d").mkdir()
    assert [stem_of(name) for name in ("tiles", "sheets.d/", "x/y.tif")] == ["tiles", "sheets.d", "y"]
    assert stem_of("tiles/*.tif") == "b"
    with chdir("tiles"):
        assert stem_of(".") == "tiles"
