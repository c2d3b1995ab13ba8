"""Poses over time: linear interpolation of positions, slerp of rotations."""

import math
from array import array
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from uavseg.occupancy.mapping.rotation import matrix_of_quaternion, slerp

Floats = NDArray[np.float64]

MIN_LENGTH = 1e-6  # of a quaternion; a shorter one is no rotation
MAX_GAP_NS = 1_000_000_000  # between two poses; what moved in between for longer is not known


@dataclass(frozen=True, slots=True, eq=False)
class Transform:
    """A pose in space: rotation, then shift.

    Parameters
    ----------
    matrix : (3, 3) float64 array
    shift : (3,) float64 array
        In metres.
    """

    matrix: Floats
    shift: Floats

    def then(self, inner: "Transform") -> "Transform":
        """The pose of what lies at `inner` within this pose."""
        return Transform(self.matrix @ inner.matrix, self.matrix @ inner.shift + self.shift)


IDENTITY = Transform(np.eye(3), np.zeros(3))


@dataclass(frozen=True, slots=True, eq=False)
class PoseTrack:
    """Poses of one frame in another, over time.

    Parameters
    ----------
    times : (n,) int64 array
        In nanoseconds, increasing.
    shifts : (n, 3) float64 array
    quaternions : (n, 4) float64 array
        Unit ones, x, y, z, w.
    """

    times: NDArray[np.int64]
    shifts: Floats
    quaternions: Floats

    def at(self, time: int) -> Transform | None:
        """The pose at a time in nanoseconds.

        None before the first and after the last pose, and where the poses around are more than a second
        apart: nothing is extrapolated.
        """
        after = int(np.searchsorted(self.times, time))
        if after < len(self.times) and self.times[after] == time:
            return Transform(matrix_of_quaternion(self.quaternions[after]), self.shifts[after])
        if after in (0, len(self.times)):
            return None
        start, end = int(self.times[after - 1]), int(self.times[after])
        if end - start > MAX_GAP_NS:
            return None
        share = (time - start) / (end - start)
        shift = self.shifts[after - 1] + share * (self.shifts[after] - self.shifts[after - 1])
        turned = slerp(self.quaternions[after - 1], self.quaternions[after], share)
        return Transform(matrix_of_quaternion(turned), shift)


@dataclass(frozen=True, slots=True)
class PoseLog:
    """Poses as they are read, in any order; 64 bytes each."""

    _times: "array[int]" = field(default_factory=lambda: array("q"))
    _numbers: "array[float]" = field(default_factory=lambda: array("d"))

    def __len__(self) -> int:
        return len(self._times)

    def add(
        self, time: int, shift: tuple[float, float, float], turn: tuple[float, float, float, float]
    ) -> bool:
        """Add a pose; False if it is none: a number is not finite, or the quaternion of length 0."""
        length = math.hypot(*turn)
        if not (math.isfinite(sum(shift)) and math.isfinite(length) and length > MIN_LENGTH):
            return False
        self._times.append(time)
        self._numbers.extend((*shift, *(number / length for number in turn)))
        return True

    def track(self) -> PoseTrack:
        """The poses in the order of time; of several at one time, the last one that was added."""
        times = np.array(self._times, np.int64)
        poses = np.array(self._numbers, np.float64).reshape(-1, 7)
        order = np.argsort(times, kind="stable")
        is_last = np.append(np.diff(times[order]) > 0, np.ones(min(len(times), 1), bool))
        order = order[is_last]
        return PoseTrack(times[order], poses[order, :3], poses[order, 3:])
