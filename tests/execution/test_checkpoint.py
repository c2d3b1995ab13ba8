"""Checkpoints: finished work is not repeated, whatever stopped the run before."""

import os
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import uavseg.execution.checkpoint
from uavseg.errors import OutputError
from uavseg.execution.checkpoint import stage_name, with_checkpoint
from uavseg.execution.executors import Map, serial, threads
from uavseg.raster.grid.tiling import Window

maps = pytest.mark.parametrize("run", [serial, threads(3)], ids=["serial", "3 threads"])
ITEMS = [Window(k, 0, 1, 1) for k in range(20)]
CALLS: list[int] = []
AT_WORK: set[int] = set()
LOCK = threading.Lock()


@pytest.fixture(autouse=True)
def no_calls() -> None:
    CALLS.clear()


def square_tile(offset: int, window: Window) -> tuple[np.ndarray, Window] | None:
    with LOCK:
        CALLS.append(window.row)
    if window.row % 5 == 4:
        return None
    return np.arange(window.row) ** 2 + offset, window


def slow_tile(window: Window) -> int:
    AT_WORK.add(window.row)
    time.sleep(0.05)
    AT_WORK.discard(window.row)
    return window.row


def stopping_at(row: int, error: BaseException) -> Callable[[int, int], None]:
    def report(done: int, total: int) -> None:
        if done == row:
            raise error

    return report


def text(results: Any) -> str:
    return repr(list(results))


SQUARES = text(serial(partial(square_tile, 7), ITEMS))


@maps
def test_results_are_those_of_the_executor_and_computed_once(run: Map, tmp_path: Path) -> None:
    reported: list[Any] = []
    for calls in (list(range(20)), []):
        CALLS.clear()
        found = with_checkpoint(run, tmp_path / "R", lambda *what: reported.append(what))(
            partial(square_tile, 7), ITEMS
        )
        assert text(found) == SQUARES
        assert sorted(CALLS) == calls
    assert reported == [("square", 20, 20)]
    assert len(list((tmp_path / "R").rglob("*.npz"))) == 20


@maps
@pytest.mark.parametrize("error", [KeyboardInterrupt(), ZeroDivisionError()])
def test_a_stopped_run_resumes_where_it_stopped(run: Map, tmp_path: Path, error: BaseException) -> None:
    reported: list[Any] = []
    again = with_checkpoint(run, tmp_path, lambda *what: reported.append(what))
    with pytest.raises(type(error)):
        list(again(partial(square_tile, 7), ITEMS, stopping_at(8, error)))
    CALLS.clear()
    assert text(again(partial(square_tile, 7), ITEMS)) == SQUARES
    assert sorted(CALLS) == list(range(8, 20))
    assert reported == [("square", 8, 20)]


def test_no_work_continues_after_a_run_has_stopped(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError):  # its frames are still referenced below
        list(with_checkpoint(threads(3), tmp_path)(slow_tile, ITEMS, stopping_at(2, ZeroDivisionError())))
    assert not AT_WORK


@maps
def test_any_subset_of_the_items_may_be_done_already(run: Map, tmp_path: Path) -> None:
    list(with_checkpoint(run, tmp_path)(partial(square_tile, 7), ITEMS[3:17:2]))
    CALLS.clear()
    assert text(with_checkpoint(run, tmp_path)(partial(square_tile, 7), ITEMS)) == SQUARES
    assert sorted(CALLS) == sorted(set(range(20)) - set(range(3, 17, 2)))


def test_other_arguments_are_another_stage(tmp_path: Path) -> None:
    for offset in (1, 2):
        CALLS.clear()
        assert text(with_checkpoint(serial, tmp_path)(partial(square_tile, offset), ITEMS)) == text(
            serial(partial(square_tile, offset), ITEMS)
        )
        assert len(CALLS) == 40
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize("what", ["__version__", "_code_hash"])
def test_another_version_of_the_program_computes_everything_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    list(with_checkpoint(serial, tmp_path)(partial(square_tile, 7), ITEMS))
    CALLS.clear()
    monkeypatch.setattr(uavseg.execution.checkpoint, what, "9" if what == "__version__" else lambda: "9")
    list(with_checkpoint(serial, tmp_path)(partial(square_tile, 7), ITEMS))
    assert len(CALLS) == 20


def test_the_hash_of_the_program_covers_every_module_and_table(monkeypatch: pytest.MonkeyPatch) -> None:
    package = Path(uavseg.__file__).resolve().parent
    read: list[Path] = []

    def seen(path: Path) -> bytes:
        read.append(path.resolve())
        return b""

    monkeypatch.setattr(Path, "read_bytes", seen)
    uavseg.execution.checkpoint._code_hash.__wrapped__()
    brought = {".py", ".csv", ".json", ".sql"}
    every = [path for path in package.rglob("*") if path.suffix in brought]
    assert sorted(read) == sorted(every) and package / "raster" / "grid" / "tiling.py" in read
    assert brought == {path.suffix for path in read}


@maps
@pytest.mark.parametrize("damage", [b"", b"foreign", None], ids=["empty", "foreign", "swapped"])
def test_a_damaged_file_is_computed_again(run: Map, tmp_path: Path, damage: bytes | None) -> None:
    list(with_checkpoint(run, tmp_path)(partial(square_tile, 7), ITEMS))
    files = sorted(tmp_path.rglob("*.npz"))
    whole = [path.read_bytes() for path in files]
    files[5].write_bytes(whole[6] if damage is None else damage)
    CALLS.clear()
    assert text(with_checkpoint(run, tmp_path)(partial(square_tile, 7), ITEMS)) == SQUARES
    assert len(CALLS) == 1
    assert [path.read_bytes() for path in files] == whole


@pytest.mark.parametrize("torn", [lambda whole: whole[: len(whole) // 2], lambda whole: bytes(len(whole))])
def test_a_file_torn_by_a_power_cut_is_computed_again(tmp_path: Path, torn: Callable[[bytes], bytes]) -> None:
    """It has its name, but only half of its content, or its length and only zeros."""
    list(with_checkpoint(serial, tmp_path)(partial(square_tile, 7), ITEMS))
    files = sorted(tmp_path.rglob("*.npz"))
    whole = [path.read_bytes() for path in files]
    for path, content in zip(files, whole, strict=True):
        path.write_bytes(torn(content))
    CALLS.clear()
    assert text(with_checkpoint(serial, tmp_path)(partial(square_tile, 7), ITEMS)) == SQUARES
    assert sorted(CALLS) == list(range(20))
    assert [path.read_bytes() for path in files] == whole


def test_no_tile_is_synced_to_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "fsync", lambda descriptor: pytest.fail("a tile was synced"))
    assert text(with_checkpoint(serial, tmp_path)(partial(square_tile, 7), ITEMS)) == SQUARES


def test_half_written_files_of_a_killed_run_are_ignored(tmp_path: Path) -> None:
    again = with_checkpoint(serial, tmp_path)
    list(again(partial(square_tile, 7), ITEMS[:3]))
    [stage] = tmp_path.iterdir()
    left = stage / ".0123.npz.abcd"
    left.mkdir()
    (left / "0123.npz").write_bytes(b"half")
    (tmp_path / "notes.txt").write_text("the user's")
    assert text(again(partial(square_tile, 7), ITEMS)) == SQUARES
    assert (tmp_path / "notes.txt").read_text() == "the user's"


@maps
def test_progress_counts_the_items_that_are_done_already(run: Map, tmp_path: Path) -> None:
    list(with_checkpoint(run, tmp_path)(partial(square_tile, 7), ITEMS[:9]))
    reported: list[Any] = []
    list(with_checkpoint(run, tmp_path)(partial(square_tile, 7), ITEMS, lambda *done: reported.append(done)))
    assert reported == [(k, 20) for k in range(1, 21)]
    assert list(with_checkpoint(run, tmp_path)(partial(square_tile, 7), [])) == []


def test_an_empty_name_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(OutputError, match="the name of the folder for resume is empty"):
        with_checkpoint(serial, "")
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_created_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="file to resume from cannot be created: it is a file"):
        with_checkpoint(serial, tmp_path / "file")
    with pytest.raises(OutputError, match="deep to resume from cannot be created: No such file"):
        with_checkpoint(serial, tmp_path / "nowhere" / "deep")


def test_stages_have_readable_names() -> None:
    assert stage_name(partial(square_tile, 7)) == "square"
    assert stage_name(partial(partial(square_tile), 7)) == "square"
    assert stage_name(_Callable()) == "callable"


class _Callable:
    def __call__(self, item: Any) -> Any:
        return item


def test_what_a_killed_run_left_in_the_folder_is_removed(tmp_path: Path) -> None:
    list(with_checkpoint(serial, tmp_path)(partial(square_tile, 7), ITEMS[:3]))
    [stage] = tmp_path.iterdir()
    left = stage / ".uavseg-killed" / "0"
    left.mkdir(parents=True)
    left.parent.chmod(0o700)
    (left / "half.npz").write_text("half")
    assert text(with_checkpoint(serial, tmp_path)(partial(square_tile, 7), ITEMS)) == SQUARES
    assert not left.parent.exists() and len(list(stage.iterdir())) == 20


def test_a_folder_whose_name_is_too_long_is_refused_in_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot be created: File name too long"):
        with_checkpoint(serial, tmp_path / ("a" * 300))


def test_a_folder_whose_name_is_no_text_is_refused_and_not_made(tmp_path: Path) -> None:
    folder = tmp_path / "out\udce9"
    with pytest.raises(OutputError, match="is not UTF-8; name the output otherwise"):
        with_checkpoint(serial, folder)
    assert not list(tmp_path.iterdir())
