from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uavseg.errors import RegionError
from uavseg.regions.select.where import where

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
        ("not mean > 0.6", [1, 4]),
        ("0.6 < mean <= 0.7", [2]),
        ("mean == 0.5", [1]),
        ("mean != 0.5", [2, 3, 4]),
        ("id in [1, 4, 9]", [1, 4]),
        ("id not in (1, 4)", [2, 3]),
        ("source == 'b.tif'", [2]),
        ("source in ['a.tif', \"c d.tif\"]", [1, 4]),
        ("source == ''", [3]),
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
def test_a_condition_chooses(condition: str, ids: list[int]) -> None:
    assert chosen(condition) == ids


@pytest.mark.parametrize(
    ("condition", "words"),
    [
        ("", "cannot be read"),
        ("mean >", "cannot be read"),
        ("mean = 0.5", "=="),
        ("men > 0.5", "no 'men'; they have id, mean, area_m2, source, kept"),
        ("mean", "no condition"),
        ("mean and id", "no condition"),
        ("mean + 1", "no condition"),
        ("mean > 'a'", "number with a text"),
        ("source > 1", "number with a text"),
        ("-source == 1", "no number"),
        ("source + 'x' == 'ax'", "no number"),
        ("kept + 1 > 1", "no number"),
        ("id in 4", "comes a list"),
        ("id in source", "comes a list"),
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
def test_what_is_no_condition_is_refused(condition: str, words: str) -> None:
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
def test_nothing_is_run(attack: str, tmp_path: Path) -> None:
    path = tmp_path / "run"
    with pytest.raises(RegionError):
        chosen(attack.format(path=path))
    assert not path.exists()


@given(st.text(alphabet="mean id()[]<>=!+-*/.,'\"0123456789andornotin_", max_size=40))
@settings(max_examples=150, deadline=None)
def test_any_text_gives_an_answer_or_a_clear_error(text: str) -> None:
    try:
        assert where(COLUMNS, text).shape == (4,)
    except RegionError as error:
        assert str(error)
