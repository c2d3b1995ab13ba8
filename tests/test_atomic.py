"""A file appears whole or not at all."""

from pathlib import Path

import pytest

from uavseg.atomic import check_target, whole_file
from uavseg.errors import OutputError, OutputExistsError


def contents(folder: Path) -> dict[str, str]:
    """Everything under a folder, hidden or not."""
    return {str(path.relative_to(folder)): path.read_text() for path in folder.rglob("*") if path.is_file()}


def test_what_is_written_is_there_at_the_end_and_nothing_else(tmp_path: Path) -> None:
    with whole_file(tmp_path / "a.tif") as path:
        path.write_text("new")
        assert path.name == "a.tif"
        assert not (tmp_path / "a.tif").exists()
    assert contents(tmp_path) == {"a.tif": "new"}
    assert names_in(tmp_path) == ["a.tif"]


def names_in(folder: Path) -> list[str]:
    """What lies in a folder, hidden or not."""
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, MemoryError])
def test_an_error_leaves_nothing(tmp_path: Path, error: type[BaseException]) -> None:
    with pytest.raises(error), whole_file(tmp_path / "a.tif") as path:
        path.write_text("half")
        raise error
    assert names_in(tmp_path) == []


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_error_leaves_the_file_that_was_there(tmp_path: Path, error: type[BaseException]) -> None:
    (tmp_path / "a.tif").write_text("old")
    with pytest.raises(error), whole_file(tmp_path / "a.tif", overwrite=True) as path:
        path.write_text("half")
        raise error
    assert contents(tmp_path) == {"a.tif": "old"}


def test_a_file_that_is_there_is_left_alone_unless_allowed(tmp_path: Path) -> None:
    (tmp_path / "a.tif").write_text("old")
    with pytest.raises(OutputExistsError, match="--overwrite"), whole_file(tmp_path / "a.tif"):
        pytest.fail("it was opened")
    assert contents(tmp_path) == {"a.tif": "old"}
    with whole_file(tmp_path / "a.tif", overwrite=True) as path:
        path.write_text("new")
        assert (tmp_path / "a.tif").read_text() == "old"
    assert contents(tmp_path) == {"a.tif": "new"}


def test_several_parts_move_together(tmp_path: Path) -> None:
    (tmp_path / "a.dbf").write_text("old")
    (tmp_path / "b.shp").write_text("another's")
    with whole_file(tmp_path / "a.shp") as path:
        for suffix in (".shp", ".shx", ".dbf"):
            path.with_suffix(suffix).write_text(suffix)
    assert contents(tmp_path) == {"a.shp": ".shp", "a.shx": ".shx", "a.dbf": ".dbf", "b.shp": "another's"}


def test_several_parts_vanish_together(tmp_path: Path) -> None:
    with pytest.raises(ValueError), whole_file(tmp_path / "a.shp") as path:
        for suffix in (".shp", ".shx", ".dbf"):
            path.with_suffix(suffix).write_text(suffix)
        raise ValueError
    assert names_in(tmp_path) == []


def test_a_file_that_nobody_wrote_does_not_appear(tmp_path: Path) -> None:
    with whole_file(tmp_path / "a.tif"):
        pass
    assert names_in(tmp_path) == []


def test_two_writers_of_one_file_do_not_meet(tmp_path: Path) -> None:
    with whole_file(tmp_path / "a.tif") as first, whole_file(tmp_path / "a.tif") as second:
        first.write_text("first")
        second.write_text("second")
    assert contents(tmp_path) == {"a.tif": "first"}  # whoever ends last


@pytest.mark.parametrize("act", [check_target, lambda path: whole_file(path).__enter__()])
def test_a_folder_that_is_missing_is_told(tmp_path: Path, act: object) -> None:
    with pytest.raises(OutputError, match=r"the folder .*nowhere does not exist; make it first"):
        act(tmp_path / "nowhere" / "a.tif")  # type: ignore[operator]
    assert names_in(tmp_path) == []


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_folder_is_no_target(tmp_path: Path, overwrite: bool) -> None:
    (tmp_path / "out").mkdir()
    with pytest.raises(OutputError, match="is a folder; name a file in it"):
        check_target(tmp_path / "out", overwrite)
    with pytest.raises(OutputError, match="is a folder"), whole_file(tmp_path / "out", overwrite):
        pytest.fail("it was opened")
    assert names_in(tmp_path) == ["out"]


def test_a_target_may_be_named_by_text_and_relative(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert check_target("a.tif") == Path("a.tif")
    with whole_file("a.tif") as path:
        path.write_text("here")
    assert contents(tmp_path) == {"a.tif": "here"}


def test_a_folder_that_cannot_be_written_to_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(**_: object) -> str:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("uavseg.atomic.tempfile.mkdtemp", refuse)
    with (
        pytest.raises(OutputError, match="cannot be written to: Permission denied"),
        whole_file(tmp_path / "a.tif"),
    ):
        pytest.fail("it was opened")
