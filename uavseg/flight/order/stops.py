"""Stops of a tour: each is flown in one of several options, which enter and leave at different points."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Stops:
    """Stops 0..n - 1 with their options, one array entry for each option.

    Parameters
    ----------
    first : (n + 1,) int64 array
        Where the options of each stop begin; their number at the end.
    enters, leaves : (m,) int64 arrays
        The points at which an option is entered and left.
    costs : (m,) float64 array
        Cost of flying an option.
    reverse : (m,) int64 array
        The option of the same stop that is flown the other way round; itself where both points are one.
    """

    first: Ints
    enters: Ints
    leaves: Ints
    costs: Floats
    reverse: Ints

    @classmethod
    def of(cls, options: Sequence[Ints], costs: Sequence[Floats] | None = None) -> "Stops":
        """Stops from pairs of points (k, 2), entered and left, for each; the reverse of a pair is one too.

        Parameters
        ----------
        options : sequence of (k, 2) int64 arrays
        costs : sequence of (k,) float64 arrays, optional
            By default options cost nothing.
        """
        first = np.concatenate([[0], np.cumsum([len(pairs) for pairs in options])]).astype(np.int64)
        pairs = np.concatenate(options).astype(np.int64)
        spent = np.zeros(len(pairs)) if costs is None else np.concatenate(costs).astype(np.float64)
        reverse = np.empty(len(pairs), np.int64)
        for begin, end in zip(first[:-1].tolist(), first[1:].tolist(), strict=True):
            where = {
                (enters, leaves, cost): begin + k
                for k, (enters, leaves, cost) in reversed(
                    list(enumerate(zip(*pairs[begin:end].T.tolist(), spent[begin:end].tolist(), strict=True)))
                )
            }
            for k in range(begin, end):
                reverse[k] = where[pairs[k, 1], pairs[k, 0], spent[k]]
        return cls(first, pairs[:, 0].copy(), pairs[:, 1].copy(), spent, reverse)

    def __len__(self) -> int:
        return len(self.first) - 1

    @property
    def stop_of(self) -> Ints:
        """The stop of each option."""
        return np.repeat(np.arange(len(self)), np.diff(self.first))
