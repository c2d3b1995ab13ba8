"""Columns of regions as Arrow arrays, without pandas."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import OutputError


def null_for_nan(column: NDArray[Any]) -> Any:
    """A column as an Arrow array; NaN and None are null."""
    import pyarrow

    if column.dtype != object:
        return pyarrow.array(column, from_pandas=True)
    texts = [None if text is None or text != text else text.encode() for text in column.tolist()]
    return arrow_bytes(texts, pyarrow.string())


def arrow_bytes(values: list[bytes | None], kind: Any) -> Any:
    """Texts or bytes as an Arrow array, from buffers: `pyarrow.array` imports pandas to look at objects."""
    import pyarrow

    mask = None
    if None in values:
        there = [value is not None for value in values]
        mask = pyarrow.py_buffer(np.packbits(there, bitorder="little"))
        values = [value or b"" for value in values]
    ends = np.zeros(len(values) + 1, np.int64)
    np.cumsum(np.fromiter(map(len, values), np.int64, len(values)), out=ends[1:])  # type: ignore[arg-type]
    if ends[-1] > np.iinfo(np.int32).max:
        raise OutputError("one batch of regions holds more than 2 GB of text or corners; simplify them")
    content = [mask, pyarrow.py_buffer(ends.astype(np.int32)), pyarrow.py_buffer(b"".join(values))]  # type: ignore[arg-type]
    return pyarrow.Array.from_buffers(kind, len(values), content)
