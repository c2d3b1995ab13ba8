"""Checkpoints: an executor that saves each result in a folder, so that a stopped run can resume.

Each stage of the work (one function with its arguments: the rasters, how they are read, the stretch) has a
subfolder, and each tile a file in it. Both are named by a hash of everything that the result depends on: if
anything changes (a raster, an option, the tile size, the program itself), other files are used, and no stale
result is read. Runs share the stages that they have in common: a second range finds the rasters measured.

The format is that of an .npz file: one .npy for each array, and `tree.json` for the structure around them.
Decoding runs no code from the file: nothing is pickled, and only dataclasses of the project are created.
"""

import hashlib
import io
import json
import os
import struct
import sys
import zipfile
import zlib
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import fields, is_dataclass
from fractions import Fraction
from functools import lru_cache, partial
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg._version import __version__
from uavseg.arrays import Path_
from uavseg.errors import OutputError
from uavseg.execution.executors import Item, Map, Progress, Result, lazy_selection
from uavseg.output.atomic import atomic_file
from uavseg.output.disk import written_here
from uavseg.output.renames import recover
from uavseg.output.targets import check_utf8

_TREE = "tree.json"
_CODE = ("*.py", "*.csv", "*.json", "*.sql")  # whose change may change results
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

    `value` is None, a bool, int, float, str, array, tuple, list or dataclass of the project, of these, else a
    TypeError. `key` identifies the item that the result belongs to.
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
    """Read a result of `encode_result` for a key; DamagedResultError if damaged, or of another key."""
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
    # Its module is loaded with the function that returned the result.
    cls = getattr(sys.modules[module], class_name) if module.startswith("uavseg.") else None
    if not (isinstance(cls, type) and is_dataclass(cls)):
        raise ValueError(f"{module}.{class_name} is not a dataclass of the project")
    return cls(**values)


UNSAVED = ("corners", "is_filled_white", "statistics", "write_partition")
"""Stages that read a few pixels, which takes less time than their results' files would, or write files."""

_PLAIN = (bool, int, float, str, bytes, Fraction, np.dtype, np.generic)
_Feed = Callable[[bytes], object]
OnResume = Callable[[str, int, int], object]
"""Called with the name of a stage, how many of its tiles are done already, and how many it has."""


def with_checkpoint(map: Map, folder: Path_, on_resume: OnResume | None = None) -> Map:
    """Return an executor that saves every result in a folder, and reads those that it holds already.

    The calling thread reads and writes the files; only missing results are computed by the other executor.
    Results of the stages in `UNSAVED` are computed each time. A file is written whole or not at all; a
    damaged one is computed again. The folder remains at the end. `map` computes what is missing. The folder
    is created if it does not exist; its parent folder must exist. `on_resume` is called once for each stage
    of which some tiles are done already. An OutputError says that the name of the folder is empty, that it
    cannot be created, or that a result cannot be written to it.
    """
    if not os.fspath(folder):  # a Path takes it for the working directory
        raise OutputError("the name of the folder for resume is empty; name a folder, or leave resume out")
    root = Path(folder)
    check_utf8(root)
    _make_folder(root)
    written_here().kept.append(str(folder))

    def run(
        function: Callable[[Item], Result], items: Sequence[Item], progress: Progress | None = None
    ) -> Generator[Result, None, None]:
        name = stage_name(function)
        if name in UNSAVED:
            yield from map(function, items, progress)
            return
        stage = stage_folder(root, function)
        keys = [fingerprint(item) for item in items]
        recover(stage)
        existing = {path.name for path in stage.iterdir()}
        missing = [k for k, key in enumerate(keys) if f"{key}.npz" not in existing]
        if on_resume is not None and len(missing) < len(keys):
            on_resume(name, len(keys) - len(missing), len(keys))
        is_missing = set(missing)
        # Closing the results stops the workers, also where this generator is closed early.
        with closing(map(function, lazy_selection(items, missing))) as computed:
            for k, key in enumerate(keys):
                if k in is_missing:
                    result = next(computed)
                    _save(stage, key, result)
                else:
                    try:
                        result = decode_result((stage / f"{key}.npz").read_bytes(), key)
                    except (OSError, DamagedResultError):
                        [result] = map(function, lazy_selection(items, [k]))
                        _save(stage, key, result)
                yield result
                if progress is not None:
                    progress(k + 1, len(keys))

    return run


def stage_folder(root: Path, function: Any) -> Path:
    """Return the subfolder of a stage, which is made if it is not there."""
    folder = root / f"{stage_name(function)}-{fingerprint(__version__, _code_hash(), function)}"
    _make_folder(folder)
    return folder


def stage_name(function: Any) -> str:
    """Return the name of a stage for messages: "measure" for `_measure_tile` with any arguments."""
    while not hasattr(function, "__name__"):
        inner = getattr(function, "func", None) or getattr(function, "function", None)
        if inner is None:
            return type(function).__name__.strip("_").lower()
        function = inner
    return str(function.__name__).strip("_").removesuffix("_tile")


@lru_cache
def _code_hash() -> str:
    """Hash the package's source and tables: two states of it between two releases have the same version."""
    hasher, root = hashlib.sha256(), Path(__file__).parents[1]
    for path in sorted(path for kind in _CODE for path in root.rglob(kind)):
        hasher.update(path.read_bytes())
    return hasher.hexdigest()


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        reason = "it is a file" if isinstance(error, FileExistsError) else error.strerror
        raise OutputError(f"the folder {folder} to resume from cannot be created: {reason}") from error


def _save(stage: Path, key: str, result: Any) -> None:
    """Write a result; not synced, since a file torn by a power cut is detected and computed again."""
    with atomic_file(stage / f"{key}.npz", overwrite=True, sync=False) as path:
        path.write_bytes(encode_result(result, key))


def fingerprint(*values: Any) -> str:
    """Hash values, their types and all their content; 32 hexadecimal digits, identical across processes.

    An object with a method `fingerprint` is hashed by what the method returns. Dataclasses, arrays,
    sequences, numbers, strings and plain objects are hashed by their content, functions of a module by their
    name, and partial functions by their arguments too.

    Examples
    --------
    >>> fingerprint((1, 2)) == fingerprint((1, 2))
    True
    >>> fingerprint((1, 2)) == fingerprint((1, 2.0))
    False
    """
    hasher = hashlib.sha256()
    for value in values:
        _feed(hasher.update, value)
    return hasher.hexdigest()[:32]


def _feed(feed: _Feed, value: Any) -> None:
    _mark(feed, f"{type(value).__module__}.{type(value).__qualname__}")
    if value is None:
        return
    if isinstance(value, _PLAIN):
        _mark(feed, repr(value))
    elif isinstance(value, np.ndarray):
        if value.dtype.hasobject:
            raise TypeError("an array of objects has no bytes to hash")
        _mark(feed, f"{value.dtype.str}{value.shape}")
        feed(value.tobytes())
    elif isinstance(value, tuple | list):
        _mark(feed, str(len(value)))
        for part in value:
            _feed(feed, part)
    elif isinstance(value, FunctionType):
        _mark(feed, _name(value))
    else:
        for part in _content(value):
            _feed(feed, part)


def _mark(feed: _Feed, text: str) -> None:
    """Feed a text with its length in front, so that no two sequences of texts give the same bytes."""
    feed(f"{len(text)}:{text}".encode())


def _name(function: FunctionType) -> str:
    if "<" in function.__qualname__:
        why = f"{function.__qualname__} is not a function of a module"
        raise TypeError(f"{why}, so its name does not identify it")
    return f"{function.__module__}.{function.__qualname__}"


def _content(value: Any) -> list[Any]:
    """List the content of an object in a fixed order."""
    if hasattr(value, "fingerprint"):
        return [value.fingerprint()]
    if isinstance(value, partial):
        return [value.func, value.args, sorted(value.keywords.items())]
    if is_dataclass(value):
        return [getattr(value, field.name) for field in fields(value)]
    if not hasattr(value, "__dict__"):
        raise TypeError(f"a {type(value).__qualname__} has no content to hash")
    return sorted(vars(value).items())
