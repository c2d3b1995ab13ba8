"""What killed runs leave is undone and removed; what others made is left alone."""

import fcntl
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from uavseg.errors import OutputError
from uavseg.output.atomic import atomic_file, check_target
from uavseg.output.renames import recover
from uavseg.output.staging import PREFIX, Stage

KILLED = """
import os, signal, sys
from pathlib import Path
from uavseg.output.atomic import atomic_file
with atomic_file(Path(sys.argv[1]), overwrite=True) as path:
    for suffix in (".shp", ".shx", ".dbf"):
        path.with_suffix(suffix).write_text("new")
    calls = 0
    def stop(*arguments, _link=os.link, **more):
        global calls
        calls += 1
        if calls == int(sys.argv[2]):
            os.kill(os.getpid(), signal.SIGKILL)
        _link(*arguments, **more)
    os.link = stop
"""


def contents(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir() if path.is_file()}


def killed(folder: Path, at: int) -> Path:
    """A run that replaces a shapefile and is killed before it places a part; its staging folder."""
    ran = subprocess.run([sys.executable, "-c", KILLED, str(folder / "t.shp"), str(at)], check=False)
    assert ran.returncode == -9
    [left] = [path for path in folder.iterdir() if path.name.startswith(PREFIX)]
    return left


@pytest.fixture
def older(tmp_path: Path) -> Path:
    """A folder with a shapefile, and an index of it."""
    for suffix in (".shp", ".shx", ".dbf", ".qix"):
        (tmp_path / f"t{suffix}").write_text("old")
    return tmp_path


OLD = {f"t{suffix}": "old" for suffix in (".shp", ".shx", ".dbf", ".qix")}


@pytest.mark.parametrize("at", [1, 2, 3])
def test_a_killed_run_is_undone_when_the_next_one_asks_whether_it_may_write(older: Path, at: int) -> None:
    killed(older, at)
    assert "t.shp" not in contents(older)  # nothing can be read that is of two runs
    check_target(older / "other.tif")
    assert contents(older) == OLD and len(list(older.iterdir())) == 4


def test_parts_that_a_killed_run_placed_are_taken_away(tmp_path: Path) -> None:
    killed(tmp_path, 3)
    assert set(contents(tmp_path)) == {"t.dbf", "t.shx"}
    check_target(tmp_path / "other.tif")
    assert list(tmp_path.iterdir()) == []


def test_a_living_run_is_left_alone(older: Path) -> None:
    with atomic_file(older / "t.shp", overwrite=True) as path:
        path.write_text("new")
        assert recover(older) == {} and path.read_text() == "new"
    assert contents(older) == {"t.shp": "new"}


def test_what_a_person_made_since_is_kept_and_blocks_only_its_own_name(older: Path) -> None:
    left = killed(older, 3)
    (older / "t.shp").write_text("mine")
    check_target(older / "other.tif")
    with pytest.raises(OutputError, match=r"old ones in .* cannot be put back: .*t\.shp is there again"):
        check_target(older / "t.shp", overwrite=True)
    assert contents(older)["t.shp"] == "mine" and left.is_dir()
    (older / "t.shp").unlink()
    check_target(older / "t.shp", overwrite=True)
    assert contents(older) == OLD and not left.exists()


def test_a_part_that_was_changed_since_is_not_removed(older: Path) -> None:
    killed(older, 3)
    (older / "t.dbf").write_text("changed by somebody")
    with pytest.raises(OutputError, match=r"t\.dbf is there again"):
        check_target(older / "t.shp", overwrite=True)
    assert contents(older)["t.dbf"] == "changed by somebody"


# Folders of strangers: an archive that is unpacked may hold anything


@pytest.fixture
def crafted(tmp_path: Path) -> Path:
    """A folder such as an archive may bring along, beside a file of the user."""
    folder = tmp_path / "work" / f"{PREFIX}stranger"
    for name in ("old", "0"):
        (folder / name).mkdir(parents=True, mode=0o755)
    folder.chmod(0o755)
    (tmp_path / "work" / "mine.txt").write_text("mine")
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "theirs.txt").write_text("theirs")
    return folder


def journal(folder: Path, **content: Any) -> None:
    whole = {"version": 1, "old": [], "new": []} | content
    (folder / "journal").write_text(json.dumps(whole))


def new_file(
    name: str, folder: str = "0", inode: int = 0, size: int = 4, mtime_ns: int = 0
) -> dict[str, Any]:
    return {"folder": folder, "name": name, "inode": inode, "size": size, "mtime_ns": mtime_ns}


def assert_untouched(tmp_path: Path) -> None:
    assert (tmp_path / "work" / "mine.txt").read_text() == "mine"
    assert contents(tmp_path / "elsewhere") == {"theirs.txt": "theirs"}


@pytest.mark.parametrize(
    "name", ["../elsewhere/theirs.txt", "/etc/hostname", "..", ".", "", "a/b", "a\0b", 7, None]
)
@pytest.mark.parametrize("key", ["old", "new", "folder"])
def test_a_journal_names_nothing_outside_of_its_folder(
    tmp_path: Path, crafted: Path, name: Any, key: str
) -> None:
    (crafted / "0" / "waiting").write_text("new")
    one: Any = {"old": name, "new": new_file(name), "folder": new_file("mine.txt", folder=name)}[key]
    journal(crafted, **{"old" if key == "old" else "new": [one]})
    recover(crafted.parent)
    assert_untouched(tmp_path)
    assert (crafted / "journal").exists()  # it is not used, and so it is left


def test_a_journal_does_not_move_files_through_links(tmp_path: Path, crafted: Path) -> None:
    (crafted / "old").rmdir()
    (crafted / "old").symlink_to(tmp_path / "elsewhere")
    (crafted / "0" / "waiting").write_text("new")
    journal(crafted, old=["theirs.txt"], new=[new_file("waiting")])
    recover(crafted.parent)
    assert_untouched(tmp_path)
    assert sorted(contents(crafted.parent)) == ["mine.txt"]


def test_a_journal_removes_no_file_that_it_does_not_know(tmp_path: Path, crafted: Path) -> None:
    (crafted / "0" / "waiting").write_text("new")
    journal(
        crafted,
        new=[
            new_file("mine.txt", inode=(crafted.parent / "mine.txt").stat().st_ino + 1),
            new_file("waiting"),
        ],
    )
    recover(crafted.parent)
    assert_untouched(tmp_path)


def test_a_journal_replaces_no_file(tmp_path: Path, crafted: Path) -> None:
    (crafted / "old" / "mine.txt").write_text("theirs")
    (crafted / "0" / "waiting").write_text("new")
    journal(crafted, old=["mine.txt"], new=[new_file("waiting")])
    recover(crafted.parent)
    assert_untouched(tmp_path)


def test_links_in_a_folder_are_removed_and_not_followed(tmp_path: Path, crafted: Path) -> None:
    (crafted / "0" / "link").symlink_to(tmp_path / "elsewhere")
    recover(crafted.parent)
    assert_untouched(tmp_path)
    assert not crafted.exists()


def test_a_folder_that_others_may_write_to_is_left_alone(tmp_path: Path, crafted: Path) -> None:
    crafted.chmod(0o777)
    recover(crafted.parent)
    assert crafted.exists()


def test_a_folder_of_another_user_is_left_alone(crafted: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: crafted.stat().st_uid + 1)
    recover(crafted.parent)
    assert crafted.exists()


@pytest.mark.parametrize("kind", ["link", "pipe", "folder", "long", "text", "deep"])
def test_a_journal_of_another_kind_is_not_read(tmp_path: Path, crafted: Path, kind: str) -> None:
    place = crafted / "journal"
    if kind == "link":
        place.symlink_to(tmp_path / "elsewhere" / "theirs.txt")
    elif kind == "pipe":
        os.mkfifo(place)
    elif kind == "folder":
        place.mkdir()
    else:
        place.write_text({"long": " " * (1 << 21), "text": "no", "deep": "[" * 100_000}[kind])
    recover(crafted.parent)
    assert crafted.exists()
    assert_untouched(tmp_path)


def test_a_link_of_the_name_of_a_staging_folder_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "theirs.txt").write_text("theirs")
    (tmp_path / "work").mkdir()
    (tmp_path / "work" / f"{PREFIX}link").symlink_to(tmp_path / "elsewhere")
    recover(tmp_path / "work")
    assert contents(tmp_path / "elsewhere") == {"theirs.txt": "theirs"}


# Locks


def test_a_folder_whose_lock_another_holds_is_left_alone(tmp_path: Path) -> None:
    folder = tmp_path / f"{PREFIX}other"
    folder.mkdir(mode=0o700)
    with (folder / "lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        recover(tmp_path)
        assert folder.exists()
    recover(tmp_path)
    assert not folder.exists()


def test_a_file_system_without_locks_keeps_what_killed_runs_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: Any) -> None:
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(fcntl, "flock", refuse)
    (tmp_path / f"{PREFIX}other").mkdir(mode=0o700)
    with atomic_file(tmp_path / "t.tif") as path:
        path.write_text("new")
    assert sorted(one.name for one in tmp_path.iterdir()) == [f"{PREFIX}other", "t.tif"]


def test_a_folder_that_was_taken_for_a_dead_one_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another run may lock and remove a folder between its making and its lock."""
    from uavseg.output import staging

    lock, taken = staging._locked, []

    def late(folder: Path) -> tuple[int, bool | None]:
        if not taken:
            taken.append(folder)
            recover(tmp_path)
        return lock(folder)

    monkeypatch.setattr(staging, "_locked", late)
    stage = Stage.make(tmp_path)
    assert taken and stage.folder.is_dir() and stage.folder != taken[0]
    stage.remove()
    assert list(tmp_path.iterdir()) == []


def test_a_folder_is_locked_until_it_is_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Else a run that made it, and lost it before its lock, would lock it now and lose its files."""
    from uavseg.output import staging

    remove, locked = staging.shutil.rmtree, []

    def watched(folder: Path, **options: bool) -> None:
        descriptor, found = staging._locked(folder)
        os.close(descriptor)
        locked.append(found)
        remove(folder, **options)

    monkeypatch.setattr(staging.shutil, "rmtree", watched)
    Stage.make(tmp_path).remove()
    assert locked == [False]
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_locked_is_an_error_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from uavseg.output import staging

    def full(folder: Path) -> tuple[int, bool | None]:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(staging, "_locked", full)
    with pytest.raises(OutputError, match="cannot be written to: No space left"):
        Stage.make(tmp_path)
    assert list(tmp_path.iterdir()) == []
