"""Tracking of segments: connected components keep their numbers while they move, touch and part.

A component takes the number whose cells it covers most, or that was nearest. Where segments merge, one number
stays and the others rest in it, with the cells that they had alone; a part that splits off takes one of them.
A number that vanished comes back at its place within some updates. Others are new; none is used twice.
"""

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from uavseg.dataclass import dataclass

REACH = 3.0  # cells of 8 x 8 pixels between the centres of a segment that moved without overlap
PATIENCE = 5  # updates after which a number that vanished does not come back

Groups = Mapping[int, tuple[int, ...]]


@dataclass(frozen=True, slots=True)
class SegmentChanges:
    """What became of segments since the last call, by number."""

    appeared: tuple[int, ...]
    vanished: tuple[int, ...]
    moved: tuple[int, ...]  # their centres, by half a cell and more
    split: Groups  # what came out of a segment
    merged: Groups  # what has become part of a segment


class SegmentTracks:
    """Numbers of the segments of one interval; `numbers` (8 B, 8 C) has that of each cell, 0 for none."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.numbers = np.zeros(shape, np.int64)
        self._last = self._time = 0
        self._hosts: dict[int, int] = {}  # the segment that each number is in: itself, another, or 0
        self._cells: dict[int, NDArray[np.int64]] = {}  # flat cells of each number when it was last alone
        self._seen: dict[int, int] = {}  # when each number was last there

    def update(self, inside: NDArray[np.bool_]) -> SegmentChanges:
        """Number the components of cells (8 B, 8 C), and tell what changed."""
        from scipy import ndimage

        components, count = ndimage.label(inside, np.ones((3, 3), bool))
        labels, before, old = components.ravel(), self.numbers.ravel(), self._hosts
        cells = {label: np.flatnonzero(labels == label) for label in range(1, count + 1)}
        ties = {pair for pair in set(zip(before.tolist(), labels.tolist(), strict=True)) if all(pair)}
        lonely = cells.keys() - {label for _, label in ties}
        centres = {one: self._centre(where) for one, where in self._cells.items()}
        found = {label: self._centre(where) for label, where in cells.items()}
        wanted: list[tuple[int, float, int, int, int]] = []  # rank and its values, number, label
        for one, host in old.items():
            covered = dict(zip(*np.unique_counts(labels[self._cells[one]]), strict=True))
            wanted += [
                (0 if host else 1, -int(covered.get(label, 0)), -len(cells[label]), one, label)
                for label in cells
                if (host, label) in ties or (not host and label in covered)
            ]
            distances = {label: float(np.hypot(*(found[label] - centres[one]))) for label in lonely if host}
            wanted += [(2, far, 0, one, label) for label, far in distances.items() if far <= REACH]
        labels_of: dict[int, int] = {}
        for *_, one, label in sorted(wanted):
            if one not in labels_of and label not in labels_of.values():
                labels_of[one] = label
        for label in cells.keys() - set(labels_of.values()):
            self._last += 1
            labels_of[self._last] = label
        numbers = {label: one for one, label in labels_of.items()}
        self._time += 1
        hosts = {one: one for one in labels_of}
        for one in old.keys() - labels_of.keys():
            inner = [numbers[label] for host, label in sorted(ties) if host == old[one]]
            if inner or self._time - self._seen[one] < PATIENCE:
                hosts[one] = inner[0] if inner else 0
        came = {one: [host for host, label in ties if label == labels_of[one]] for one in labels_of}
        changes = SegmentChanges(
            appeared=tuple(one for one in labels_of if not old.get(one) and not came[one]),
            vanished=tuple(one for one, host in old.items() if host and not hosts.get(one)),
            moved=tuple(
                one
                for one, label in labels_of.items()
                if old.get(one) == one and np.hypot(*(found[label] - centres[one])) >= 0.5
            ),
            split=_grouped(
                (old.get(one) or min(came[one]), one)
                for one in labels_of
                if old.get(one) != one and (old.get(one) or came[one])
            ),
            merged=_grouped((host, one) for one, host in hosts.items() if host not in (0, one, old.get(one))),
        )
        self._hosts, busy = hosts, {host for one, host in hosts.items() if one != host}
        for one, label in labels_of.items():
            if one not in busy or one not in self._cells:
                self._cells[one] = cells[label]
        self._cells = {one: self._cells[one] for one in hosts}
        self._seen = {one: self._time if host else self._seen[one] for one, host in hosts.items()}
        self.numbers = np.array([0, *(numbers[label] for label in cells)])[components]
        return changes

    def _centre(self, cells: NDArray[np.int64]) -> NDArray[np.float64]:
        return np.asarray(np.array(np.unravel_index(cells, self.numbers.shape)).mean(axis=1))


def _grouped(pairs: Iterable[tuple[int, int]]) -> Groups:
    groups: dict[int, tuple[int, ...]] = {}
    for host, one in sorted(pairs):
        groups[host] = (*groups.get(host, ()), one)
    return groups
