"""Messages are one printable line of bounded length."""

import pickle
import struct
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from uavseg.errors import RasterReadError, UavsegError
from uavseg.plain_text import MAX_MESSAGE, cause_of, first_of, one_line, shown


@given(st.text(max_size=2000))
def test_any_text_is_one_printable_line_that_is_not_long(text: str) -> None:
    line = one_line(text)
    assert line.isprintable() and len(line) <= MAX_MESSAGE


@given(st.text(st.characters(codec="ascii", categories=["L", "N"]), max_size=100))
def test_plain_text_stays_as_it_is(text: str) -> None:
    assert one_line(text) == text


def test_the_end_of_a_long_message_is_kept() -> None:
    assert one_line("word " * 500 + "do this instead").endswith("do this instead")


@pytest.mark.parametrize("kind", [UavsegError, RasterReadError])
def test_an_error_says_names_escaped_here_and_in_another_process(kind: type[UavsegError]) -> None:
    error = kind("red\x1b[31m\n\udcff\u202e.tif")
    assert str(error) == str(pickle.loads(pickle.dumps(error))) == r"red\x1b[31m\n\udcff\u202e.tif"


@pytest.mark.parametrize(
    ("provoke", "said"),
    [
        (lambda: int("NaN"), "expected a whole number, got 'NaN'"),
        (lambda: float("x"), "expected a number, got 'x'"),
        (lambda: int(float("inf")), "a number in it is too large"),
        (lambda: int("9" * 5000), "a number in it is too large"),
        (lambda: b"\xff".decode(), "a text or a name in it is not UTF-8"),
        (lambda: {}["items"], "'items' is missing"),
        (lambda: None + 1, "a value in it is of a wrong kind"),
        (lambda: struct.unpack("<H", b""), "a record in it is cut short"),
        (lambda: Path("/nowhere/x").read_text(), "No such file or directory"),
    ],
)
def test_errors_of_python_are_said_in_words(provoke: object, said: str) -> None:
    with pytest.raises(Exception) as caught:
        provoke()  # type: ignore[operator]
    assert cause_of(caught.value) == said


def test_of_a_library_the_first_sentence_of_the_first_cause_is_said() -> None:
    first = ValueError("The block\nis 3.5 MB. Give more memory. Or less.")
    with pytest.raises(RuntimeError) as caught:
        raise RuntimeError("second") from first
    assert cause_of(caught.value) == "The block is 3.5 MB"


@pytest.mark.parametrize(
    ("message", "said"),
    [
        ("VSIFReadL(0x5603fea45790,6*4) @ 4211 failed in HFAEntry().", "the file ends too early"),
        ("Read of 1637 bytes at 0:0000320b on 0x561681954490 failed.", "the file ends too early"),
        ("opening 0x561681954490 failed", "opening ... failed"),
    ],
)
def test_addresses_of_the_memory_are_not_said(message: str, said: str) -> None:
    assert cause_of(ValueError(message)) == said


def test_a_wrong_value_is_shown_whatever_it_is() -> None:
    class Silent:
        def __repr__(self) -> str:
            raise RuntimeError

    assert shown(Silent()) == "a value of type Silent"
    assert shown(10**5000) == "a value of type int"
    assert len(shown("a" * 10_000)) <= 60


def test_first_texts_and_how_many_more() -> None:
    assert first_of([1, 2, 3], 3) == "1, 2, 3" and first_of([], 2) == ""
    assert first_of(["a", "b", "c", "d"], 2, " letters") == "a, b and 2 more letters"
