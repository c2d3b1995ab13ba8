"""Content hash: different for different values, equal for equal ones, and the same in every process."""

import os
import subprocess
import sys
from collections.abc import Callable
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from uavseg.execution.checkpoint import fingerprint
from uavseg.raster.grid.tiling import Window, tiles
from uavseg.raster.intensity.stretch import Stretch

ZEROS = np.zeros(4, np.uint8)
APART: list[Any] = [
    *(None, True, 1, 1.0, "1", b"1", Fraction(1), np.uint8(1), np.int8(1), np.dtype("u1")),
    *(
        (),
        [],
        (1,),
        [1],
        (1, 1),
        ((1,), 1),
        (1, (1,)),
        (("a", "b"), "c"),
        (("a",), "b", "c"),
        ("a1:b",),
        ("a", "b"),
    ),
    *(0.0, -0.0, float("nan"), float("inf")),
    *(
        ZEROS,
        ZEROS.reshape(2, 2),
        ZEROS.view(np.int8),
        ZEROS.view("u2"),
        ZEROS.view(">u4"),
        ZEROS + 1,
        ZEROS[:3],
    ),
    *(Window(1, 2, 3, 4), Window(1, 2, 4, 3), (1, 2, 3, 4), Stretch(0.0, 1.0, "a"), Stretch(0.0, 1.0, "b")),
    *(tiles, partial(tiles), partial(tiles, 1), partial(tiles, side=1), partial(tiles, other=1)),
]


def test_values_that_differ_in_anything_have_different_hashes() -> None:
    hashes = [fingerprint(value) for value in APART]
    assert len(set(hashes)) == len(APART)
    assert fingerprint(1, 2) != fingerprint(1) and fingerprint("a", "b") != fingerprint("ab")


@pytest.mark.slow
@given(st.lists(st.one_of(st.integers(), st.floats(allow_nan=False), st.text(), st.none()), max_size=4))
def test_equal_values_have_equal_hashes(values: list[Any]) -> None:
    assert fingerprint(values) == fingerprint(list(values))
    assert fingerprint(tuple(values)) != fingerprint(values)


def test_the_memory_layout_of_an_array_does_not_matter() -> None:
    array = np.arange(12).reshape(3, 4)
    assert fingerprint(array) == fingerprint(np.asfortranarray(array)) == fingerprint(array[::1].copy())
    assert fingerprint(array.T) == fingerprint(np.ascontiguousarray(array.T)) != fingerprint(array)


class Thing:
    def __init__(self, **held: Any) -> None:
        self.__dict__.update(held)


class Named:
    def __init__(self, name: str, other: int) -> None:
        self.name, self.other = name, other

    def fingerprint(self) -> str:
        return self.name


def test_objects_are_hashed_by_their_content() -> None:
    assert fingerprint(Thing(a=1, b=2)) == fingerprint(Thing(b=2, a=1)) != fingerprint(Thing(a=1, b=3))
    assert fingerprint(Named("a", 1)) == fingerprint(Named("a", 2)) != fingerprint(Named("b", 1))


def local() -> Callable[[], None]:
    def inner() -> None: ...

    return inner


@pytest.mark.parametrize(
    "value", [lambda: 0, local(), object(), np.array([object()]), partial(lambda: 0)], ids=range(5)
)
def test_values_without_content_are_refused(value: Any) -> None:
    with pytest.raises(TypeError):
        fingerprint(value)


@pytest.mark.slow
def test_every_process_finds_the_same_hash() -> None:
    program = (
        "from uavseg.execution.checkpoint import fingerprint\n"
        "from uavseg.raster.grid.tiling import Window, tiles\n"
        "print(fingerprint(tiles, (Window(1, 2, 3, 4), 'a', 0.1)))"
    )
    found = {
        subprocess.run(
            [sys.executable, "-c", program],
            capture_output=True,
            text=True,
            check=True,
            env=os.environ | {"PYTHONHASHSEED": seed},
        ).stdout.strip()
        for seed in ("1", "2")
    }
    assert found == {fingerprint(tiles, (Window(1, 2, 3, 4), "a", 0.1))}
