"""Serialised results: the round trip is exact; damaged or foreign bytes are refused, and run nothing."""

import io
import json
import pickle
import zipfile
from dataclasses import dataclass, fields, is_dataclass
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra import numpy as arrays

from uavseg.execution.checkpoint import DamagedResultError, decode_result, encode_result
from uavseg.raster.grid.tiling import Window
from uavseg.regions.outline.chains import Chains
from uavseg.segmentation.components import Sums

KINDS = ["u1", "b1", "<u4", ">i2", "<i8", "<f4", "<f8"]
plain = st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text())
array = arrays.arrays(st.sampled_from(KINDS), arrays.array_shapes(min_dims=0, max_dims=3, min_side=0))
results = st.recursive(
    plain | array | st.builds(Window, *[st.integers()] * 4) | st.builds(Chains, array, array, array),
    lambda part: st.lists(part, max_size=3) | st.lists(part, max_size=3).map(tuple),
    max_leaves=6,
)


def assert_same(one: Any, other: Any) -> None:
    assert type(one) is type(other)
    if isinstance(one, np.ndarray):
        assert one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()
        assert other.flags.writeable
    elif is_dataclass(one):
        for field in fields(one):
            assert_same(getattr(one, field.name), getattr(other, field.name))
    elif isinstance(one, tuple | list):
        for mine, theirs in zip(one, other, strict=True):
            assert_same(mine, theirs)
    else:
        assert repr(one) == repr(other)


@pytest.mark.slow
@settings(max_examples=60)
@given(results)
def test_decoding_returns_what_was_encoded(result: Any) -> None:
    assert_same(result, decode_result(encode_result(result, "key"), "key"))


def test_a_numpy_scalar_stays_one() -> None:
    assert_same(np.float32(0.1), decode_result(encode_result(np.float32(0.1), "key"), "key"))


def a_result() -> Any:
    sums = Sums(np.arange(3), np.arange(3, dtype=np.uint64), np.ones(3, np.uint64), np.zeros((3, 2), int))
    return sums, (Window(1, 2, 3, 4), None), "text"


def test_the_same_result_gives_the_same_bytes_and_numpy_reads_them(tmp_path: Path) -> None:
    data = encode_result(a_result(), "key")
    assert data == encode_result(a_result(), "key")
    (tmp_path / "a.npz").write_bytes(data)
    with np.load(tmp_path / "a.npz", allow_pickle=False) as file:
        assert file["0"].tolist() == [0, 1, 2]


@given(st.data())
def test_damage_is_detected(data: Any) -> None:
    whole = encode_result(a_result(), "key")
    if data.draw(st.booleans()):
        damaged = whole[: data.draw(st.integers(0, len(whole) - 1))]
    else:
        position = data.draw(st.integers(0, len(whole) - 1))
        damaged = (
            whole[:position]
            + bytes([whole[position] ^ data.draw(st.integers(1, 255))])
            + whole[position + 1 :]
        )
    try:
        found = decode_result(damaged, "key")
    except DamagedResultError:
        return
    assert_same(a_result(), found)  # a byte without influence on the result, such as a date


def test_a_result_of_another_key_is_refused() -> None:
    with pytest.raises(DamagedResultError, match="of other, not of key"):
        decode_result(encode_result(1, "other"), "key")


class Trap:
    """Unpickling it would run a function."""

    def __reduce__(self) -> Any:
        return pytest.fail, ("code of the file ran",)


def archive(tree: Any, npy: bytes = b"") -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as file:
        file.writestr("tree.json", json.dumps({"key": "key", "value": tree}))
        file.writestr("0.npy", npy)
    return stream.getvalue()


def pickled() -> bytes:
    stream = io.BytesIO()
    np.save(stream, np.array([Trap()], object), allow_pickle=True)
    return stream.getvalue()


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"no zip",
        pickle.dumps(1),
        archive({"array": 0}, pickled()),
        archive({"array": 1}),
        archive({"array": 0}, b"\x93NUMPY\x01\x00\x10\x00{'descr': 'u1'}  "),
        archive({"array": "../0"}),
        archive({"record": ["os", "system", {"command": "true"}]}),
        archive({"record": ["subprocess", "CompletedProcess", {"args": "a", "returncode": 0}]}),
        archive({"record": ["uavseg.errors", "UavsegError", {}]}),
        archive({"record": ["uavseg.raster.grid.tiling", "tiles", {"shape": [1, 1], "side": 64}]}),
        archive({"record": ["uavseg.raster.grid.tiling", "Window", {"row": 1}]}),
        archive({"record": ["uavseg.nothing", "Window", {}]}),
        archive({"set": [1]}),
        archive({}),
    ],
    ids=map(str, count()),  # the archives hold the time: they would have another name in each worker
)
def test_foreign_bytes_are_refused_and_run_nothing(data: bytes) -> None:
    with pytest.raises(DamagedResultError):
        decode_result(data, "key")


@dataclass
class Foreign:
    value: Any


@pytest.mark.parametrize("value", [{1}, {"a": 1}, b"a", object(), np.array([object()]), 1j])
def test_values_that_cannot_be_saved_are_refused_at_once(value: Any) -> None:
    with pytest.raises((TypeError, ValueError)):
        encode_result((1, value), "key")
    with pytest.raises((TypeError, ValueError)):
        encode_result(Foreign(value), "key")
