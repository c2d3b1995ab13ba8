"""Serialisation of results: arrays, numbers, strings, tuples, lists and dataclasses of the project.

The format is that of an .npz file: one .npy for each array, and `tree.json` for the structure around them.
Decoding runs no code from the file: nothing is pickled, and only dataclasses of the project are created.
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
_COMPRESSION_LEVEL = 1  # of deflate: enough to shrink histograms of 65536 bins
# What decoding of damaged bytes raises.
_DAMAGE_ERRORS = (
    *(zipfile.BadZipFile, zlib.error, struct.error, EOFError, AttributeError, LookupError, MemoryError),
    *(NotImplementedError, OverflowError, RuntimeError, SyntaxError, TypeError, ValueError),
)


class DamagedResultError(ValueError):
    """Bytes that are damaged, or those of another result."""


def encode_result(value: Any, key: str) -> bytes:
    """Serialise a result; equal results give equal bytes.

    Parameters
    ----------
    value : None, bool, int, float, str, array, tuple, list or dataclass of these
        Dataclasses must be of the project.
    key : str
        Identifies the item that the result belongs to.

    Raises
    ------
    TypeError
        If it holds a value of another type.
    """
    arrays: list[NDArray[Any]] = []
    tree = {"key": key, "value": _to_tree(value, arrays)}
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        _add(archive, _TREE, json.dumps(tree).encode())
        for k, array in enumerate(arrays):
            npy = io.BytesIO()
            np.lib.format.write_array(npy, array, allow_pickle=False)
            _add(archive, f"{k}.npy", npy.getvalue())
    return stream.getvalue()


def decode_result(data: bytes, key: str) -> Any:
    """Read a result that `encode_result` serialised.

    Parameters
    ----------
    data : bytes
    key : str
        Of its item.

    Raises
    ------
    DamagedResultError
        If the bytes are damaged, of another key, or not from `encode_result` at all.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            tree = json.loads(archive.read(_TREE))
            if tree["key"] != key:
                raise DamagedResultError(f"a result of {tree['key']}, not of {key}")
            return _from_tree(tree["value"], archive)
    except _DAMAGE_ERRORS as error:
        raise DamagedResultError(f"not a complete result ({error})") from error


def _add(archive: zipfile.ZipFile, name: str, data: bytes) -> None:
    archive.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED, _COMPRESSION_LEVEL)


def _to_tree(value: Any, arrays: list[NDArray[Any]]) -> Any:
    """Convert a value to JSON with its arrays taken out: plain values stay, others become {type: content}."""
    if value is None or type(value) in (bool, int, float, str):
        return value
    if isinstance(value, np.ndarray | np.generic):
        arrays.append(np.asarray(value))
        return {"array" if isinstance(value, np.ndarray) else "scalar": len(arrays) - 1}
    if type(value) in (tuple, list):
        return {type(value).__name__: [_to_tree(part, arrays) for part in value]}
    if is_dataclass(value) and not isinstance(value, type):
        parts = {field.name: _to_tree(getattr(value, field.name), arrays) for field in fields(value)}
        return {"record": [type(value).__module__, type(value).__qualname__, parts]}
    raise TypeError(f"a result that holds a {type(value).__qualname__} cannot be saved")


def _from_tree(tree: Any, archive: zipfile.ZipFile) -> Any:
    if not isinstance(tree, dict):
        return tree
    [(name, content)] = tree.items()
    if name in ("array", "scalar"):
        npy = io.BytesIO(archive.read(f"{int(content)}.npy"))  # read whole, which checks its checksum
        array = np.lib.format.read_array(npy, allow_pickle=False)
        return array if name == "array" else array[()]
    if name in ("tuple", "list"):
        parts = [_from_tree(part, archive) for part in content]
        return tuple(parts) if name == "tuple" else parts
    if name != "record":
        raise ValueError(f"unknown type of value: {name}")
    module, class_name, parts_by_name = content
    values = {field: _from_tree(part, archive) for field, part in parts_by_name.items()}
    return _dataclass(module, class_name)(**values)


def _dataclass(module: str, name: str) -> Any:
    """Return a dataclass of the project; its module is loaded with the function that returned the result."""
    cls = getattr(sys.modules[module], name) if module.startswith("uavseg.") else None
    if not (isinstance(cls, type) and is_dataclass(cls)):
        raise ValueError(f"{module}.{name} is not a dataclass of the project")
    return cls
