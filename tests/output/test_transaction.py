"""Outputs that appear together: all of them, or none."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from uavseg.errors import OutputError, OutputExistsError
from uavseg.output import disk
from uavseg.output.atomic import atomic_file, transaction
from uavseg.output.disk import locked_folder, noted_stream, recording_written, written_here
from uavseg.output.staging import interrupts_held


def contents(folder: Path) -> dict[str, str]:
    """All files under a folder, hidden ones too; folders end in a slash."""
    return {
        str(path.relative_to(folder)): path.read_text() for path in folder.rglob("*") if path.is_file()
    } | {f"{path.relative_to(folder)}/": "" for path in folder.rglob("*") if path.is_dir()}


def write(place: Path, text: str = "new", overwrite: bool = False) -> None:
    with atomic_file(place, overwrite) as path:
        path.write_text(text)


def test_files_appear_at_the_end_of_a_transaction(tmp_path: Path) -> None:
    with transaction():
        write(tmp_path / "a.tif")
        write(tmp_path / "b.tif")
        assert [path.name[:8] for path in tmp_path.iterdir()] == [".uavseg-"]
    assert contents(tmp_path) == {"a.tif": "new", "b.tif": "new"}


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, OutputError])
def test_after_an_error_none_of_them_appears(tmp_path: Path, error: type[BaseException]) -> None:
    (tmp_path / "a.tif").write_text("old")
    with pytest.raises(error), transaction():
        write(tmp_path / "a.tif", overwrite=True)
        write(tmp_path / "b.tif")
        raise error
    assert contents(tmp_path) == {"a.tif": "old"}


def test_a_file_that_failed_is_left_out_where_its_error_is_caught(tmp_path: Path) -> None:
    with transaction():
        with pytest.raises(ValueError), atomic_file(tmp_path / "a.tif") as path:
            path.write_text("half")
            raise ValueError
        write(tmp_path / "b.tif")
    assert contents(tmp_path) == {"b.tif": "new"}


def test_a_file_that_came_into_being_meanwhile_is_kept_and_none_appears(tmp_path: Path) -> None:
    with pytest.raises(OutputExistsError, match=r"b\.tif exists"), transaction():
        write(tmp_path / "a.tif")
        write(tmp_path / "b.tif")
        (tmp_path / "b.tif").write_text("mine")
    assert contents(tmp_path) == {"b.tif": "mine"}


def test_two_outputs_cannot_have_the_same_file(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"two outputs have the file .*a\.pgm"), transaction():
        write(tmp_path / "a.pgm")
        with atomic_file(tmp_path / "a.yaml") as path:
            path.write_text("new")
            path.with_suffix(".pgm").write_text("new")
    assert contents(tmp_path) == {}


@pytest.mark.parametrize("fails", ["one", "two"])
def test_outputs_in_several_folders_are_all_undone(
    tmp_path: Path, fails: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "a.tif").write_text("old")
        (tmp_path / folder / "a.tfw").write_text("old")
    before = contents(tmp_path)
    put = disk.put_new

    def failing(source: Path, place: Path) -> None:
        if source.read_text() == "new" and place.parent.name == fails:
            raise OSError(28, "No space left on device")
        put(source, place)

    monkeypatch.setattr("uavseg.output.renames.put_new", failing)
    with pytest.raises(OutputError, match="cannot be written: No space left on device"), transaction():
        for folder in ("one", "two"):
            write(tmp_path / folder / "a.tif", overwrite=True)
    assert contents(tmp_path) == before


def test_journals_are_removed_where_one_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: list[Path] = []

    def failing(file: Path) -> None:
        if file.name == "journal.new":
            written.append(file)
            if len(written) == 2:
                raise OSError(28, "No space left on device")

    monkeypatch.setattr("uavseg.output.renames.sync_file", failing)
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
    with pytest.raises(OutputError, match="No space left on device"), transaction():
        for folder in ("one", "two"):
            write(tmp_path / folder / "a.tif")
    assert len(written) == 2 and contents(tmp_path) == {"one/": "", "two/": ""}


def test_a_file_system_without_hard_links_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As FAT, on which drones keep their pictures."""

    def refuse(*_: Any, **__: Any) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", refuse)
    write(tmp_path / "a.tif")
    with transaction():
        write(tmp_path / "b.tif")
        write(tmp_path / "c.tif")
    assert contents(tmp_path) == dict.fromkeys(("a.tif", "b.tif", "c.tif"), "new")
    with pytest.raises(FileExistsError):
        disk.put_new(tmp_path / "a.tif", tmp_path / "b.tif")


def test_a_folder_is_not_put_in_place_of_another(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    with pytest.raises(FileExistsError):
        disk.put_new(tmp_path / "a", tmp_path / "b")
    disk.put_new(tmp_path / "a", tmp_path / "c")
    assert contents(tmp_path) == {"b/": "", "c/": ""}


# Several runs at once

RACE = """
import sys, time
from pathlib import Path
from uavseg.output.atomic import atomic_file
name, number, overwrite, start = sys.argv[1], sys.argv[2], sys.argv[3] == "True", float(sys.argv[4])
try:
    with atomic_file(Path(name), overwrite) as path:
        for suffix in (path.suffix, ".one", ".two"):
            path.with_suffix(suffix).write_text(number)
        time.sleep(max(start - time.time(), 0))
except OSError as error:
    print(error)
    sys.exit(1)
"""


def race(target: Path, overwrite: bool) -> list[tuple[int, str]]:
    """Three processes that write the same target at the same moment."""
    start = str(time.time() + 1)
    command = [sys.executable, "-c", RACE, str(target)]
    started = [
        subprocess.Popen([*command, str(number), str(overwrite), start], stdout=subprocess.PIPE, text=True)
        for number in range(3)
    ]
    said = [one.communicate()[0] for one in started]
    return [(one.returncode, text) for one, text in zip(started, said, strict=True)]


@pytest.mark.slow
def test_of_three_runs_that_write_the_same_one_wins_and_two_report_it(tmp_path: Path) -> None:
    ended = race(tmp_path / "a.gpkg", overwrite=False)
    assert sorted(code for code, _ in ended) == [0, 1, 1]
    assert all("exists" in said for code, said in ended if code)
    [winner] = [number for number, (code, _) in enumerate(ended) if code == 0]
    assert contents(tmp_path) == dict.fromkeys(("a.gpkg", "a.one", "a.two"), str(winner))


@pytest.mark.slow
def test_of_three_runs_that_may_replace_the_last_wins_whole(tmp_path: Path) -> None:
    for _ in range(2):
        assert race(tmp_path / "a.gpkg", overwrite=True) == [(0, "")] * 3
        found = contents(tmp_path)
        assert sorted(found) == ["a.gpkg", "a.one", "a.two"] and len(set(found.values())) == 1


def test_threads_exclude_each_other_too(tmp_path: Path) -> None:
    barrier, told = threading.Barrier(4), []

    def work(number: int) -> None:
        try:
            with atomic_file(tmp_path / "a.tif") as path:
                path.write_text(str(number))
                barrier.wait(30)
        except OutputExistsError as error:
            told.append(str(error))

    workers = [threading.Thread(target=work, args=(number,)) for number in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert len(told) == 3 and list(contents(tmp_path)) == ["a.tif"]


def test_a_locked_folder_is_waited_for_and_not_for_ever(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("uavseg.output.disk.LOCK_TIMEOUT_S", 0.1)
    with locked_folder(tmp_path), pytest.raises(OutputError, match="another program has locked the folder"):
        write(tmp_path / "a.tif")
    assert contents(tmp_path) == {}


# Signals


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_takes_effect_when_it_is_no_longer_held(number: signal.Signals) -> None:
    came: list[str] = []
    former = signal.signal(number, lambda *_: came.append("came"))
    try:
        with interrupts_held():
            os.kill(os.getpid(), number)
            came.append("held")
        assert came == ["held", "came"]
    finally:
        signal.signal(number, former)


def test_ignored_signals_stay_ignored() -> None:
    former = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with interrupts_held():
            os.kill(os.getpid(), signal.SIGHUP)
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, former)


# What was written


def note(*acts: Callable[[], object]) -> str:
    with recording_written() as written:
        for act in acts:
            act()
        return str(written)


def test_what_was_written_is_reported(tmp_path: Path) -> None:
    first, second = tmp_path / "a.tif", tmp_path / "b.tif"
    assert note() == "nothing was written"
    assert note(lambda: write(first)) == f"{first} was written"
    assert (
        note(lambda: write(second), lambda: write(first, overwrite=True)) == f"{second}, {first} were written"
    )
    assert note(lambda: written_here().kept.append("kept"), lambda: written_here().kept.append("kept")) == (
        "nothing was written; finished tiles are kept in kept"
    )


def test_a_stream_that_was_not_ended_may_be_incomplete(tmp_path: Path) -> None:
    def stopped() -> None:
        with pytest.raises(KeyboardInterrupt), noted_stream("stdout"):
            raise KeyboardInterrupt

    assert note(stopped) == "stdout may be incomplete"
    assert note(lambda: write(tmp_path / "a.tif"), stopped) == (
        f"{tmp_path / 'a.tif'} was written; stdout may be incomplete"
    )


def test_a_file_of_a_checkpoint_is_no_output(tmp_path: Path) -> None:
    def save() -> None:
        with transaction(), atomic_file(tmp_path / "a.npz", overwrite=True, sync=False) as path:
            path.write_text("kept")

    assert note(save) == "nothing was written"
    assert contents(tmp_path) == {"a.npz": "kept"}
