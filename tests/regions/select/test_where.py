"""Conditions on attributes: evaluated as three-valued logic, and never run as code."""

import operator
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from uavseg.errors import RegionError
from uavseg.regions.select.choose import where

COLUMNS = {
    "id": np.array([1, 2, 3, 4]),
    "mean": np.array([0.5, 0.7, 0.9, np.nan]),
    "area_m2": np.array([900.0, 500.0, 100.0, 50.0]),
    "source": np.array(["a.tif", "b.tif", None, "c d.tif"], dtype=object),
    "kept": np.array([True, False, True, False]),
}


def chosen(condition: str) -> list[int]:
    return (np.flatnonzero(where(COLUMNS, condition)) + 1).tolist()


@pytest.mark.parametrize(
    ("condition", "ids"),
    [
        ("mean > 0.6", [2, 3]),
        ("mean > 0.6 and area_m2 > 200", [2]),
        ("mean > 0.8 or area_m2 >= 900", [1, 3]),
        ("not mean > 0.6", [1]),
        ("not (mean > 0.6 and id > 0)", [1]),
        ("not (mean > 0.6 and id > 9)", [1, 2, 3, 4]),
        ("mean > 0.6 or id == 4", [2, 3, 4]),
        ("(mean > 0.6) == kept", [3]),
        ("0.6 < mean <= 0.7", [2]),
        ("mean == 0.5", [1]),
        ("mean != 0.5", [2, 3]),
        ("mean == mean", [1, 2, 3]),
        ("mean not in [0.5, 9]", [2, 3]),
        ("id not in [mean, 9]", [1, 2, 3]),
        ("id in [mean, 4]", [4]),
        ("mean - mean != 1", [1, 2, 3]),
        ("0 / (id - 1) < 1", [2, 3, 4]),
        ("id in [1, 4, 9]", [1, 4]),
        ("id not in (1, 4)", [2, 3]),
        ("source == 'b.tif'", [2]),
        ("source in ['a.tif', \"c d.tif\"]", [1, 4]),
        ("source == ''", [3]),
        ("source != 'b.tif'", [1, 3, 4]),
        ("area_m2 / 100 - 4 > id * -1 + 2", [1, 2]),
        ("-mean < -0.6", [2, 3]),
        ("area_m2 / 0 > 1", [1, 2, 3, 4]),
        ("kept", [1, 3]),
        ("not kept and id < 3", [2]),
        ("True", [1, 2, 3, 4]),
        ("1 > 2", []),
        ("  mean > 0.6 ", [2, 3]),
    ],
)
def test_a_condition_selects(condition: str, ids: list[int]) -> None:
    assert chosen(condition) == ids


@pytest.mark.parametrize(
    ("condition", "words"),
    [
        ("", "cannot be read"),
        ("mean >", "cannot be read"),
        ("mean = 0.5", "=="),
        ("men > 0.5", "no 'men'; they have id, mean, area_m2, source, kept"),
        ("mean", "not a condition"),
        ("mean and id", "not a condition"),
        ("mean + 1", "not a condition"),
        ("mean > 'a'", "number with a text"),
        ("source > 1", "number with a text"),
        ("-source == 1", "not a number"),
        ("source + 'x' == 'ax'", "not a number"),
        ("kept + 1 > 1", "not a number"),
        ("id in 4", "needs a list"),
        ("id in source", "needs a list"),
        ("mean > None", "not understood"),
        ("mean is 1", "not understood"),
        ("mean ** 2 > 1", "not understood"),
        ("id % 2 == 0", "not understood"),
        ("id // 2 == 0", "not understood"),
        ("mean > 1j", "not understood"),
        ("mean > 0.5; id", "cannot be read"),
        ("1" * 3000 + " < id", "characters"),
        ("id < " + "9" * 1500, "too large"),
        ("(" * 900 + "id" + ")" * 900 + " > 1", "cannot be read"),
        ("not " * 490 + "kept", "too large"),
        ("id > 1\x00", "cannot be read"),
    ],
)
def test_a_text_that_is_not_a_condition_is_refused(condition: str, words: str) -> None:
    with pytest.raises(RegionError, match=words) as refused:
        chosen(condition)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "attack",
    [
        "__import__('os').system('touch {path}')",
        "[x for x in ().__class__.__base__.__subclasses__()]",
        "mean.__class__ == 1",
        "mean.tofile('{path}')",
        "open('{path}', 'w')",
        "(lambda: 1)() == 1",
        "f'{{open(\"{path}\", \"w\")}}' == 'a'",
        "(path := '{path}') == 1",
        "eval('1') == 1",
        "id[0] == 1",
        "{{1: 2}} == 1",
        "'a' * 10 ** 9 == 'b'",
        "1 if kept else 0",
        "id @ id > 1",
        "id << 99999 > 1",
        "print == 1",
    ],
)
def test_no_code_is_run(attack: str, tmp_path: Path) -> None:
    path = tmp_path / "run"
    with pytest.raises(RegionError):
        chosen(attack.format(path=path))
    assert not path.exists()


@given(st.text(alphabet="mean id()[]<>=!+-*/.,'\"0123456789andornotin_", max_size=40))
@settings(max_examples=150)
def test_any_text_gives_an_answer_or_a_clear_error(text: str) -> None:
    try:
        assert where(COLUMNS, text).shape == (4,)
    except RegionError as error:
        assert str(error)


# Three-valued logic, against rows taken one by one with None for what is unknown

Row = dict[str, Any]
Part = tuple[str, Callable[[Row], Any]]  # a condition, or a number in it, and its value for one row
COMPARED = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}
COMPARED |= {"==": operator.eq, "!=": operator.ne}
CALCULATED = {"+": operator.add, "-": operator.sub, "*": operator.mul}


def known(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function that is None where one of its arguments is."""
    return lambda *values: None if None in values else function(*values)


def all_of(first: bool | None, second: bool | None) -> bool | None:
    if first is False or second is False:
        return False
    return None if first is None or second is None else True


def any_of(first: bool | None, second: bool | None) -> bool | None:
    if first is True or second is True:
        return True
    return None if first is None or second is None else False


opposite = known(operator.not_)


def numbers() -> st.SearchStrategy[Part]:
    names = st.sampled_from("ab").map(lambda name: (name, lambda row: row[name]))
    digits = st.integers(0, 3).map(lambda digit: (str(digit), lambda row: digit))
    return st.recursive(names | digits, calculated, max_leaves=3)


def calculated(parts: st.SearchStrategy[Part]) -> st.SearchStrategy[Part]:
    return st.tuples(parts, st.sampled_from(sorted(CALCULATED)), parts).map(
        lambda found: joined(*found, known(CALCULATED[found[1]]))
    )


def joined(first: Part, word: str, second: Part, function: Callable[[Any, Any], Any]) -> Part:
    return f"({first[0]} {word} {second[0]})", lambda row: function(first[1](row), second[1](row))


def chained(first: Part, word: str, second: Part, other: str, third: Part) -> Part:
    left = known(COMPARED[word])
    right = known(COMPARED[other])
    return (
        f"({first[0]} {word} {second[0]} {other} {third[0]})",
        lambda row: all_of(left(first[1](row), second[1](row)), right(second[1](row), third[1](row))),
    )


def listed(first: Part, choices: list[Part]) -> Part:
    def answer(row: Row) -> bool | None:
        found: bool | None = False
        for _, value in choices:
            found = any_of(found, known(operator.eq)(first[1](row), value(row)))
        return found

    return f"({first[0]} in [{', '.join(text for text, _ in choices)}])", answer


def outside(part: Part) -> Part:
    return part[0].replace(" in [", " not in [", 1), lambda row: opposite(part[1](row))


def conditions() -> st.SearchStrategy[Part]:
    word = st.sampled_from(sorted(COMPARED))
    within = st.builds(listed, numbers(), st.lists(numbers(), max_size=3))
    simple = st.one_of(
        st.tuples(numbers(), word, numbers()).map(lambda found: joined(*found, known(COMPARED[found[1]]))),
        st.builds(chained, numbers(), word, numbers(), word, numbers()),
        within,
        within.map(outside),
        st.just(("kept", lambda row: row["kept"])),
    )
    return st.recursive(simple, combined, max_leaves=5)


def combined(parts: st.SearchStrategy[Part]) -> st.SearchStrategy[Part]:
    return st.one_of(
        parts.map(lambda part: (f"(not {part[0]})", lambda row: opposite(part[1](row)))),
        st.tuples(parts, parts).map(lambda pair: joined(pair[0], "and", pair[1], all_of)),
        st.tuples(parts, parts).map(lambda pair: joined(pair[0], "or", pair[1], any_of)),
        st.tuples(parts, st.sampled_from(["==", "!="]), parts).map(
            lambda found: joined(*found, known(COMPARED[found[1]]))
        ),
    )


ROWS = [
    {"a": a, "b": b, "kept": kept} for a in (None, 0, 1, 2) for b in (None, 1, 3) for kept in (False, True)
]


@pytest.mark.slow
@given(conditions())
@settings(max_examples=300)
def test_rows_are_chosen_where_the_condition_is_true_and_not_where_it_is_unknown(part: Part) -> None:
    condition, answer = part
    columns = {
        name: np.array([np.nan if row[name] is None else row[name] for row in ROWS], float) for name in "ab"
    }
    columns["kept"] = np.array([row["kept"] for row in ROWS])
    assert where(columns, condition).tolist() == [answer(row) is True for row in ROWS]


def test_a_column_may_be_called_class_and_texts_keep_the_word() -> None:
    columns = {"class": np.array(["water", "class", "sand"], object), "class_": np.array([1, 2, 3])}
    assert where(columns, "class == 'class'").tolist() == [False, True, False]
    assert where(
        {"class": columns["class"]}, "class in ['water', 'sand'] and not class == \"sand\""
    ).tolist() == [
        True,
        False,
        False,
    ]
    with pytest.raises(RegionError, match="these regions have no 'class'; they have mean"):
        where({"mean": np.array([0.5])}, "class == 'water'")
