"""All scans of states over a whole image, in place of strip by strip."""

import numpy as np
from numpy.typing import NDArray

from uavseg.arrays import Uint8s
from uavseg.segmentation.states.state_scans import (
    LOOKAHEAD,
    compact_columns,
    compact_rows,
    decode_states,
    resolve_columns,
    resolve_rows,
)


def refine_states(codes: Uint8s) -> NDArray[np.uint8]:
    """Run all eight scans over a whole (M, N) image, whose codes are changed in place; return its states.

    Examples
    --------
    >>> from uavseg.segmentation.states.state_scans import encode_states
    >>> unknown_beside_free = np.array([[2, 1, 1, 1]], np.uint8)
    >>> half_but_for_the_last = np.array([[2, 2, 2, 1]], np.uint8)
    >>> refine_states(encode_states(unknown_beside_free, half_but_for_the_last))
    array([[2, 2, 2, 1]], dtype=uint8)
    """
    rows, cols = codes.shape
    compact_rows(codes)
    for upwards in (True, False):
        compact_columns(codes, np.zeros(cols, np.uint8), upwards)
    resolve_rows(codes)
    padded = np.zeros((rows + 2 * LOOKAHEAD, cols), np.uint8)
    padded[LOOKAHEAD:-LOOKAHEAD] = codes
    resolve_columns(padded[:-LOOKAHEAD], np.zeros(cols, np.uint8), True)
    resolve_columns(padded[LOOKAHEAD:], np.zeros(cols, np.uint8), False)
    codes[:] = padded[LOOKAHEAD:-LOOKAHEAD]
    return decode_states(codes)
