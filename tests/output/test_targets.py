"""Targets: the files of each, whether they may be made, and what gives way."""

import os
from pathlib import Path

import pytest

from uavseg.errors import OutputError, OutputExistsError
from uavseg.output.atomic import atomic_file, check_target

PARTS = [  # of a target, parts that nothing but an older one of that name has
    *(("t.shp", f"t{end}") for end in (".shx", ".dbf", ".prj", ".cpg", ".qix", ".sbn", ".shp.xml", ".DBF")),
    *(("t.tif", f"t.{end}") for end in ("tif.aux.xml", "tif.ovr", "tif.msk", "tfw", "TFW")),
    *(("t.tiff", f"t.{end}") for end in ("tiff.aux.xml", "tfw")),
    *(("t.gpkg", f"t.gpkg-{end}") for end in ("wal", "shm", "journal")),
    ("t.png", "t.pgw"),
    ("t.png", "t.png.aux.xml"),
    ("t.vrt", "t.vrt.ovr"),
]


def names_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def write(place: Path, text: str, overwrite: bool = False) -> None:
    with atomic_file(place, overwrite) as path:
        path.write_text(text)


@pytest.mark.parametrize(("name", "part"), PARTS)
def test_a_part_that_is_there_is_neither_replaced_nor_taken_for_one_of_the_new_file(
    tmp_path: Path, name: str, part: str
) -> None:
    (tmp_path / part).write_text("mine")
    with pytest.raises(OutputExistsError, match=rf"{part} exists and is a part of {name}; give --overwrite"):
        check_target(tmp_path / name)
    with pytest.raises(OutputExistsError):
        write(tmp_path / name, "new")
    assert names_in(tmp_path) == [part] and (tmp_path / part).read_text() == "mine"


@pytest.mark.parametrize(("name", "part"), PARTS)
def test_parts_of_an_older_output_go_with_it(tmp_path: Path, name: str, part: str) -> None:
    for old in (name, part):
        (tmp_path / old).write_text("old")
    write(tmp_path / name, "new", overwrite=True)
    assert names_in(tmp_path) == [name] and (tmp_path / name).read_text() == "new"


@pytest.mark.parametrize("other", ["u.dbf", "t.qml", "t.txt", "t.geojson", "tt.shx", "t.shp.bak", "t.tif"])
def test_files_that_are_no_parts_stay(tmp_path: Path, other: str) -> None:
    (tmp_path / other).write_text("mine")
    write(tmp_path / "t.shp", "first")
    write(tmp_path / "t.shp", "second", overwrite=True)
    assert names_in(tmp_path) == sorted([other, "t.shp"]) and (tmp_path / other).read_text() == "mine"


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_part_that_may_be_another_files_is_never_removed(tmp_path: Path, overwrite: bool) -> None:
    (tmp_path / "t.wld").write_text("of t.jpg")
    with pytest.raises(
        OutputError, match=r"t\.wld would be read as a part of .*t\.png and may belong to another"
    ):
        write(tmp_path / "t.png", "new", overwrite)
    assert names_in(tmp_path) == ["t.wld"]


def test_a_part_that_is_made_without_being_known_is_not_replaced_either(tmp_path: Path) -> None:
    (tmp_path / "t.other").write_text("mine")
    with pytest.raises(OutputExistsError, match=r"t\.other exists"), atomic_file(tmp_path / "t.shp") as path:
        path.write_text("new")
        path.with_suffix(".other").write_text("new")
    assert names_in(tmp_path) == ["t.other"] and (tmp_path / "t.other").read_text() == "mine"


# Symbolic links


@pytest.fixture
def linked(tmp_path: Path) -> Path:
    """A link to a file in another folder."""
    (tmp_path / "store").mkdir()
    (tmp_path / "store" / "real.tif").write_text("old")
    (tmp_path / "t.tif").symlink_to(Path("store") / "real.tif")
    return tmp_path


def test_a_link_exists(linked: Path) -> None:
    with pytest.raises(OutputExistsError, match=r"t\.tif exists; give --overwrite"):
        write(linked / "t.tif", "new")
    assert (linked / "store" / "real.tif").read_text() == "old"


def test_the_file_of_a_link_is_replaced_and_the_link_stays(linked: Path) -> None:
    (linked / "store" / "real.tif.ovr").write_text("old")
    with atomic_file(linked / "t.tif", overwrite=True) as path:
        assert path.parent.parent.parent == linked / "store"  # where it can be renamed
        path.write_text("new")
    assert (linked / "t.tif").is_symlink() and (linked / "t.tif").readlink() == Path("store/real.tif")
    assert (linked / "t.tif").read_text() == "new"
    assert names_in(linked) == ["store", "t.tif"] and names_in(linked / "store") == ["real.tif"]


def test_a_link_to_nothing_exists_and_is_written_through(linked: Path) -> None:
    (linked / "store" / "real.tif").unlink()
    with pytest.raises(OutputExistsError, match=r"t\.tif exists"):
        check_target(linked / "t.tif")
    write(linked / "t.tif", "new", overwrite=True)
    assert (linked / "t.tif").is_symlink() and (linked / "store" / "real.tif").read_text() == "new"


@pytest.mark.parametrize(
    ("to", "message"),
    [
        ("store/real.dat", r"a symbolic link to .*real\.dat, which does not end in \.tif"),
        ("nowhere/real.tif", r"the folder .*nowhere does not exist"),
        ("t.tif", r"leads in a circle"),
    ],
)
def test_a_link_that_leads_wrong_is_an_error(linked: Path, to: str, message: str) -> None:
    (linked / "t.tif").unlink()
    (linked / "t.tif").symlink_to(to)
    with pytest.raises(OutputError, match=message):
        write(linked / "t.tif", "new", overwrite=True)
    assert (linked / "t.tif").is_symlink() and names_in(linked / "store") == ["real.tif"]


def test_a_part_that_is_a_link_is_never_replaced_by_a_file(linked: Path) -> None:
    (linked / "t.dbf").symlink_to(Path("store") / "real.tif")
    with pytest.raises(OutputError, match=r"t\.dbf belongs to .*t\.shp and is a symbolic link"):
        write(linked / "t.shp", "new", overwrite=True)
    assert (linked / "t.dbf").is_symlink() and (linked / "t.dbf").read_text() == "old"


def test_parts_beside_a_link_are_not_read_with_the_new_file(linked: Path) -> None:
    (linked / "t.tif.aux.xml").write_text("statistics")
    with pytest.raises(OutputError, match=r"t\.tif\.aux\.xml is no part of .*real\.tif; move it away"):
        write(linked / "t.tif", "new", overwrite=True)
    assert (linked / "store" / "real.tif").read_text() == "old"


def test_a_folder_may_be_a_link(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    write(tmp_path / "link" / "t.tif", "new")
    assert (tmp_path / "link").is_symlink() and names_in(tmp_path / "real") == ["t.tif"]


# What cannot be replaced


def test_a_pipe_is_not_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "t.tif")
    with pytest.raises(OutputError, match=r"is no regular file; move it away"):
        write(tmp_path / "t.tif", "new", overwrite=True)
    assert (tmp_path / "t.tif").is_fifo()


def test_a_folder_of_the_name_of_a_part_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "t.dbf").mkdir()
    with pytest.raises(OutputError, match=r"t\.dbf belongs to .*t\.shp and is a folder"):
        write(tmp_path / "t.shp", "new", overwrite=True)
    assert names_in(tmp_path) == ["t.dbf"]


@pytest.mark.skipif(os.name == "nt", reason="names are UTF-16 on Windows")
def test_a_name_that_is_not_utf_8_is_refused(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="is not UTF-8; name the output otherwise"):
        check_target(os.path.join(os.fsencode(tmp_path), b"out\xe9.gpkg").decode("utf-8", "surrogateescape"))  # noqa: PTH118
