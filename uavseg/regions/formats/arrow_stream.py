"""Regions as a stream of Arrow record batches, through the Arrow C stream interface.

GDAL (through pyogrio) and pyarrow read it; making it needs neither. A batch is made when the reader asks for
it, and is kept until the reader releases it.

The structures are those of https://arrow.apache.org/docs/format/CDataInterface.html, and of
CStreamInterface.html beside it.

Not `pyogrio.raw.write`: the same FlatGeobuf and Shapefile, but a fifth to a third slower, with all regions
in memory at once. Not pyarrow: 170 MB, an extra. Not nanoarrow: its stream is made of a list of all batches.
"""

import ctypes
import itertools
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.errors import OutputError
from uavseg.regions import shapes
from uavseg.regions.table import Regions

GEOMETRY = "geometry"
_FORMATS = {"i": b"l", "f": b"g", "O": b"u"}  # by the kind of a numpy dtype: int64, float64, text
_WKB = b"z"
_STRUCT = b"+s"
_NULLABLE = 2
_POINTER = ctypes.c_void_p
Buffers = list[NDArray[Any] | bytes | None]


class _Schema(ctypes.Structure):
    pass


class _Array(ctypes.Structure):
    pass


class _Stream(ctypes.Structure):
    pass


_Schema._fields_ = [
    ("format", ctypes.c_char_p),
    ("name", ctypes.c_char_p),
    ("metadata", ctypes.c_char_p),
    ("flags", ctypes.c_int64),
    ("n_children", ctypes.c_int64),
    ("children", ctypes.POINTER(ctypes.POINTER(_Schema))),
    ("dictionary", _POINTER),
    ("release", _POINTER),
    ("private_data", _POINTER),
]
_Array._fields_ = [
    ("length", ctypes.c_int64),
    ("null_count", ctypes.c_int64),
    ("offset", ctypes.c_int64),
    ("n_buffers", ctypes.c_int64),
    ("n_children", ctypes.c_int64),
    ("buffers", ctypes.POINTER(_POINTER)),
    ("children", ctypes.POINTER(ctypes.POINTER(_Array))),
    ("dictionary", _POINTER),
    ("release", _POINTER),
    ("private_data", _POINTER),
]
_Stream._fields_ = [
    ("get_schema", _POINTER),
    ("get_next", _POINTER),
    ("get_last_error", _POINTER),
    ("release", _POINTER),
    ("private_data", _POINTER),
]

_kept: dict[int, Any] = {}
"""What schemas and arrays that a reader holds are made of, by their private data."""
_numbers = itertools.count(1)


def _releasing(kind: type[Any]) -> Any:
    """Return the function that releases a structure and its children, as C calls it."""

    def release(pointer: Any) -> None:
        released = pointer.contents
        for k in range(released.n_children):
            released.children[k].contents.release = None
        released.release = None
        _kept.pop(released.private_data, None)

    return ctypes.CFUNCTYPE(None, ctypes.POINTER(kind))(release)


def _release_stream(pointer: Any) -> None:
    number = pointer.contents.private_data
    pointer.contents.release = None
    _kept.pop(number, None)


_RELEASE_STREAM = ctypes.CFUNCTYPE(None, ctypes.POINTER(_Stream))(_release_stream)
_RELEASE = {_Schema: _releasing(_Schema), _Array: _releasing(_Array)}


class RegionStream:
    """Regions as a stream of Arrow record batches; it is read once.

    Parameters
    ----------
    regions : Regions
    promote : bool
        Whether every geometry becomes a MultiPolygon.

    Attributes
    ----------
    stopped : list of BaseException
        What ended the stream too early, such as Ctrl-C. The reader sees a shorter stream: it cannot raise
        this, and it could not call back to release the stream while it raises something else.
    """

    def __init__(self, regions: Regions, promote: bool = False) -> None:
        self.stopped: list[BaseException] = []
        self._regions = regions
        self._batches = batches(regions, promote)
        self._stream = _Stream()
        self._functions = [
            ctypes.CFUNCTYPE(ctypes.c_int, _POINTER, ctypes.POINTER(_Schema))(self._get_schema),
            ctypes.CFUNCTYPE(ctypes.c_int, _POINTER, ctypes.POINTER(_Array))(self._get_next),
            ctypes.CFUNCTYPE(_POINTER, _POINTER)(lambda stream: None),
            _RELEASE_STREAM,
        ]
        names = ("get_schema", "get_next", "get_last_error", "release")
        for name, function in zip(names, self._functions, strict=True):
            setattr(self._stream, name, ctypes.cast(function, _POINTER))

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """Return the stream as a PyCapsule; another schema than that of the regions is not given."""
        capsule = ctypes.pythonapi.PyCapsule_New
        capsule.restype, capsule.argtypes = ctypes.py_object, [_POINTER, ctypes.c_char_p, _POINTER]
        self._stream.private_data = next(_numbers)
        _kept[self._stream.private_data] = self
        made: object = capsule(ctypes.addressof(self._stream), _CAPSULE, None)
        return made

    def _get_schema(self, stream: object, out: Any) -> int:
        fields = [(name, _FORMATS[column.dtype.kind]) for name, column in self._regions.columns.items()]
        children = [_Schema(kind, name.encode(), None, _NULLABLE) for name, kind in fields]
        children.append(_Schema(_WKB, GEOMETRY.encode(), None, _NULLABLE))
        _hand_over(out, _Schema(_STRUCT, b""), children, [])
        return 0

    def _get_next(self, stream: object, out: Any) -> int:
        try:
            batch = next(self._batches, None)
            if batch is None:
                out.contents.release = None  # the end
                return 0
            length, columns = batch
            made = [_array(length, buffers) for buffers in columns]
            _hand_over(out, _array(length, [None])[0], [array for array, _ in made], [made, columns])
            return 0
        except BaseException as error:
            self.stopped.append(error)
            out.contents.release = None
            return 0


_CAPSULE = b"arrow_array_stream"


def _hand_over(out: Any, made: Any, children: list[Any], kept: list[Any]) -> None:
    """Copy a structure to where the reader asked for it, and keep what it is made of until its release."""
    kind = type(made)
    for child in children:
        child.release = ctypes.cast(_RELEASE[kind], _POINTER)
    pointers = (ctypes.POINTER(kind) * len(children))(*map(ctypes.pointer, children))
    made.n_children, made.children = len(children), pointers
    made.release = ctypes.cast(_RELEASE[kind], _POINTER)
    made.private_data = next(_numbers)
    _kept[made.private_data] = [made, children, pointers, *kept]
    ctypes.memmove(out, ctypes.byref(made), ctypes.sizeof(kind))


def _array(length: int, buffers: Buffers) -> tuple[_Array, Any]:
    """An array of buffers, the first of which says what is there (None: all); and what it points to."""
    addresses = (_POINTER * len(buffers))(*map(_address, buffers))
    missing = 0 if buffers[0] is None else -1  # -1: not counted
    return _Array(length, missing, 0, len(buffers), 0, addresses), addresses


def _address(buffer: NDArray[Any] | bytes | None) -> int | None:
    if buffer is None:
        return None
    if isinstance(buffer, bytes):
        return ctypes.cast(ctypes.c_char_p(buffer), _POINTER).value
    address: int = buffer.ctypes.data
    return address


def batches(regions: Regions, promote: bool = False) -> Iterator[tuple[int, list[Buffers]]]:
    """Length and columns of each batch as the buffers of Arrow; the last column is the geometry as WKB."""
    for part in shapes.batch_slices(regions.polygons):
        polygons = regions.polygons[part]
        if promote:
            polygons = _as_multipolygons(polygons)
        columns = [_buffers_of(column[part]) for column in regions.columns.values()]
        yield len(polygons), [*columns, _buffers_of_bytes(shapely.to_wkb(polygons).tolist())]


def _as_multipolygons(polygons: NDArray[Any]) -> NDArray[Any]:
    parts, owners = shapely.get_parts(polygons, return_index=True)
    multipolygons: NDArray[Any] = shapely.multipolygons(parts, indices=owners)
    return multipolygons


def _buffers_of(column: NDArray[Any]) -> Buffers:
    """Return numbers or texts; what is not a number, and a text that is missing, is null."""
    if column.dtype != object:
        values = np.ascontiguousarray(column, np.int64 if column.dtype.kind == "i" else np.float64)
        return [_bits(values == values), values]
    return _buffers_of_bytes([None if text is None or text != text else text.encode() for text in column])


def _buffers_of_bytes(values: Sequence[bytes | None]) -> Buffers:
    there = np.fromiter((value is not None for value in values), bool, len(values))
    ends = np.zeros(len(values) + 1, np.int64)
    np.cumsum([len(value or b"") for value in values], out=ends[1:])
    if ends[-1] > np.iinfo(np.int32).max:
        raise OutputError("one batch of regions holds more than 2 GB of text or corners; simplify them")
    return [_bits(there), ends.astype(np.int32), b"".join(value or b"" for value in values)]


def _bits(there: NDArray[np.bool_]) -> NDArray[np.uint8] | None:
    return None if there.all() else np.packbits(there, bitorder="little")
