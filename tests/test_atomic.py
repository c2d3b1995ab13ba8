"""Atomic output files: complete or not at all, also after a crash."""

import os
import shutil
from pathlib import Path
from typing import Any

import pytest

from uavseg.errors import OutputError, OutputExistsError
from uavseg.output.atomic import atomic_file, check_target


def contents(folder: Path) -> dict[str, str]:
    """All files under a folder, hidden ones too, with their text."""
    return {str(path.relative_to(folder)): path.read_text() for path in folder.rglob("*") if path.is_file()}


def test_the_file_appears_at_the_end_and_nothing_else(tmp_path: Path) -> None:
    with atomic_file(tmp_path / "a.tif") as path:
        path.write_text("new")
        assert path.name == "a.tif"
        assert not (tmp_path / "a.tif").exists()
    assert contents(tmp_path) == {"a.tif": "new"}
    assert names_in(tmp_path) == ["a.tif"]


def names_in(folder: Path) -> list[str]:
    """Names of all entries of a folder, hidden ones too."""
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, MemoryError])
def test_an_error_leaves_nothing(tmp_path: Path, error: type[BaseException]) -> None:
    with pytest.raises(error), atomic_file(tmp_path / "a.tif") as path:
        path.write_text("half")
        raise error
    assert names_in(tmp_path) == []


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_error_leaves_the_existing_file(tmp_path: Path, error: type[BaseException]) -> None:
    (tmp_path / "a.tif").write_text("old")
    with pytest.raises(error), atomic_file(tmp_path / "a.tif", overwrite=True) as path:
        path.write_text("half")
        raise error
    assert contents(tmp_path) == {"a.tif": "old"}


def test_an_existing_file_is_replaced_only_if_allowed(tmp_path: Path) -> None:
    (tmp_path / "a.tif").write_text("old")
    with pytest.raises(OutputExistsError, match="--overwrite"), atomic_file(tmp_path / "a.tif"):
        pytest.fail("it was opened")
    assert contents(tmp_path) == {"a.tif": "old"}
    with atomic_file(tmp_path / "a.tif", overwrite=True) as path:
        path.write_text("new")
        assert (tmp_path / "a.tif").read_text() == "old"
    assert contents(tmp_path) == {"a.tif": "new"}


def test_several_parts_move_together(tmp_path: Path) -> None:
    (tmp_path / "a.dbf").write_text("old")
    (tmp_path / "b.shp").write_text("another's")
    with atomic_file(tmp_path / "a.shp", overwrite=True) as path:
        for suffix in (".shp", ".shx", ".dbf"):
            path.with_suffix(suffix).write_text(suffix)
    assert contents(tmp_path) == {"a.shp": ".shp", "a.shx": ".shx", "a.dbf": ".dbf", "b.shp": "another's"}


def test_several_parts_vanish_together(tmp_path: Path) -> None:
    with pytest.raises(ValueError), atomic_file(tmp_path / "a.shp") as path:
        for suffix in (".shp", ".shx", ".dbf"):
            path.with_suffix(suffix).write_text(suffix)
        raise ValueError
    assert names_in(tmp_path) == []


def test_a_file_that_was_not_written_does_not_appear(tmp_path: Path) -> None:
    with atomic_file(tmp_path / "a.tif"):
        pass
    assert names_in(tmp_path) == []


def test_of_two_writers_that_may_replace_the_last_one_wins(tmp_path: Path) -> None:
    place = tmp_path / "a.tif"
    with atomic_file(place, overwrite=True) as first, atomic_file(place, overwrite=True) as second:
        first.write_text("first")
        second.write_text("second")
    assert contents(tmp_path) == {"a.tif": "first"}  # the one that ends last


def test_of_two_writers_that_may_not_the_first_one_wins(tmp_path: Path) -> None:
    place = tmp_path / "a.tif"
    with (
        pytest.raises(OutputExistsError, match=r"a\.tif exists; give --overwrite"),
        atomic_file(place) as first,
    ):
        first.write_text("first")
        with atomic_file(place) as second:
            second.write_text("second")
    assert contents(tmp_path) == {"a.tif": "second"}


@pytest.mark.parametrize("act", [check_target, lambda path: atomic_file(path).__enter__()])
def test_a_missing_folder_is_refused(tmp_path: Path, act: object) -> None:
    with pytest.raises(OutputError, match=r"the folder .*nowhere does not exist; create it first"):
        act(tmp_path / "nowhere" / "a.tif")  # type: ignore[operator]
    assert names_in(tmp_path) == []


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_folder_is_not_a_valid_target(tmp_path: Path, overwrite: bool) -> None:
    (tmp_path / "out").mkdir()
    with pytest.raises(OutputError, match="is a folder; name a file in it"):
        check_target(tmp_path / "out", overwrite)
    with pytest.raises(OutputError, match="is a folder"), atomic_file(tmp_path / "out", overwrite):
        pytest.fail("it was opened")
    assert names_in(tmp_path) == ["out"]


def test_a_target_may_be_a_string_and_relative(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert check_target("a.tif") == Path("a.tif")
    with atomic_file("a.tif") as path:
        path.write_text("here")
    assert contents(tmp_path) == {"a.tif": "here"}


def test_a_read_only_folder_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(**_: object) -> str:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("uavseg.output.staging.tempfile.mkdtemp", refuse)
    with (
        pytest.raises(OutputError, match="cannot be written to: Permission denied"),
        atomic_file(tmp_path / "a.tif"),
    ):
        pytest.fail("it was opened")


# Power cuts


class Calls:
    """Records syncs and renames in their order."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.seen: list[tuple[str, str]] = []
        self._sync, self._replace, self._link = os.fsync, os.replace, os.link
        self._opened: dict[int, str] = {}
        self._open = os.open
        for name in ("open", "fsync", "replace", "link"):
            monkeypatch.setattr(os, name, getattr(self, f"_seen_{name}"))

    def _seen_open(self, path: Any, *how: Any, **more: Any) -> int:
        descriptor = self._open(path, *how, **more)
        self._opened[descriptor] = Path(os.fsdecode(path)).name
        return descriptor

    def _seen_fsync(self, descriptor: int) -> None:
        self.seen.append(("sync", self._opened[descriptor]))
        self._sync(descriptor)

    def _seen_replace(self, old: Any, new: Any) -> None:
        self.seen.append(("rename", Path(new).name))
        self._replace(old, new)

    def _seen_link(self, old: Any, new: Any, **how: Any) -> None:
        self.seen.append(("rename", Path(new).name))
        self._link(old, new, **how)


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> Calls:
    return Calls(monkeypatch)


def test_a_file_is_synced_before_it_is_renamed_and_its_folder_after(tmp_path: Path, calls: Calls) -> None:
    with atomic_file(tmp_path / "a.tif") as path:
        path.write_text("new")
    assert calls.seen == [("sync", "a.tif"), ("rename", "a.tif"), ("sync", tmp_path.name)]


def test_all_parts_are_synced_before_the_first_is_renamed(tmp_path: Path, calls: Calls) -> None:
    with atomic_file(tmp_path / "a.vrt") as path:
        (path.parent / "a.tiles" / "deep").mkdir(parents=True)
        for part in ("a.vrt", "a.tiles/1.tif", "a.tiles/deep/2.tif"):
            (path.parent / part).write_text(part)
    synced = [name for what, name in calls.seen[:5] if what == "sync"]
    assert sorted(synced) == ["1.tif", "2.tif", "a.tiles", "a.vrt", "deep"]
    assert synced.index("2.tif") < synced.index("deep") and synced.index("1.tif") < synced.index("a.tiles")
    journal, stage = calls.seen[5:7], calls.seen[7]
    assert journal == [("sync", "journal.new"), ("rename", "journal")] and stage[1].startswith(".uavseg-")
    assert calls.seen[8:] == [("rename", "a.tiles"), ("rename", "a.vrt"), ("sync", tmp_path.name)]


def test_nothing_is_synced_after_an_error(tmp_path: Path, calls: Calls) -> None:
    with pytest.raises(ValueError), atomic_file(tmp_path / "a.tif") as path:
        path.write_text("half")
        raise ValueError
    assert calls.seen == []


def test_syncing_can_be_left_out(tmp_path: Path, calls: Calls) -> None:
    with atomic_file(tmp_path / "a.npz", sync=False) as path:
        path.write_text("new")
    assert calls.seen == [("rename", "a.npz")]


def test_files_are_synced_where_folders_cannot_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, calls: Calls
) -> None:
    """As on Windows, where a folder cannot be opened."""
    opened = os.open

    def refuse(path: Any, *how: Any, **more: Any) -> int:
        if Path(path).is_dir():
            raise PermissionError(13, "Permission denied")
        return opened(path, *how, **more)

    monkeypatch.setattr(os, "open", refuse)
    monkeypatch.setattr(shutil, "_use_fd_functions", False)  # which removes folders by opening them
    with atomic_file(tmp_path / "a.tif") as path:
        path.write_text("new")
        (path.parent / "a.tiles").mkdir()
    journal = [("sync", "journal.new"), ("rename", "journal")]
    assert calls.seen == [("sync", "a.tif"), *journal, ("rename", "a.tiles"), ("rename", "a.tif")]
    assert contents(tmp_path) == {"a.tif": "new"}


def test_a_disk_that_is_full_when_a_file_is_synced_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    (tmp_path / "a.tif").write_text("old")
    monkeypatch.setattr(os, "fsync", fail)
    with (
        pytest.raises(OutputError, match=r"a\.tif cannot be written: No space left on device"),
        atomic_file(tmp_path / "a.tif", overwrite=True) as path,
    ):
        path.write_text("new")
    assert contents(tmp_path) == {"a.tif": "old"}
