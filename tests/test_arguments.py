"""Arguments are checked against annotations; a sentence names the one that is wrong."""

import os
import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from uavseg import dataclass as shared_methods
from uavseg.arguments import checked
from uavseg.errors import ParameterError


class Grid(Protocol):
    @property
    def shape(self) -> tuple[int, ...]: ...


@checked
def job(
    number: float = 1.0,
    count: int | None = None,
    name: str = "",
    place: str | os.PathLike[str] = "",
    pair: tuple[float, float] = (0, 0),
    ids: Sequence[int] = (),
    flag: bool = False,
    progress: Callable[[int, int], None] | None = None,
    array: NDArray[np.float64] | None = None,
    values: ArrayLike = 0,
    grid: Grid | None = None,
    anything: Any = None,
) -> str:
    """What is given."""
    return "done"


@pytest.mark.parametrize(
    "given",
    [
        {"number": 3},
        {"number": np.float32(3)},
        {"number": float("inf")},
        {"count": np.int64(3)},
        {"count": None},
        {"pair": [1, 2]},
        {"pair": np.array([1.0, 2.0])},
        {"ids": [1, 2, 3]},
        {"flag": np.bool_(True)},
        {"progress": print},
        {"array": np.zeros(3)},
        {"values": [[1, 2], [3, 4]]},
        {"grid": np.zeros((2, 2))},
        {"place": Path("a")},
        {"anything": object()},
    ],
)
def test_what_fits_passes(given: dict[str, Any]) -> None:
    assert job(**given) == "done"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"number": "3"}, "number is a number, not '3'"),
        ({"number": True}, "number is a number, not True"),
        ({"number": 10**400}, "number is a number, not 1000"),
        ({"number": np.zeros(3)}, "number is a number, not array"),
        ({"count": float("nan")}, "count is a whole number or None, not nan"),
        ({"count": 2.0}, "count is a whole number or None, not 2.0"),
        ({"name": b"a"}, "name is a text, not b'a'"),
        ({"name": "a\0b"}, "name is a text"),
        ({"place": 5}, "place is a text or a path, not 5"),
        ({"pair": ()}, r"pair is two numbers, not \(\)"),
        ({"pair": (1, 2, 3)}, "pair is two numbers"),
        ({"pair": "ab"}, "pair is two numbers"),
        ({"pair": (1, None)}, "pair is two numbers"),
        ({"ids": [1, "2"]}, "ids is a sequence of whole numbers"),
        ({"flag": 1}, "flag is True or False, not 1"),
        ({"progress": 5}, "progress is a function or None, not 5"),
        ({"array": [1, 2]}, "array is an array of numbers or None"),
        ({"array": np.array(["a"])}, "array is an array of numbers"),
        ({"values": [[1], [1, 2]]}, "values is an array of numbers"),
        ({"grid": 5}, "grid is a Grid or None, not 5"),
    ],
)
def test_what_does_not_fit_is_named(given: dict[str, Any], said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        job(**given)


def test_a_default_fits_even_if_its_annotation_says_otherwise() -> None:
    @checked
    def function(word: str = None) -> str:  # type: ignore[assignment]  # noqa: RUF013
        return word

    assert function(None) is None  # type: ignore[arg-type]


def test_missing_and_unknown_arguments_are_those_of_python() -> None:
    with pytest.raises(TypeError, match="unexpected keyword argument 'nothing'"):
        job(nothing=1)  # type: ignore[call-arg]


@checked
@dataclass(frozen=True, slots=True)
class Value:
    """A value of two numbers."""

    low: float
    high: float = 1.0


@checked
@shared_methods.dataclass(frozen=True, slots=True)
class Shared:
    """A value of two numbers, with the methods of all frozen dataclasses."""

    low: float
    high: float = 1.0


@pytest.mark.parametrize("cls", [Value, Shared])
def test_a_class_is_checked_when_it_is_made_and_not_when_it_is_unpickled(cls: Any) -> None:
    assert pickle.loads(pickle.dumps(cls(0.5))) == cls(0.5, 1.0) == cls(low=0.5)
    with pytest.raises(ParameterError, match="low is a number, not None"):
        cls(None)
    with pytest.raises(ParameterError, match="high is a number, not 'a'"):
        cls(0.5, high="a")
    with pytest.raises(TypeError, match="low"):
        cls()
