"""Bags of strangers: damaged, hostile, not bags, or read without rosbags; each is one line."""

import bz2
import random
import shutil
import sqlite3
import sys
from pathlib import Path
from typing import Any

import pytest
from rosbags.rosbag2 import CompressionFormat, CompressionMode

from tests.occupancy.bags.write_bags import Drive, write_ros1, write_ros2
from uavseg.errors import AccessError, BagError, UavsegError
from uavseg.occupancy.bags import bag
from uavseg.occupancy.bags.merge_bag import merge_bag


def content(ros: int, count: int = 3) -> list[Any]:
    drive = Drive(ros, count)
    return drive.recorded_scans() + drive.recorded_odometry() + drive.recorded_static()


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bag of each kind."""
    folder = tmp_path_factory.mktemp("bags")
    write_ros1(folder / "a.bag", content(1), "LZ4")
    write_ros2(folder / "db3", content(2))
    zstd = (CompressionMode.STORAGE, CompressionFormat.ZSTD)
    write_ros2(folder / "mcap", content(2), "MCAP", zstd)
    return folder


FILES = ("a.bag", "db3/db3.db3", "mcap/mcap.mcap")


def refused(path: Path) -> str:
    with pytest.raises(UavsegError) as raised:
        merge_bag(path)
    text = str(raised.value)
    assert text.isprintable() and len(text) < 600
    return text


@pytest.mark.parametrize("name", FILES)
def test_every_cut_is_one_line(name: str, bags: Path, tmp_path: Path) -> None:
    whole = (bags / name).read_bytes()
    cut = tmp_path / f"cut{Path(name).suffix}"
    for length in sorted({0, 1, 40, len(whole) - 1, *range(0, len(whole), len(whole) // 30)}):
        cut.write_bytes(whole[:length])
        try:
            merge_bag(cut)  # a database may be whole without its last bytes
        except BagError as error:
            assert "cut." in str(error) and str(error).isprintable()


@pytest.mark.parametrize("name", FILES)
def test_changed_bytes_give_a_map_or_one_line(name: str, bags: Path, tmp_path: Path) -> None:
    whole = bytearray((bags / name).read_bytes())
    changed = tmp_path / f"changed{Path(name).suffix}"
    failed = 0
    for seed in range(60):
        rng = random.Random(seed)
        found = bytearray(whole)
        for _ in range(rng.choice((1, 4, 30))):
            at = rng.randrange(len(found))
            found[at : at + rng.choice((1, 4, 8))] = rng.randbytes(rng.choice((1, 4, 8)))
        changed.write_bytes(found)
        try:
            merge_bag(changed)
        except BagError:
            failed += 1
    assert failed > 5


def test_the_definitions_of_a_bag_are_not_made_code(bags: Path, tmp_path: Path) -> None:
    whole = (bags / "db3/db3.db3").read_bytes()
    assert b"float32 angle_min" in whole
    hostile = tmp_path / "a.db3"
    hostile.write_bytes(whole.replace(b"float32 angle_min", b"float32 angle-mi}"))
    assert merge_bag(hostile).scans.merged == 3


def test_a_bag_whose_messages_are_a_view_that_never_ends_is_refused(bags: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.db3"
    path.write_bytes((bags / "db3/db3.db3").read_bytes())
    with sqlite3.connect(path) as database:
        database.execute("ALTER TABLE messages RENAME TO held")
        database.execute(
            "CREATE VIEW messages AS WITH RECURSIVE n(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM n) "
            "SELECT held.* FROM held, n"
        )
    database.close()
    with pytest.raises(AccessError, match="has the view 'messages'"):
        merge_bag(path)


def test_a_type_that_only_has_the_name_of_a_scan_is_refused(bags: Path, tmp_path: Path) -> None:
    write_ros1(tmp_path / "b.bag", content(1))
    whole = (tmp_path / "b.bag").read_bytes()
    other = tmp_path / "a.bag"
    other.write_bytes(whole.replace(b"90c7ef2dc6895d81024acba2ac42f369", b"0" * 32))
    assert "/scan of" in refused(other) and "another sensor_msgs/msg/LaserScan than that of ROS" in refused(
        other
    )


# What is not a bag


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("none.bag", "there is no file"),
        ("a.txt", "is not a bag: expected a .bag of ROS 1"),
        ("empty", "it has no metadata.yaml"),
        ("a?b.db3", "which SQLite does not open safely"),
    ],
)
def test_what_is_not_a_bag_is_said(name: str, text: str, tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("scan")
    (tmp_path / "empty").mkdir()
    (tmp_path / "a?b.db3").write_bytes(b"SQLite format 3\0")
    assert text in refused(tmp_path / name)


@pytest.mark.parametrize(
    ("metadata", "text"),
    [
        ("a: [", "is not the metadata of a bag"),
        ("a: &x [1]\nb: *x\n", "holds YAML aliases"),
        ("[1, 2]", "is not the metadata of a bag"),
        ("rosbag2_bagfile_information: 5", "is not the metadata of a bag"),
        ("rosbag2_bagfile_information: {relative_file_paths: []}", "names no files"),
        ("rosbag2_bagfile_information: {relative_file_paths: [db3.db3, 5]}", "names no files"),
        ("rosbag2_bagfile_information: {relative_file_paths: [gone.db3]}", "gone.db3"),
        ("rosbag2_bagfile_information: {relative_file_paths: [metadata.yaml]}", "is not a bag"),
        ("rosbag2_bagfile_information: {relative_file_paths: [..]}", "outside of its folder"),
        ("x" * (bag.MAX_METADATA + 1), "too much for a file of its kind"),
        ("[" * 1_000_000, "nested more than 64 deep"),
        (
            "rosbag2_bagfile_information: {relative_file_paths: [db3.db3], compression_mode: FILE}",
            "is compressed by 'file'; ros2 bag convert",
        ),
    ],
)
def test_metadata_is_checked(metadata: str, text: str, bags: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(bags / "db3", tmp_path / "db3")
    (folder / "metadata.yaml").write_text(metadata)
    assert text in refused(folder)


def test_files_outside_of_the_folder_are_not_opened(bags: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(bags / "db3", tmp_path / "db3")
    (folder / "db3.db3").unlink()
    (folder / "db3.db3").symlink_to(bags / "db3" / "db3.db3")
    assert "lies outside of its folder" in refused(folder)


def test_names_in_metadata_lose_their_folders(bags: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(bags / "db3", tmp_path / "db3")
    text = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").write_text(text.replace("db3.db3", "/somewhere/else/db3.db3"))
    assert merge_bag(folder).scans.merged == 3


def test_a_database_that_was_not_closed_is_refused(bags: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(bags / "db3", tmp_path / "db3")
    (folder / "db3.db3-wal").write_bytes(b"messages")
    assert "db3.db3-wal holds messages" in refused(folder)


def test_a_folder_with_several_files_is_read_in_their_order(bags: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(bags / "db3", tmp_path / "db3")
    drive = Drive(2, 6)
    later = [
        one for one in drive.recorded_scans() + drive.recorded_odometry() if one.time > drive.scan_times()[2]
    ]
    shutil.copy(write_ros2(tmp_path / "more", later) / "more.db3", folder)
    text = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").write_text(text.replace("- db3.db3", "- db3.db3\n  - more.db3"))
    assert merge_bag(folder).scans.merged == 6


# Bounds


@pytest.mark.parametrize("name", ["a.bag", "mcap/mcap.mcap"])
def test_chunks_are_unpacked_within_bounds(name: str, bags: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bag, "MAX_CHUNK", 1000)
    assert "a chunk is cut off, or has more than" in refused(bags / name)


@pytest.mark.slow
def test_a_bomb_in_a_chunk_is_not_unpacked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bag, "MAX_CHUNK", 1 << 20)
    unpack = bag._bounded(bz2.BZ2Decompressor)
    assert unpack(bz2.compress(bytes(1000))) == bytes(1000)
    with pytest.raises(ValueError, match="more than 1 MB"):
        unpack(bz2.compress(bytes(1 << 26)))


def test_chunks_of_one_time_are_bounded(bags: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bag, "MAX_TOGETHER", 1000)
    assert "that overlap in time" in refused(bags / "mcap")


@pytest.mark.parametrize("name", ["a.bag", "db3", "mcap"])
def test_messages_are_bounded(name: str, bags: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bag, "MAX_MESSAGE", 300)
    refused(bags / name)


def test_the_tables_of_rosbags_are_as_before(bags: Path) -> None:
    from rosbags.rosbag1 import reader
    from rosbags.rosbag2 import storage_mcap

    before = dict(reader.decompressors), dict(storage_mcap.DECOMPRESSORS)
    merge_bag(bags / "mcap")
    assert (reader.decompressors, storage_mcap.DECOMPRESSORS) == before


def test_an_index_that_is_used_many_times_is_refused(tmp_path: Path) -> None:
    path = write_ros1(tmp_path / "a.bag", content(1))
    whole = path.read_bytes()
    at = whole.index(b"index_pos=") + len(b"index_pos=")
    index = int.from_bytes(whole[at : at + 8], "little")
    infos = whole.index(b"chunk_pos=", index)
    header = whole.rindex((6).to_bytes(1, "little"), index, infos)  # op=6
    start = whole.rindex(b"op=", index, header + 1) - 8
    record = whole[start:]
    count = whole.index(b"chunk_count=") + len(b"chunk_count=")
    many = 3000
    damaged = bytearray(whole + record * (many - 1))
    damaged[count : count + 4] = many.to_bytes(4, "little")
    path.write_bytes(damaged)
    assert "its index is larger than the file" in refused(path)


def test_without_rosbags_the_extra_is_named(bags: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rosbags.rosbag1", None)
    assert refused(bags / "a.bag") == 'reading bags needs rosbags; pip install "uavseg[ros]"'
