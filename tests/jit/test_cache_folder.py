"""Where the caches are, and whom they belong to."""

import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest

from uavseg._jit import object_cache

posix = pytest.mark.skipif(
    not hasattr(os, "geteuid"), reason="files have an owner and a mode on POSIX systems"
)


@pytest.fixture
def homeless(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """No folder for caches at home; the folder for temporary files is this one, and empty."""
    (tmp_path / "home").write_text("a file, so that no folder can be made in it")
    monkeypatch.delenv("UAVSEG_CACHE", raising=False)
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA", "HOME"):
        monkeypatch.setenv(name, str(tmp_path / "home"))
    monkeypatch.setattr(object_cache, "_process_folder", None)
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    return tmp_path / "temporary"


@pytest.mark.slow
@posix
def test_where_the_user_s_folder_cannot_be_written_a_private_one_serves(
    engine: str, homeless: Path, compiled: list[str], tmp_path: Path, twice: Callable[..., int]
) -> None:
    for _ in range(3):
        assert twice() == 42
    assert compiled == ["twice"]
    folder = homeless / f"uavseg-{os.geteuid()}"
    assert list(homeless.iterdir()) == [folder]
    assert folder.stat().st_mode & 0o777 == 0o700
    assert list(folder.iterdir()) != [] and list(tmp_path.glob("*.o")) == []


def open_to_others(folder: Path) -> None:
    folder.mkdir()
    folder.chmod(0o750)


def a_link(folder: Path) -> None:
    (folder.parent / "elsewhere").mkdir(mode=0o700)
    folder.symlink_to(folder.parent / "elsewhere")


@pytest.mark.slow
@posix
@pytest.mark.parametrize("made", [open_to_others, a_link, Path.touch], ids=["open", "link", "file"])
def test_a_temporary_folder_that_others_may_have_made_is_not_used(
    homeless: Path, compiled: list[str], made: Callable[[Path], None], twice: Callable[..., int]
) -> None:
    taken = homeless / f"uavseg-{os.geteuid()}"
    made(taken)
    before = {path: path.lstat().st_mtime_ns for path in homeless.rglob("*")}
    for _ in range(2):
        assert twice() == 42
    assert compiled == ["twice"]  # once for the process, in a folder of its own
    assert {path: path.lstat().st_mtime_ns for path in before} == before
    used = object_cache.cache_folder()
    assert used is not None and used != taken and used.stat().st_mode & 0o777 == 0o700


@posix
@pytest.mark.parametrize("place", ["temporary", "home"])
def test_a_folder_of_somebody_else_is_not_used(
    homeless: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    taken = tmp_path / "cache" / "kernels" if place == "home" else homeless / "uavseg-4321"
    taken.mkdir(mode=0o700, parents=True)
    if os.geteuid() == 0:
        os.chown(taken, 1234, -1)  # what root has made is trusted
    if place == "home":
        monkeypatch.setenv("UAVSEG_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(os, "geteuid", lambda: 4321)
    used = object_cache.cache_folder()
    assert used is not None and used != taken and used.is_relative_to(homeless)
    assert list(taken.iterdir()) == []


def test_without_any_folder_a_kernel_is_compiled_in_each_process(
    engine: str,
    homeless: Path,
    compiled: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    twice: Callable[..., int],
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "missing"))
    assert object_cache.cache_folder() is None
    assert [twice() for _ in range(2)] == [42, 42]
    assert compiled == ["twice", "twice"]


@posix
def test_the_user_s_own_folder_is_closed_to_the_writing_of_others(cache: Path) -> None:
    cache.mkdir(parents=True)
    cache.chmod(0o777)
    assert object_cache.cache_folder() == cache
    assert cache.stat().st_mode & 0o777 == 0o755


def test_the_cache_lies_where_the_user_keeps_caches(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compiled: list[str], twice: Callable[..., int]
) -> None:
    monkeypatch.delenv("UAVSEG_CACHE", raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    assert twice() == 42
    assert len(list((tmp_path / "caches" / "uavseg" / "kernels").glob("twice-*.o"))) == 1


def test_a_full_disk_keeps_no_machine_code_and_stops_no_work(
    cache: Path, compiled: list[str], twice: Callable[..., int]
) -> None:
    resource = pytest.importorskip("resource", reason="only Unix limits the size of files")
    usual = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, usual[1]))
    try:
        assert [twice() for _ in range(2)] == [42, 42]
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, usual)
    assert len(compiled) == 2 and list(cache.iterdir()) == []


@posix
def test_only_files_of_the_user_and_of_root_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    object_cache.store(tmp_path, "kernel-1", b"content")
    owner = (tmp_path / "kernel-1.o").stat().st_uid
    assert object_cache.read(tmp_path, "kernel-1") == b"content"
    monkeypatch.setattr(os, "geteuid", lambda: 4321)
    assert object_cache.read(tmp_path, "kernel-1") == (b"content" if owner == 0 else None)
    if owner == 0:
        os.chown(tmp_path / "kernel-1.o", 1234, -1)
        assert object_cache.read(tmp_path, "kernel-1") is None
        os.chown(tmp_path / "kernel-1.o", 4321, -1)
        assert object_cache.read(tmp_path, "kernel-1") == b"content"
