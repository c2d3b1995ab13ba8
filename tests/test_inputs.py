"""Inputs are regular files, read within bounds."""

import os
import socket
from contextlib import chdir
from pathlib import Path

import pytest

from uavseg.errors import MissionError, RasterReadError
from uavseg.inputs import MAX_DEPTH, check_yaml_brackets, parse_json, parse_yaml, read_bytes, regular_file


def test_a_regular_file_is_an_input_and_so_is_a_link_to_one(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"content")
    (tmp_path / "link").symlink_to("a")
    for name in ("a", "link"):
        assert regular_file(tmp_path / name) == tmp_path / name
        assert read_bytes(tmp_path / name) == b"content"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on this system")
def test_what_is_no_regular_file_is_refused_without_opening_it(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    with socket.socket(socket.AF_UNIX) as listening, chdir(tmp_path):
        listening.bind("socket")  # the whole path may be too long for one
        classes = {"pipe": "named pipe", "folder": "folder", "socket": "socket"}
        for name, kind in classes.items():
            for reading in (regular_file, read_bytes):
                with pytest.raises(RasterReadError, match=f"is a {kind}; name a regular file"):
                    reading(tmp_path / name)
    with pytest.raises(RasterReadError, match="is a device"):
        read_bytes("/dev/zero")


def test_missing_files_and_impossible_names_are_errors_of_the_kind_asked_for(tmp_path: Path) -> None:
    with pytest.raises(MissionError, match="there is no file"):
        read_bytes(tmp_path / "none", MissionError)
    for name in ("a\0b", "x" * 5000):
        with pytest.raises(MissionError, match="cannot be read"):
            read_bytes(name, MissionError)


def test_a_file_beyond_the_limit_is_not_read_whole(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(bytes(10))
    assert len(read_bytes(tmp_path / "a", limit=10)) == 10
    with pytest.raises(RasterReadError, match="more than 9 bytes"):
        read_bytes(tmp_path / "a", limit=9)


def test_json_is_parsed_within_bounds() -> None:
    assert parse_json('{"a": [1, 2.5, "[[[{{"], "b": {"c": null}}') == {
        "a": [1, 2.5, "[[[{{"],
        "b": {"c": None},
    }
    deep = MAX_DEPTH * "[" + MAX_DEPTH * "]"
    assert parse_json(deep) is not None
    quoted = '["' + 500 * '[\\"' + '"]'
    assert len(parse_json(quoted)[0]) == 1000
    for text, reason in ((f"[{deep}]", "nested"), ("9" * 5000, "5000 digits"), ("0." + "9" * 5000, "digits")):
        with pytest.raises(ValueError, match=reason):
            parse_json(text)


def test_yaml_that_is_nested_too_deeply_is_refused_before_it_is_scanned() -> None:
    check_yaml_brackets(b"[{a: [1, {}]}]" * 1000)
    check_yaml_brackets(b"[" * MAX_DEPTH)
    with pytest.raises(ValueError, match="nested more than 64 deep"):
        check_yaml_brackets(b"x: " + b"[{" * MAX_DEPTH)


def test_yaml_is_plain_values_or_one_line_that_says_why_not() -> None:
    read = parse_yaml(b"a: [1, x, {b: null}]", MissionError, "aliases", "no YAML")
    assert read == {"a": [1, "x", {"b": None}]}
    with pytest.raises(MissionError, match=r"^it has aliases$"):
        parse_yaml(b"a: &x [1]\nb: *x", MissionError, "it has aliases", "no YAML")
    for content in (b"a: [", b"a: !!bool maybe", b"a: !!int x", b"{[1]: 2}", b"\xff", b"[" * (MAX_DEPTH + 1)):
        with pytest.raises(MissionError, match=r"^no YAML \(.+\)$"):
            parse_yaml(content, MissionError, "aliases", "no YAML")
