"""Results as bytes and back: arrays, numbers, texts, tuples, and dataclasses of the project made of them.

The bytes are those of an .npz file: one .npy for each array, and `tree.json`, which says how they belong
together. Reading runs no code that lies in the file: nothing is pickled, and a dataclass is made only if it
is one of the project's own.
"""

import io
import json
import struct
import sys
import zipfile
import zlib
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

_TREE = "tree.json"
_EFFORT = 1  # of deflate: histograms of 65536 bins shrink to little with the least
_WHAT_DAMAGE_RAISES = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    EOFError,
    AttributeError,
    LookupError,
    MemoryError,
    NotImplementedError,
    OverflowError,
    RuntimeError,
    SyntaxError,
    TypeError,
    ValueError,
)


class DamagedResultError(ValueError):
    """Bytes are not those of the result that they should be."""


def encode_result(value: Any, key: str) -> bytes:
    """A result as bytes; the same result gives the same bytes.

    Parameters
    ----------
    value : None, bool, int, float, str, array, tuple, list or dataclass of these
        A dataclass is one of the project's.
    key : str
        What the result is of.

    Raises
    ------
    TypeError
        If there is something else in it.
    """
    arrays: list[NDArray[Any]] = []
    tree = {"key": key, "value": _tree(value, arrays)}
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        _add(archive, _TREE, json.dumps(tree).encode())
        for k, array in enumerate(arrays):
            npy = io.BytesIO()
            np.lib.format.write_array(npy, array, allow_pickle=False)
            _add(archive, f"{k}.npy", npy.getvalue())
    return stream.getvalue()


def decode_result(data: bytes, key: str) -> Any:
    """The result that `dump` made bytes of.

    Raises
    ------
    DamagedResultError
        If the bytes are damaged, of another key, or not from `dump` at all.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            tree = json.loads(archive.read(_TREE))
            if tree["key"] != key:
                raise DamagedResultError(f"a result of {tree['key']}, not of {key}")
            return _value(tree["value"], archive)
    except _WHAT_DAMAGE_RAISES as error:
        raise DamagedResultError(f"not a whole result ({error})") from error


def _add(archive: zipfile.ZipFile, name: str, data: bytes) -> None:
    archive.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED, _EFFORT)


def _tree(value: Any, arrays: list[NDArray[Any]]) -> Any:
    """A value with its arrays taken out: plain values stay, everything else is {kind: what it holds}."""
    if value is None or type(value) in (bool, int, float, str):
        return value
    if isinstance(value, np.ndarray | np.generic):
        arrays.append(np.asarray(value))
        return {"array" if isinstance(value, np.ndarray) else "scalar": len(arrays) - 1}
    if type(value) in (tuple, list):
        return {type(value).__name__: [_tree(part, arrays) for part in value]}
    if is_dataclass(value) and not isinstance(value, type):
        kind = type(value)
        held = {field.name: _tree(getattr(value, field.name), arrays) for field in fields(value)}
        return {"record": [kind.__module__, kind.__qualname__, held]}
    raise TypeError(f"a result that holds a {type(value).__qualname__} cannot be kept")


def _value(tree: Any, archive: zipfile.ZipFile) -> Any:
    if not isinstance(tree, dict):
        return tree
    [(kind, held)] = tree.items()
    if kind in ("array", "scalar"):
        npy = io.BytesIO(archive.read(f"{int(held)}.npy"))  # read whole, which checks its sum
        array = np.lib.format.read_array(npy, allow_pickle=False)
        return array if kind == "array" else array[()]
    if kind in ("tuple", "list"):
        parts = [_value(part, archive) for part in held]
        return tuple(parts) if kind == "tuple" else parts
    if kind != "record":
        raise ValueError(f"a {kind} is nothing that is kept")
    module, name, parts_by_name = held
    values = {field: _value(part, archive) for field, part in parts_by_name.items()}
    return _record(module, name)(**values)


def _record(module: str, name: str) -> Any:
    """A dataclass of the project; its module is loaded already, since the function that makes it is there."""
    kind = getattr(sys.modules[module], name) if module.startswith("uavseg.") else None
    if not (isinstance(kind, type) and is_dataclass(kind)):
        raise ValueError(f"{module}.{name} is no dataclass of the project")
    return kind
