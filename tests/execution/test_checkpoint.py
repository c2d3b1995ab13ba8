"""A map that keeps its results: what is done is not done again, whatever happened to the run before."""

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
from uavseg.execution.checkpoint import kept, stage_name
from uavseg.execution.executors import Map, serial, threads
from uavseg.raster.tiling import Window

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
    def tell(done: int, total: int) -> None:
        if done == row:
            raise error

    return tell


def text(results: Any) -> str:
    return repr(list(results))


SQUARES = text(serial(partial(square_tile, 7), ITEMS))


@maps
def test_results_are_those_of_the_map_itself_and_made_once(run: Map, tmp_path: Path) -> None:
    told: list[Any] = []
    for calls in (list(range(20)), []):
        CALLS.clear()
        found = kept(run, tmp_path / "R", lambda *what: told.append(what))(partial(square_tile, 7), ITEMS)
        assert text(found) == SQUARES
        assert sorted(CALLS) == calls
    assert told == [("square", 20, 20)]
    assert len(list((tmp_path / "R").rglob("*.npz"))) == 20


@maps
@pytest.mark.parametrize("error", [KeyboardInterrupt(), ZeroDivisionError()])
def test_a_run_that_stopped_goes_on_where_it_stopped(run: Map, tmp_path: Path, error: BaseException) -> None:
    told: list[Any] = []
    again = kept(run, tmp_path, lambda *what: told.append(what))
    with pytest.raises(type(error)):
        list(again(partial(square_tile, 7), ITEMS, stopping_at(8, error)))
    CALLS.clear()
    assert text(again(partial(square_tile, 7), ITEMS)) == SQUARES
    assert sorted(CALLS) == list(range(8, 20))
    assert told == [("square", 8, 20)]


def test_nobody_works_on_once_a_run_has_stopped(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError):  # whose frames are still held below
        list(kept(threads(3), tmp_path)(slow_tile, ITEMS, stopping_at(2, ZeroDivisionError())))
    assert not AT_WORK


@maps
def test_items_may_be_done_in_any_pattern_and_change(run: Map, tmp_path: Path) -> None:
    list(kept(run, tmp_path)(partial(square_tile, 7), ITEMS[3:17:2]))
    CALLS.clear()
    assert text(kept(run, tmp_path)(partial(square_tile, 7), ITEMS)) == SQUARES
    assert sorted(CALLS) == sorted(set(range(20)) - set(range(3, 17, 2)))


def test_other_arguments_are_another_stage(tmp_path: Path) -> None:
    for offset in (1, 2):
        CALLS.clear()
        assert text(kept(serial, tmp_path)(partial(square_tile, offset), ITEMS)) == text(
            serial(partial(square_tile, offset), ITEMS)
        )
        assert len(CALLS) == 40
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize("what", ["__version__", "_code"])
def test_another_version_makes_everything_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    list(kept(serial, tmp_path)(partial(square_tile, 7), ITEMS))
    CALLS.clear()
    monkeypatch.setattr(uavseg.execution.checkpoint, what, "9" if what == "__version__" else lambda: "9")
    list(kept(serial, tmp_path)(partial(square_tile, 7), ITEMS))
    assert len(CALLS) == 20


def test_a_version_is_known_by_every_file_of_the_program(monkeypatch: pytest.MonkeyPatch) -> None:
    package = Path(uavseg.__file__).resolve().parent
    read: list[Path] = []

    def seen(path: Path) -> bytes:
        read.append(path.resolve())
        return b""

    monkeypatch.setattr(Path, "read_bytes", seen)
    uavseg.execution.checkpoint._code.__wrapped__()
    assert sorted(read) == sorted(package.rglob("*.py")) and package / "raster" / "tiling.py" in read


@maps
@pytest.mark.parametrize("damage", [b"", b"foreign", None], ids=["empty", "foreign", "swapped"])
def test_a_damaged_file_is_made_again(run: Map, tmp_path: Path, damage: bytes | None) -> None:
    list(kept(run, tmp_path)(partial(square_tile, 7), ITEMS))
    files = sorted(tmp_path.rglob("*.npz"))
    whole = [path.read_bytes() for path in files]
    files[5].write_bytes(whole[6] if damage is None else damage)
    CALLS.clear()
    assert text(kept(run, tmp_path)(partial(square_tile, 7), ITEMS)) == SQUARES
    assert len(CALLS) == 1
    assert [path.read_bytes() for path in files] == whole


@pytest.mark.parametrize("torn", [lambda whole: whole[: len(whole) // 2], lambda whole: bytes(len(whole))])
def test_a_file_that_a_power_cut_has_torn_is_made_again(
    tmp_path: Path, torn: Callable[[bytes], bytes]
) -> None:
    """It has its name, but only half of its content, or its length and nothing in it."""
    list(kept(serial, tmp_path)(partial(square_tile, 7), ITEMS))
    files = sorted(tmp_path.rglob("*.npz"))
    whole = [path.read_bytes() for path in files]
    for path, content in zip(files, whole, strict=True):
        path.write_bytes(torn(content))
    CALLS.clear()
    assert text(kept(serial, tmp_path)(partial(square_tile, 7), ITEMS)) == SQUARES
    assert sorted(CALLS) == list(range(20))
    assert [path.read_bytes() for path in files] == whole


def test_no_tile_waits_for_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "fsync", lambda descriptor: pytest.fail("a tile was synced"))
    assert text(kept(serial, tmp_path)(partial(square_tile, 7), ITEMS)) == SQUARES


def test_what_a_killed_run_left_half_written_does_no_harm(tmp_path: Path) -> None:
    again = kept(serial, tmp_path)
    list(again(partial(square_tile, 7), ITEMS[:3]))
    [stage] = tmp_path.iterdir()
    left = stage / ".0123.npz.abcd"
    left.mkdir()
    (left / "0123.npz").write_bytes(b"half")
    (tmp_path / "notes.txt").write_text("the user's")
    assert text(again(partial(square_tile, 7), ITEMS)) == SQUARES
    assert (tmp_path / "notes.txt").read_text() == "the user's"


@maps
def test_progress_counts_what_was_done_before_too(run: Map, tmp_path: Path) -> None:
    list(kept(run, tmp_path)(partial(square_tile, 7), ITEMS[:9]))
    told: list[Any] = []
    list(kept(run, tmp_path)(partial(square_tile, 7), ITEMS, lambda *done: told.append(done)))
    assert told == [(k, 20) for k in range(1, 21)]
    assert list(kept(run, tmp_path)(partial(square_tile, 7), [])) == []


def test_a_folder_that_cannot_be_is_told_of(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="file to resume from cannot be made: it is a file"):
        kept(serial, tmp_path / "file")
    with pytest.raises(OutputError, match="deep to resume from cannot be made: No such file"):
        kept(serial, tmp_path / "nowhere" / "deep")


def test_stages_are_named_for_people() -> None:
    assert stage_name(partial(square_tile, 7)) == "square"
    assert stage_name(partial(partial(square_tile), 7)) == "square"
    assert stage_name(_Callable()) == "callable"


class _Callable:
    def __call__(self, item: Any) -> Any:
        return item
