"""Streaming connected-component labelling (8-connectivity) of thin structures, chunk by chunk of rows.

Chunks of whole rows are labelled one after the other by union-find; components that run into the next chunk
are united there. Only a few sums for each component are kept.
"""

from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.dataclass import dataclass
from uavseg.segmentation.components import WORD, number_roots, root_of, union_roots

_CERTAIN = 1 << 20  # evidence of a cell with v = 1: more than any rule requires

Mask = NDArray[np.uint8]


@dataclass
class ThinComponents:
    """Components of a mask of `cols` columns, chunk by chunk from the top."""

    cols: int
    _count: int = 0
    _above: NDArray[np.int64] = field(init=False)  # components of the row above the next chunk, from 1
    _sums: list[NDArray[np.int64]] = field(default_factory=list)
    _pairs: list[NDArray[np.int64]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._above = np.zeros(self.cols, np.int64)

    def add(self, mask: Mask, evidence: Mask, attached: Mask) -> tuple[NDArray[np.uint32], int]:
        """Add a chunk; return its labels, and the number of components in chunks before.

        The arrays are (M, N), with N a multiple of 8: 1 where a cell belongs to a component; its evidence; 1
        where it touches an occupied cell.
        """
        labels, count = label_8_connected(mask)
        sums = np.zeros((3, count), np.int64)
        if count:
            _sum_components(labels, mask.view(np.uint64), evidence, attached, sums)
        self._sums.append(sums)
        self._unite(self._ids(labels[0]))
        self._above = self._ids(labels[-1])
        before = self._count
        self._count += count
        return labels, before

    def totals(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the structure that each chunk's component belongs to, and the sums of all structures.

        A structure is named by its first component, (n,). The sums, (3, n), are cells, evidence of strong
        cells, and cells beside occupied ones, at these components; 0 elsewhere.
        """
        pairs = np.concatenate([np.empty((0, 2), np.int64), *self._pairs])
        roots = union_roots(pairs, self._count)
        parts = np.concatenate([np.zeros((3, 0), np.int64), *self._sums], axis=1)
        sums = np.zeros_like(parts)
        for total, part in zip(sums, parts, strict=True):
            np.add.at(total, roots, part)
        return roots, sums

    def _ids(self, labels: NDArray[np.uint32]) -> NDArray[np.int64]:
        """Number the components of a row of the next chunk from 1 through all chunks."""
        return np.where(labels > 0, labels + np.int64(self._count), 0)

    def _unite(self, first: NDArray[np.int64]) -> None:
        """Unite the components of a chunk's first row with those that touch them from above."""
        for here, above in (
            (first, self._above),
            (first[1:], self._above[:-1]),
            (first[:-1], self._above[1:]),
        ):
            touching = (here > 0) & (above > 0)
            if touching.any():
                pairs = np.stack([here[touching], above[touching]], axis=1) - 1
                self._pairs.append(np.unique(pairs, axis=0))


def label_8_connected(mask: Mask) -> tuple[NDArray[np.uint32], int]:
    """Label the 8-connected components of a mask in raster order of their first pixels, and count them.

    N, the number of columns, is a multiple of 8.

    Examples
    --------
    >>> mask = np.array([[1, 0, 0, 1, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0, 1, 1]], np.uint8)
    >>> label_8_connected(mask)[0]
    array([[1, 0, 0, 2, 0, 0, 0, 0],
           [0, 1, 0, 0, 0, 0, 3, 3]], dtype=uint32)
    """
    labels = np.zeros(mask.shape, np.uint32)
    if not mask.any():
        return labels, 0
    max_count = (mask.shape[0] + 1) // 2 * ((mask.shape[1] + 1) // 2)
    return labels, _label(mask, mask.view(np.uint64), labels, np.empty(max_count + 1, np.uint32))


@kernel("i8(u1[:,::1], u8[:,::1], u4[:,::1], u4[::1])")
def _label(mask, words, labels, parents):  # type: ignore[no-untyped-def]
    # The smaller label is the root, so roots are in raster order; the second pass renumbers them. Words are
    # eight pixels each.
    rows, cols = mask.shape
    used = np.uint32(0)
    parents[0] = 0
    for r in range(rows):
        for word in range(words.shape[1]):
            if words[r, word] == 0:
                continue
            for c in range(word * WORD, word * WORD + WORD):
                if mask[r, c] == 0:
                    continue
                label = labels[r, c - 1] if c > 0 else np.uint32(0)
                for k in range(max(c - 1, 0), min(c + 2, cols) if r > 0 else 0):
                    if labels[r - 1, k]:
                        root = root_of(parents, labels[r - 1, k])
                        if label != 0:
                            label = root_of(parents, label)
                            parents[max(label, root)] = min(label, root)
                            root = min(label, root)
                        label = root
                if label == 0:
                    used += np.uint32(1)
                    parents[used] = used
                    label = used
                labels[r, c] = label
    count = number_roots(parents, used)
    for r in range(rows):
        for word in range(words.shape[1]):
            if words[r, word]:
                for c in range(word * WORD, word * WORD + WORD):
                    labels[r, c] = parents[labels[r, c]]
    return count


@kernel("void(u4[:,::1], u8[:,::1], u1[:,::1], u1[:,::1], i8[:,::1])")
def _sum_components(labels, words, evidence, attached, sums):  # type: ignore[no-untyped-def]
    for r in range(labels.shape[0]):
        for word in range(words.shape[1]):
            if words[r, word] == 0:
                continue
            for c in range(word * WORD, word * WORD + WORD):
                if labels[r, c] == 0:
                    continue
                k = np.int64(labels[r, c]) - 1
                sums[0, k] += 1
                if evidence[r, c] & 128:
                    part = np.int64(evidence[r, c] & 127) - 1
                    sums[1, k] += part if part < 126 else _CERTAIN
                sums[2, k] += attached[r, c]
