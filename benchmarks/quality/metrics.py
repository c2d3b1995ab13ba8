"""How near a mask comes to the truth, in five numbers."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.metrics import variation_of_information

Mask = NDArray[np.bool_]
NEAR = 2.0  # pixels


@dataclass(frozen=True, slots=True)
class Marks:
    """What is said of one answer.

    Parameters
    ----------
    iou : float
        Intersection over union, 1 at best.
    boundary_f : float
        Harmonic mean of precision and recall of boundary pixels within 2 pixels, 1 at best
        (Martin, Fowlkes and Malik 2004, without their one-to-one matching).
    vi : float
        Variation of information between the partitions into connected regions and ground, in bits, 0 at best
        (Meila 2007; scikit-image's).
    pieces : float
        Connected regions found per true region, 1 at best.
    area_error : float
        How far the area is off, as a share of the true one, 0 at best.
    """

    iou: float
    boundary_f: float
    vi: float
    pieces: float
    area_error: float


def marks(found: Mask, truth: Mask, valid: Mask) -> Marks:
    """All marks of an answer; pixels that are not valid never count.

    Parameters
    ----------
    found, truth, valid : (M, N) bool array
    """
    found, truth = found & valid, truth & valid
    (parts, count), (true_parts, true_count) = ndimage.label(found), ndimage.label(truth)
    splits, merges = variation_of_information(true_parts[valid], parts[valid])
    area, true_area = int(found.sum()), int(truth.sum())
    return Marks(
        iou(found, truth),
        boundary_f(found, truth, valid),
        float(splits + merges),
        count / max(true_count, 1),
        abs(area - true_area) / max(true_area, 1),
    )


def iou(found: Mask, truth: Mask) -> float:
    """Intersection over union; 1 where both are empty.

    Examples
    --------
    >>> iou(np.array([True, True, False]), np.array([False, True, True]))
    0.3333333333333333
    """
    either = int((found | truth).sum())
    return int((found & truth).sum()) / either if either else 1.0


def boundary_f(found: Mask, truth: Mask, valid: Mask, near: float = NEAR) -> float:
    """Harmonic mean of the shares of either boundary that lie within `near` pixels of the other one.

    Examples
    --------
    >>> there = np.zeros((9, 9), bool)
    >>> there[2:5, 2:5] = True
    >>> every = np.ones_like(there)
    >>> boundary_f(there, there, every), boundary_f(there, np.roll(there, 4, (0, 1)), every)
    (1.0, 0.0)
    """
    one, other = boundary(found, valid), boundary(truth, valid)
    if not one.any() or not other.any():
        return float(one.any() == other.any())
    precision, recall = _share_near(one, other, near), _share_near(other, one, near)
    return 2 * precision * recall / (precision + recall) if precision + recall else 0.0


def boundary(mask: Mask, valid: Mask) -> Mask:
    """Pixels of a mask beside a valid one that is not of it (4-connectivity).

    Examples
    --------
    >>> boundary(np.array([[1, 1, 1, 0]], bool), np.ones((1, 4), bool)).astype(int)
    array([[0, 0, 1, 0]])
    """
    return np.asarray(mask & ndimage.binary_dilation(valid & ~mask))


def _share_near(pixels: Mask, others: Mask, near: float) -> float:
    return float((ndimage.distance_transform_edt(~others)[pixels] <= near).mean())
