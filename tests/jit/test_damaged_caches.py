"""Cached machine code that is damaged or not to be trusted is compiled again."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from uavseg._jit import object_cache


def damage(path: Path, change: Callable[[bytes], bytes]) -> None:
    path.write_bytes(change(path.read_bytes()))


def flip_in_the_middle(content: bytes) -> bytes:
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 0x10]) + content[middle + 1 :]


def another_s(path: Path) -> None:
    """The file of another kernel, whole, under this name."""
    (found,) = set(path.parent.glob("*.o")) - {path}
    found.replace(path)


def linked(path: Path) -> None:
    """A link to a file that is whole."""
    path.rename(path.with_suffix(".kept"))
    path.symlink_to(path.with_suffix(".kept"))


def a_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def a_pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


DAMAGES: dict[str, Callable[[Path], object]] = {
    "empty": lambda path: damage(path, lambda content: b""),
    "cut": lambda path: damage(path, lambda content: content[: len(content) // 2]),
    "one byte short": lambda path: damage(path, lambda content: content[:-1]),
    "longer": lambda path: damage(path, lambda content: content + b"\0"),
    "zeros": lambda path: damage(path, lambda content: bytes(len(content))),
    "zeros at the end": lambda path: damage(path, lambda content: content[:-512] + bytes(512)),
    "a bit": lambda path: damage(path, flip_in_the_middle),
    "header": lambda path: damage(path, lambda content: content.replace(b"version 1", b"version 0", 1)),
    "no header": lambda path: damage(path, lambda content: content.split(b"\n", 2)[2]),
    "another's": another_s,
    "link": linked,
    "writable by the group": lambda path: path.chmod(0o620),
    "writable by all": lambda path: path.chmod(0o666),
    "unreadable": lambda path: path.chmod(0),
    "pipe": a_pipe,
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", DAMAGES)
def test_a_damaged_object_file_is_compiled_again(
    cache: Path, compiled: list[str], notes: list[str], kind: str, twice: Callable[..., int]
) -> None:
    if kind in {"writable by the group", "writable by all", "pipe"} and not hasattr(os, "geteuid"):
        pytest.skip("a matter of POSIX systems")
    if kind == "unreadable" and getattr(os, "geteuid", lambda: 0)() == 0:
        pytest.skip("root reads everything")
    assert twice() == 42
    (path,) = cache.glob("*.o")
    if kind == "another's":
        assert twice(3) == 63
    DAMAGES[kind](path)
    compiled.clear()
    assert [twice() for _ in range(3)] == 3 * [42]
    assert compiled == ["twice"]  # and replaced by a whole one
    assert not path.is_symlink() and path.stat().st_mode & 0o777 == 0o600
    assert notes == []


def test_a_folder_in_the_place_of_an_object_file_stops_no_work(
    cache: Path, compiled: list[str], notes: list[str], twice: Callable[..., int]
) -> None:
    assert twice() == 42
    (path,) = cache.glob("*.o")
    a_folder(path)
    assert [twice() for _ in range(2)] == [42, 42]
    assert compiled == 3 * ["twice"] and notes == []
    assert list(cache.iterdir()) == [path]


@pytest.mark.slow
def test_every_changed_byte_and_every_length_is_noticed(tmp_path: Path) -> None:
    content = b"name\n" + bytes(range(256)) + b"\n\n" + bytes(64)
    object_cache.store(tmp_path, "kernel-1", content)
    assert object_cache.read(tmp_path, "kernel-1") == content
    path = tmp_path / "kernel-1.o"
    whole = path.read_bytes()
    for at in range(len(whole)):
        for bit in (1, 128):
            path.write_bytes(whole[:at] + bytes([whole[at] ^ bit]) + whole[at + 1 :])
            assert object_cache.read(tmp_path, "kernel-1") is None, f"bit {bit} of byte {at}"
        path.write_bytes(whole[:at])
        assert object_cache.read(tmp_path, "kernel-1") is None, f"{at} bytes"
        path.write_bytes(whole[:at] + bytes(len(whole) - at))
        assert (object_cache.read(tmp_path, "kernel-1") is None) == any(whole[at:]), f"zeros from {at}"
    path.write_bytes(whole)
    assert object_cache.read(tmp_path, "kernel-1") == content


def emptied(folder: Path) -> None:
    shutil.rmtree(folder)
    folder.mkdir()


NUMBA_DAMAGES: dict[str, Callable[[Path], object]] = {
    "index": lambda folder: damage(next(folder.rglob("*.nbi")), lambda content: content[:-7]),
    "index of zeros": lambda folder: damage(next(folder.rglob("*.nbi")), lambda content: bytes(len(content))),
    "code": lambda folder: damage(next(folder.rglob("*.nbc")), flip_in_the_middle),
    "cut code": lambda folder: damage(next(folder.rglob("*.nbc")), lambda content: content[:100]),
    "no code": lambda folder: next(folder.rglob("*.nbc")).unlink(),
    "source": lambda folder: damage(folder / "kernel.py", lambda content: content + b"# more\n"),
    "checksum": lambda folder: (folder / "checksum").write_bytes(b"0"),
    "no checksum": lambda folder: (folder / "checksum").unlink(),
    "writable by all": lambda folder: folder.chmod(0o777),
    "empty": emptied,
}


@pytest.mark.parametrize("kind", NUMBA_DAMAGES)
def test_a_damaged_cache_of_numba_is_compiled_again(
    cache: Path, compiled: list[str], monkeypatch: pytest.MonkeyPatch, kind: str, twice: Callable[..., int]
) -> None:
    monkeypatch.setenv("UAVSEG_JIT", "numba")
    assert twice() == 42
    (folder,) = (cache / "numba").iterdir()
    NUMBA_DAMAGES[kind](folder)
    compiled.clear()
    assert [twice() for _ in range(3)] == 3 * [42]
    assert compiled == ["twice"]
    assert list((cache / "numba").iterdir()) == [folder] and folder.stat().st_mode & 0o777 == 0o700


def test_a_file_in_the_place_of_numba_s_caches_stops_no_work(
    cache: Path, compiled: list[str], monkeypatch: pytest.MonkeyPatch, twice: Callable[..., int]
) -> None:
    monkeypatch.setenv("UAVSEG_JIT", "numba")
    cache.mkdir(parents=True)
    (cache / "numba").write_text("")
    assert [twice() for _ in range(2)] == [42, 42]
    assert (cache / "numba").read_text() == ""
