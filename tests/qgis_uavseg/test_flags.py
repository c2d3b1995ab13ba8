"""Flags in messages: replaced by the fields of a dialog, whatever stands around them."""

import json
import re
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from qgis_uavseg import flags
from qgis_uavseg.flags import field_name, in_dialog

TABLE = json.loads(Path(flags.__file__).with_name("options.json").read_text(encoding="utf-8"))
FIELDS = {
    command: {one["flag"]: field_name(one["label"]) for one in options.values()}
    for command, options in TABLE.items()
}
PLAN = FIELDS["plan"]
BEFORE = st.sampled_from(["", "give ", "(", "one of ", "expected: ", "“", "or\t"])
AFTER = st.sampled_from(["", " 10px", ", not both", ")", ".", "; a smaller one", " LAT,LON", "'s value", ":"])
ABSENT = "--max-items"


@pytest.mark.parametrize("command", TABLE)
def test_every_flag_of_a_dialog_becomes_its_label(command: str) -> None:
    for one in TABLE[command].values():
        flag, name = one["flag"], field_name(one["label"])
        assert (
            in_dialog(f"{flag} is 3; leave {flag} out", FIELDS[command]) == f"{name} is 3; leave {name} out"
        )
        assert in_dialog(f"leave {flag} out", {}).startswith(f"leave {flag} out (")


@given(st.sampled_from(sorted(PLAN)), BEFORE, AFTER)
def test_what_stands_around_a_flag_stays(flag: str, before: str, after: str) -> None:
    assert in_dialog(before + flag + after, PLAN) == before + PLAN[flag] + after


@given(st.sampled_from(sorted(PLAN)), st.sampled_from("'\"`"), BEFORE, AFTER)
def test_quotes_around_a_flag_alone_become_those_of_the_field(
    flag: str, quote: str, before: str, after: str
) -> None:
    assert in_dialog(f"{before}{quote}{flag}{quote}{after}", PLAN) == before + PLAN[flag] + after
    assert in_dialog(f"{quote}{flag} 3{quote}", PLAN) == f"{quote}{PLAN[flag]} 3{quote}"


@given(st.sampled_from(sorted(PLAN)), st.sampled_from(["10px", "0.5,1", "'a b'", "-3"]))
def test_a_value_stays_behind_the_field(flag: str, value: str) -> None:
    assert in_dialog(f"{flag}={value}", PLAN) == in_dialog(f"{flag} {value}", PLAN) == f"{PLAN[flag]} {value}"


@given(st.sampled_from(sorted(PLAN)), st.sampled_from(sorted(PLAN)))
def test_the_longest_flag_counts(flag: str, other: str) -> None:
    """A flag that another begins with, --avoid and --avoid-margin, is not found in it."""
    longer = flag + other[1:]
    both = {flag: "“short”", longer: "“long”"}
    assert in_dialog(f"{longer} {flag}", both) == "“long” “short”"
    assert in_dialog(longer, {flag: "“short”"}) == f"{longer}{_remark(longer)}"


@given(st.sampled_from(sorted(PLAN)))
def test_a_switch_that_is_negated_is_off(flag: str) -> None:
    negative = f"--no-{flag[2:]}"
    assert in_dialog(f"give {negative}.", PLAN) == f"give {PLAN[flag]} off."
    assert in_dialog(negative, {**PLAN, negative: "“Not”"}) == "“Not”"


@given(st.text(), st.sampled_from(sorted(PLAN)))
def test_texts_without_flags_stay_and_twice_is_as_once(text: str, flag: str) -> None:
    plain = re.sub(r"(?<=-)-|-(?=[A-Za-z])", "", text)
    assert in_dialog(plain, PLAN) == plain
    once = in_dialog(f"{text} {ABSENT} {flag} {text}", PLAN)
    assert in_dialog(once, PLAN) == once


def test_a_flag_without_a_field_stays_and_is_said_to_be_of_the_command_line() -> None:
    text = "give --endurance, --tile or --max-items; --tile 64 is smaller"
    expected = f"give {PLAN['--endurance']}, --tile or --max-items; --tile 64 is smaller"
    assert in_dialog(text, PLAN) == expected + (
        " (--tile and --max-items are options of the command line, not of this dialog)"
    )
    assert in_dialog(ABSENT, PLAN) == ABSENT + _remark(ABSENT)


@pytest.mark.parametrize(
    "text",
    [
        "make it again with uavseg divide --flatten, or leave it",
        "(uavseg match --by=texture --bands)",
        "/data/--altitude.tif, --altitude.tif and C:\\--altitude cannot be read",
        "x--altitude, ---altitude, --, - and -3",
        "give the scale to the file (gdal_edit.py -scale, -a_srs)",
    ],
)
def test_commands_to_type_names_of_files_and_other_programs_stay(text: str) -> None:
    fields = {**PLAN, "--flatten": "“F”", "--by": "“B”", "--bands": "“B”"}
    assert in_dialog(text, fields) == text


def test_short_flags_beside_the_long_one_are_one_field() -> None:
    fields = dict.fromkeys(("-b", "--band", "--bidx"), "“Band”")
    assert in_dialog("Invalid value for '-b' / '--band' / '--bidx': 'x'", fields) == (
        "Invalid value for “Band”: 'x'"
    )
    assert in_dialog("name -b 1 (-v shows all)", fields) == "name “Band” 1 (-v shows all)"


def test_what_is_for_python_is_left_out() -> None:
    fields = FIELDS["extract"]
    assert in_dialog('--collar keep (collar="keep") keeps it', fields) == "“Collar” keep keeps it"
    assert in_dialog("give --nodata only:0 (nodata='only:0')", fields) == "give “Nodata value” only:0"
    kept = "give --overwrite (overwrite=True) to replace it"
    assert in_dialog(kept, fields) == kept + _remark("--overwrite")


@pytest.mark.parametrize("command", TABLE)
def test_labels_are_told_apart_without_their_units(command: str) -> None:
    names = [name for _, name in sorted(FIELDS[command].items())]
    assert len({*names}) == len(names)


def _remark(flag: str) -> str:
    return f" ({flag} is an option of the command line, not of this dialog)"
