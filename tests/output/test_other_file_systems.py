"""File systems of drones, shares and Windows: without hard links, without syncing, with other refusals."""

import errno
import os
import shutil
import types
from pathlib import Path
from typing import Any

import pytest

from uavseg.errors import OutputError, OutputExistsError
from uavseg.output import disk
from uavseg.output.atomic import atomic_file, transaction

NO_LINKS = ("EPERM", "EOPNOTSUPP", "ENOSYS", "EMLINK", "EINVAL", "EXDEV")
NO_SYNC = ("EINVAL", "EOPNOTSUPP", "ENOSYS")


def failing(name: str) -> Any:
    def fail(*_: Any, **__: Any) -> Any:
        raise OSError(getattr(errno, name), os.strerror(getattr(errno, name)))

    return fail


def write(path: Path, text: str = "new", overwrite: bool = False) -> None:
    with atomic_file(path, overwrite) as part:
        part.write_text(text)


def write_shapefile(path: Path, text: str = "new", overwrite: bool = False) -> None:
    with atomic_file(path, overwrite) as part:
        for suffix in (".shp", ".shx", ".dbf"):
            part.with_suffix(suffix).write_text(text)


def contents(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir() if path.is_file()}


def assert_outputs_hold(folder: Path) -> None:
    """Files appear whole, nothing is replaced without being asked, and nothing is left."""
    write(folder / "a.tif")
    with transaction():
        write(folder / "b.tif")
        write_shapefile(folder / "c.shp")
    names = ("a.tif", "b.tif", "c.shp", "c.shx", "c.dbf")
    assert contents(folder) == dict.fromkeys(names, "new")
    for act in (write, write_shapefile):
        with pytest.raises(OutputExistsError, match="exists"):
            act(folder / "c.shp", "newer")
    with pytest.raises(ZeroDivisionError), transaction():
        write(folder / "d.tif")
        raise ZeroDivisionError
    assert contents(folder) == dict.fromkeys(names, "new")
    write_shapefile(folder / "c.shp", "newer", overwrite=True)
    assert contents(folder)["c.dbf"] == "newer" and len(contents(folder)) == 5


def assert_exclusive(folder: Path) -> None:
    """A file that comes into being while another is made is kept."""
    with pytest.raises(OutputExistsError), atomic_file(folder / "e.tif") as part:
        part.write_text("ours")
        (folder / "e.tif").write_text("theirs")
    assert contents(folder)["e.tif"] == "theirs"


@pytest.mark.parametrize("name", NO_LINKS)
def test_without_hard_links(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setattr(os, "link", failing(name))
    assert_outputs_hold(tmp_path)
    assert_exclusive(tmp_path)


def test_another_error_of_a_link_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "link", failing("EIO"))
    with pytest.raises(OutputError, match=r"a\.tif cannot be written: Input/output error"):
        write(tmp_path / "a.tif")
    assert contents(tmp_path) == {}


@pytest.mark.parametrize("name", NO_SYNC)
def test_without_syncing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setattr(os, "fsync", failing(name))
    assert_outputs_hold(tmp_path)


@pytest.mark.parametrize("kind", ["file", "folder"])
def test_an_error_of_the_disk_when_syncing_is_an_error_and_leaves_the_old_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    write_shapefile(tmp_path / "a.shp", "old")
    fsync = os.fsync

    def fail(descriptor: int) -> None:
        if os.path.isdir(f"/proc/self/fd/{descriptor}") == (kind == "folder"):  # noqa: PTH112
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(OutputError, match=r"a\.shp cannot be written: Input/output error"):
        write_shapefile(tmp_path / "a.shp", "new", overwrite=True)
    monkeypatch.undo()
    assert contents(tmp_path) == dict.fromkeys(("a.shp", "a.shx", "a.dbf"), "old")


def test_folders_that_cannot_be_opened_as_on_windows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = os.open

    def refuse(path: Any, flags: int, *mode: Any, **more: Any) -> int:
        if Path(path).is_dir() and more.get("dir_fd") is None and flags == os.O_RDONLY:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        return opened(path, flags, *mode, **more)

    monkeypatch.setattr(os, "open", refuse)
    monkeypatch.setattr(shutil, "_use_fd_functions", False)  # which removes folders by opening them
    assert_outputs_hold(tmp_path)
    assert_exclusive(tmp_path)


def test_renaming_as_on_windows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """There a rename fails where the name exists, and no link is made."""
    rename = Path.rename

    def strict(path: Path, target: Path) -> Path:
        if os.path.lexists(target):
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(target))
        return rename(path, target)

    monkeypatch.setattr(disk, "os", types.SimpleNamespace(**vars(os) | {"name": "nt", "link": None}))
    monkeypatch.setattr(Path, "rename", strict)
    assert_outputs_hold(tmp_path)
    assert_exclusive(tmp_path)
