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
MAX_ABSENT_UPDATES = 5  # updates after which a number that vanished does not come back

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
        self._last = 0
        # The segment that each number is in: itself, or another; or minus the updates since it vanished.
        self._hosts: dict[int, int] = {}
        self._cells: dict[int, NDArray[np.int64]] = {}  # flat cells of each number when it was last alone

    def update(self, inside: NDArray[np.bool_]) -> SegmentChanges:
        """Number the components of cells (8 B, 8 C), and tell what changed."""
        from scipy import ndimage

        components, count = ndimage.label(inside, np.ones((3, 3), bool))
        labels, before, old = components.ravel(), self.numbers.ravel(), self._hosts
        cells = {label: np.flatnonzero(labels == label) for label in range(1, count + 1)}
        shared = (labels > 0) & (before > 0)
        pairs = np.unique(np.stack([before[shared], labels[shared]], 1), axis=0).tolist()
        ties = {(host, label) for host, label in pairs}
        lonely = cells.keys() - {label for _, label in ties}
        centres = {one: self._centre(where) for one, where in self._cells.items()}
        found = {label: self._centre(where) for label, where in cells.items()}
        wanted: list[tuple[int, float, int, int, int]] = []  # rank and its values, number, label
        for one, host in old.items():
            covered = dict(zip(*np.unique_counts(labels[self._cells[one]]), strict=True))
            for label in cells:
                if (host, label) in ties or (host < 0 and label in covered):
                    sizes = -int(covered.get(label, 0)), -len(cells[label])
                    wanted.append((int(host < 0), *sizes, one, label))
                elif host > 0 and label in lonely and (far := _gap(found[label], centres[one])) <= REACH:
                    wanted.append((2, far, 0, one, label))
        labels_of: dict[int, int] = {}
        taken: set[int] = set()
        for *_, one, label in sorted(wanted):
            if one not in labels_of and label not in taken:
                labels_of[one] = label
                taken.add(label)
        for label in sorted(cells.keys() - taken):
            self._last += 1
            labels_of[self._last] = label
        numbers = {label: one for one, label in labels_of.items()}
        hosts = {one: one for one in labels_of}
        for one in old.keys() - labels_of.keys():
            inner = [numbers[label] for host, label in pairs if host == old[one]]
            if inner or old[one] > -MAX_ABSENT_UPDATES:
                hosts[one] = inner[0] if inner else min(old[one], 0) - 1
        came = {one: [host for host, label in pairs if label == labels_of[one]] for one in labels_of}
        was = {one: max(old.get(one, 0), 0) for one in hosts}
        stay = [one for one in labels_of if was[one] == one]
        changes = SegmentChanges(
            appeared=tuple(one for one in labels_of if not was[one] and not came[one]),
            vanished=tuple(one for one, host in old.items() if host > 0 >= hosts.get(one, 0)),
            moved=tuple(one for one in stay if _gap(found[labels_of[one]], centres[one]) >= 0.5),
            split=_grouped(
                (was[one] or min(came[one], default=0), one) for one in labels_of if was[one] != one
            ),
            merged=_grouped((host, one) for one, host in hosts.items() if host not in (one, was[one])),
        )
        busy = {host for one, host in hosts.items() if one != host}
        shown = {one: cells[label] for one, label in labels_of.items()}
        kept = shown | self._cells | {one: where for one, where in shown.items() if one not in busy}
        self._hosts, self._cells = hosts, {one: kept[one] for one in hosts}
        self.numbers = np.array([0, *(numbers[label] for label in cells)])[components]
        return changes

    def _centre(self, cells: NDArray[np.int64]) -> NDArray[np.float64]:
        return np.asarray(np.array(np.unravel_index(cells, self.numbers.shape)).mean(axis=1))


def _gap(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    return float(np.hypot(*(one - other)))


def _grouped(pairs: Iterable[tuple[int, int]]) -> Groups:
    known = sorted(pair for pair in pairs if pair[0] > 0)
    return {host: tuple(one for first, one in known if first == host) for host, _ in known}
