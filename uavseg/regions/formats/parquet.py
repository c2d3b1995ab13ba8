"""Import of pyarrow, an optional dependency for GeoParquet, and arrays for it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import MissingLibraryError, OutputError


def import_pyarrow() -> Any:
    """Return pyarrow with its Parquet module; raise a MissingLibraryError where it is not installed."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] != "pyarrow":
            raise
        raise MissingLibraryError(
            "GeoParquet needs pyarrow, which is not installed; install it with: "
            'pip install "uavseg[parquet]", or choose another format, such as .gpkg'
        ) from error
    return pyarrow


def arrow_array(column: NDArray[Any], kind: Any) -> Any:
    """Return a column as an array of pyarrow; NaN and None are null.

    Not `pyarrow.array`, which imports pandas to see that a column is none of its arrays: 0.16 s. The column,
    (n,), is int64, float64, or objects that are texts or bytes; `kind` is the type int64, float64, string or
    binary. An OutputError says that its texts or bytes have more than 2 GB.
    """
    pyarrow = import_pyarrow()
    buffers: tuple[NDArray[Any] | bytes, ...]
    if column.dtype != object:
        there, buffers = column == column, (np.ascontiguousarray(column),)
    else:
        values = [text.encode() if isinstance(text, str) else text for text in column]
        there = np.array([isinstance(value, bytes) for value in values], bool)
        parts = [value if is_there else b"" for value, is_there in zip(values, there, strict=True)]
        ends = np.cumsum([0, *map(len, parts)])
        if ends[-1] > np.iinfo(np.int32).max:
            raise OutputError("one batch of regions holds more than 2 GB of text or corners; simplify them")
        buffers = (ends.astype(np.int32), b"".join(parts))
    mask = None if there.all() else pyarrow.py_buffer(np.packbits(there, bitorder="little"))
    return pyarrow.Array.from_buffers(kind, len(column), [mask, *map(pyarrow.py_buffer, buffers)])
